"""What instances share, and what each of them has for itself."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

from fabricusd.scene.copies import with_copies
from fabricusd.scene.placements import bounds_of
from fabricusd.scene.staging import framed_meshes
from fabricusd.scene.usd import instances as usd_instances
from fabricusd.scene.usd import placed_meshes
from tests.reference.stages import bind_fabric, new_stage, read, square
from tests.scene.surface.cages import CAGES, cage
from tests.scene.usd.test_instances import instancer, nested


def copies(stage: Usd.Stage, count: int = 3, **moves) -> list[Usd.Prim]:
    """Native instances of a square in a row."""
    square(stage, "/Protos/one/square")
    stage.GetPrimAtPath("/Protos").SetSpecifier(Sdf.SpecifierOver)
    made = []
    for k in range(count):
        prim = stage.DefinePrim(f"/row/copy{k}", "Xform")
        prim.GetReferences().AddInternalReference("/Protos/one")
        prim.SetInstanceable(True)
        UsdGeom.XformCommonAPI(prim).SetTranslate((3.0 * k, 0, 0))
        made.append(prim)
    return made


def test_instances_under_another_fabric_are_apart(tmp_path):
    stage = new_stage(tmp_path)
    made = copies(stage, 5)
    for prim in made[3:]:
        bind_fabric(stage, prim)
    scene = read(stage, instanced=True)
    assert [mesh.times for mesh in scene.meshes] == [3, 2]
    worn = [type(scene.materials[mesh.material[0]]).__name__ for mesh in scene.meshes]
    assert worn == ["PreviewSurface", "FabricSurface"]


def test_instances_of_another_inherited_colour_are_apart(tmp_path):
    stage = new_stage(tmp_path)
    made = copies(stage)
    UsdGeom.PrimvarsAPI(made[1]).CreatePrimvar(
        "displayColor", Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.constant
    ).Set([(1, 0, 0)])
    scene = read(stage, instanced=True)
    assert [mesh.times for mesh in scene.meshes] == [2, 1]
    assert scene.materials[scene.meshes[1].material[0]].diffuse == (1, 0, 0)


def test_an_instance_that_is_pressed_flat_is_a_copy(tmp_path):
    stage = new_stage(tmp_path)
    UsdGeom.XformCommonAPI(copies(stage)[0]).SetScale((1, 0, 1))
    scene, copied = read(stage, instanced=True), read(stage)
    assert sorted(mesh.times for mesh in scene.meshes) == [1, 2]
    found = sorted(mesh.points.mean(axis=0)[0] for mesh in with_copies(scene).meshes)
    assert found == pytest.approx([mesh.points.mean(axis=0)[0] for mesh in copied.meshes])


def test_copies_of_instances_have_a_bound(tmp_path, monkeypatch):
    monkeypatch.setattr(placed_meshes, "MOST_TRIANGLES", 3)
    stage = new_stage(tmp_path)
    for prim in copies(stage, 4):
        UsdGeom.XformCommonAPI(prim).SetScale((1, 0, 1))
    scene = read(stage, instanced=True)
    assert len(scene.meshes) == 3
    assert any("are left out: 2 of them have 4 triangles" in n for n in scene.notes)


def test_a_mesh_on_the_stage_may_be_a_prototype_as_well(tmp_path):
    stage = new_stage(tmp_path)
    square(stage, "/seen")
    one = instancer(stage, prototype="/seen", count=2)
    one.GetPositionsAttr().Set([(5, 0, 0), (9, 0, 0)])
    [mesh] = read(stage, instanced=True).meshes
    assert sorted(mesh.placements.transforms[:, 0, 3]) == pytest.approx([0, 5, 9])


def test_the_meshes_of_a_prototype_stand_together(tmp_path):
    stage = new_stage(tmp_path)
    made = copies(stage, 3)
    UsdGeom.XformCommonAPI(square(stage, "/Protos/one/other")).SetTranslate((0.1, 7, 0.3))
    stage.GetPrimAtPath("/Protos").SetSpecifier(Sdf.SpecifierOver)
    UsdGeom.XformCommonAPI(made[1]).SetRotate((10, 20, 30))
    one, other = read(stage, instanced=True).meshes
    assert one.placements.transforms is other.placements.transforms


def test_a_frame_holds_the_instances_that_it_names(tmp_path):
    stage = new_stage(tmp_path)
    copies(stage)
    scene = read(stage, instanced=True)
    for frame in ("/row/copy1", "copy1"):
        [mesh] = framed_meshes(scene, frame)
        assert mesh.placements.transforms[0, :, 3] == pytest.approx([3, 0, 0])
        assert mesh.times == 1
    assert framed_meshes(scene, "row")[0].times == 3


def test_all_instances_are_as_fine_as_the_nearest_needs(tmp_path):
    stage = new_stage(tmp_path)
    points, faces, *_ = CAGES["a cube"]
    cage(stage, points, faces, path="/Protos/one/cube")
    copies(stage, 40)
    UsdGeom.Imageable(stage.GetPrimAtPath("/Protos/one/square")).MakeInvisible()
    camera = UsdGeom.Camera.Define(stage, "/camera")
    found = []
    for x in (5000.0, 117.0):
        UsdGeom.XformCommonAPI(camera).SetTranslate((x, 0, 6))
        placed, copied = (
            read(stage, instanced=instanced, complexity="auto", width=500).meshes
            for instanced in (True, False)
        )
        found.append(len(placed[0].triangles))
        assert len(placed) == 1
        assert found[-1] == max(len(mesh.triangles) for mesh in copied)
    assert found[0] < found[1]
    assert len(copied[0].triangles) < found[1]


def test_a_million_instances_are_read_in_place(tmp_path):
    count = 1_000_000
    stage = Usd.Stage.CreateNew(str(tmp_path / "many.usdc"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    places = np.zeros((count, 3), np.float32)
    places[:, 0] = np.arange(count)
    instancer(stage, count=count).GetPositionsAttr().Set(Vt.Vec3fArray.FromNumpy(places))
    [mesh] = read(stage, instanced=True).meshes
    assert mesh.times == count
    assert (mesh.placements.transforms[:, 0, 3] == np.arange(count)).all()


def test_instances_above_the_bound_are_left_out(tmp_path, monkeypatch):
    stage = new_stage(tmp_path)
    nested(stage)
    scene = read(stage, instanced=True)
    assert any("leads to 1.01e+12 instances; at most 1e+07" in note for note in scene.notes)
    assert not scene.meshes
    monkeypatch.setattr(usd_instances, "MOST_COPIES", 2)
    (tmp_path / "native").mkdir()
    stage = new_stage(tmp_path / "native")
    copies(stage)
    scene = read(stage, instanced=True)
    assert any("leads to 3 native instances; at most 2" in note for note in scene.notes)
    assert scene.meshes[0].times == 2


def test_bounds_are_those_of_all_points(tmp_path):
    rng = np.random.default_rng(2)
    points, transforms = rng.normal(size=(50, 3)), rng.normal(size=(400, 3, 4))
    every = np.einsum("kij,nj->kni", transforms[:, :, :3], points) + transforms[:, None, :, 3]
    low, high = bounds_of(points, transforms)
    assert low == pytest.approx(every.min(axis=(0, 1)), rel=1e-12)
    assert high == pytest.approx(every.max(axis=(0, 1)), rel=1e-12)
