"""Subsets of a mesh that wear fabrics, where fabrics lie, and what is said of both sides."""

from __future__ import annotations

import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade

from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import FabricSurface
from fabricusd.schema.source import PRESETS
from tests.conftest import CHECKOUT
from tests.reference.stages import bind_fabric, new_stage, read, square

CASES = CHECKOUT / "tests" / "cases"


def worn(scene) -> list[str]:
    """The names of what the triangles of the only mesh wear."""
    [mesh] = scene.meshes
    return [scene.materials[k].name for k in mesh.material]


def test_a_subset_that_wears_a_fabric_is_not_said_to_wear_none():
    scene = read_scene(CASES / "usd_subset_false_note" / "subset.usda")
    assert worn(scene) == ["F", "F", "G", "G"]
    assert scene.notes == []


def two_triangles(stage: Usd.Stage) -> UsdGeom.Mesh:
    mesh = square(stage)
    mesh.GetFaceVertexCountsAttr().Set([3, 3])
    mesh.GetFaceVertexIndicesAttr().Set([0, 3, 2, 0, 2, 1])
    UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Set([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)])
    bind_fabric(stage, mesh.GetPrim())
    return mesh


def dressed(stage: Usd.Stage, mesh: UsdGeom.Mesh, name: str = "part", **kind) -> UsdGeom.Subset:
    """A subset of the second triangle in velvet."""
    fabric = stage.DefinePrim("/Looks/Other")
    fabric.GetReferences().AddReference(str(PRESETS / "velvet.usda"))
    subset = UsdGeom.Subset.Define(stage, mesh.GetPath().AppendChild(name))
    subset.CreateElementTypeAttr(kind.get("element", "face"))
    subset.CreateFamilyNameAttr(kind.get("family", "materialBind"))
    subset.CreateIndicesAttr([1])
    subset.GetPrim().ApplyAPI("WovenBindingAPI")
    subset.GetPrim().GetRelationship("fabric:binding").SetTargets([fabric.GetPath()])
    return subset


@pytest.mark.parametrize("family", ["materialBind", "panels", ""])
def test_a_fabric_is_worn_by_subsets_of_every_family(tmp_path, family):
    stage = new_stage(tmp_path)
    dressed(stage, two_triangles(stage), family=family)
    scene = read(stage)
    assert worn(scene) == ["Cloth", "Other"]
    assert scene.notes == []


def test_faces_of_a_subset_are_those_of_the_time_asked_for(tmp_path):
    stage = new_stage(tmp_path)
    indices = dressed(stage, two_triangles(stage)).GetIndicesAttr()
    indices.Clear()
    for time, faces in ((1, [0]), (2, []), (3, [0, 1])):
        indices.Set(faces, time)
    expected = {
        None: ["Other", "Cloth"], 1.0: ["Other", "Cloth"], 2.0: ["Cloth", "Cloth"],
        3.0: ["Other", "Other"],
    }  # fmt: skip
    assert {time: worn(read(stage, time_code=time)) for time in expected} == expected


def test_a_subset_of_an_instance_is_not_said_to_wear_none(tmp_path):
    stage = new_stage(tmp_path)
    dressed(stage, two_triangles(stage))
    for name in ("/one", "/two"):
        copy = stage.DefinePrim(name)
        copy.GetReferences().AddInternalReference("/group")
        copy.SetInstanceable(True)
    stage.DefinePrim("/group/square").GetReferences().AddInternalReference("/square")
    scene = read(stage)
    assert len(scene.meshes) == 4
    assert scene.notes == []


@pytest.mark.parametrize("element", ["point", "edge", "tetrahedron"])
def test_a_subset_of_anything_but_faces_wears_nothing_and_is_noted(tmp_path, element):
    stage = new_stage(tmp_path)
    dressed(stage, two_triangles(stage), element=element)
    scene = read(stage)
    assert worn(scene) == ["Cloth", "Cloth"]
    [note] = scene.notes
    assert note == (
        f"/square/part is a subset of the type '{element}', left out: only faces wear a fabric"
    )


def test_a_subset_of_no_mesh_is_noted(tmp_path):
    stage = new_stage(tmp_path)
    square(stage)
    group = UsdGeom.Xform.Define(stage, "/group")
    dressed(stage, group)
    assert "/group/part binds a fabric, left out" in " ".join(read(stage).notes)


def test_a_fabric_on_what_is_no_mesh_is_noted(tmp_path):
    stage = new_stage(tmp_path)
    square(stage)
    bind_fabric(stage, UsdGeom.Camera.Define(stage, "/group").GetPrim())
    assert "/group binds a fabric, left out" in " ".join(read(stage).notes)


def test_a_fabric_below_an_over_is_worn_with_a_note():
    scene = read_scene(CASES / "looked_at" / "fabric_under_over.usda")
    assert isinstance(scene.materials[scene.meshes[0].material[0]], FabricSurface)
    [note] = scene.notes
    assert note.startswith("/World/C wears /World/Looks/linen_plain, which lies below /World/Looks")
    assert "'over' that no layer defines" in note


def test_a_fabric_that_is_itself_an_over_or_below_a_class_is_told_apart(tmp_path):
    stage = new_stage(tmp_path)
    mesh = square(stage)
    bind_fabric(stage, mesh.GetPrim())
    stage.GetPrimAtPath("/Looks").SetSpecifier(Sdf.SpecifierClass)
    assert read(stage).notes == []
    stage.GetPrimAtPath("/Looks").SetSpecifier(Sdf.SpecifierOver)
    assert "lies below /Looks, an 'over'" in " ".join(read(stage).notes)


def test_meshes_with_one_side_are_said_to_have_two_in_one_line(tmp_path):
    stage = new_stage(tmp_path)
    for k, sides in enumerate((False, True, None, False, False)):
        mesh = square(stage, f"/square{k}")
        if sides is not None:
            mesh.CreateDoubleSidedAttr(sides)
    assert read(stage).notes == [
        "/square0 and 2 more have doubleSided = false; both sides are rendered"
    ]


def test_one_mesh_with_one_side_is_named(tmp_path):
    stage = new_stage(tmp_path)
    square(stage).CreateDoubleSidedAttr(False)
    assert read(stage).notes == ["/square has doubleSided = false; both sides are rendered"]


def test_a_preview_material_on_a_subset_of_points_is_left_alone(tmp_path):
    stage = new_stage(tmp_path)
    mesh = two_triangles(stage)
    material = UsdShade.Material.Define(stage, "/red")
    subset = UsdGeom.Subset.CreateGeomSubset(mesh, "part", UsdGeom.Tokens.point, [1])
    UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(material)
    scene = read(stage)
    assert worn(scene) == ["Cloth", "Cloth"]
    assert len(scene.materials) == 1
