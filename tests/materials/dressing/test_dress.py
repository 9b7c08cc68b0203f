"""Dressing: what the scene holds, and that the path tracer's reader finds the fabric worn."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.materials.dressing import dress
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import FabricSurface
from fabricusd.schema import check, save

OBJ = """v 0 0 0
v 60 0 0
v 60 80 0
v 0 80 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
f 1/1 2/2 3/3 4/4
"""
BARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    (tmp_path / "panel.obj").write_text(OBJ)
    return tmp_path / "panel.obj"


def worn(scene_file: Path) -> list[FabricSurface]:
    """The fabrics that the triangles of a scene wear."""
    scene = read_scene(scene_file)
    used = {int(k) for mesh in scene.meshes for k in mesh.material}
    return [m for k, m in enumerate(scene.materials) if k in used and isinstance(m, FabricSurface)]


def test_a_mesh_wears_the_fabric_with_its_grain_and_scale(panel: Path) -> None:
    out = panel.with_name("scene.usda")
    made = dress([panel], out, fabric="linen_plain", units="cm", grain=math.radians(45), scale=0.6)
    assert [path.name for path in made.files] == ["scene.usda", "scene_geometry.usdc"]
    assert "0.6 m wide and 0.8 m high" in made.meshes[0]
    (surface,) = worn(out)
    assert surface.binding.fabric.name == "linen_plain"
    assert math.degrees(surface.binding.rotation) == pytest.approx(45)
    assert surface.binding.metres_per_uv == pytest.approx(0.6)
    assert check(str(out)) == []


def test_the_scene_is_lit_and_its_camera_sees_the_garment(panel: Path) -> None:
    out = panel.with_name("scene.usda")
    dress([panel], out, fabric="linen_plain", units="cm")
    scene = read_scene(out)
    assert len(scene.lights) == 3
    camera = scene.camera
    garment = next(mesh for mesh in scene.meshes if "Garments" in mesh.path)
    local = (garment.points - camera.frame[:3, 3]) @ camera.frame[:3, :3]
    assert np.all(local[:, 2] < -camera.clipping[0])
    film = np.abs(local[:, :2] / local[:, 2:] * camera.focal_length)
    assert np.all(film <= np.array(camera.aperture) / 2)


def test_every_prim_of_the_scene_has_a_type(panel: Path) -> None:
    # Blender takes what lies below a prim without one off its parent, and leaves it y up.
    out = panel.with_name("scene.usda")
    dress([panel], out, fabric="linen_plain", units="cm")
    stage = Usd.Stage.Open(str(out))
    assert [prim.GetPath() for prim in stage.Traverse() if not prim.GetTypeName()] == []


def test_a_fabric_in_a_layer_is_referenced_and_a_preset_is_written(panel: Path) -> None:
    save(Fabric(name="Cloth"), panel.with_name("cloth.usda"))
    dress([panel], panel.with_name("a.usda"), fabric=str(panel.with_name("cloth.usda")), units="cm")
    dress([panel], panel.with_name("b.usda"), fabric="linen_plain", units="cm")
    assert "@./cloth.usda@</Cloth>" in panel.with_name("a.usda").read_text()
    assert "presets" not in panel.with_name("b.usda").read_text()
    assert worn(panel.with_name("a.usda"))[0].binding.fabric.name == "Cloth"


def test_a_usd_garment_is_referenced_in_metres_and_upright(panel: Path) -> None:
    stage = Usd.Stage.CreateNew(str(panel.with_name("coat.usda")))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/Coat").GetPrim())
    mesh = UsdGeom.Mesh.Define(stage, "/Coat/Front")
    mesh.CreatePointsAttr([(0, 0, 0), (60, 0, 0), (60, 0, 80), (0, 0, 80)])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    mesh.CreateSubdivisionSchemeAttr("none")
    UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    ).Set([(0, 0), (1, 0), (1, 1), (0, 1)])
    red = UsdShade.Material.Define(stage, "/Coat/Red")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(red)
    stage.GetRootLayer().Save()
    out = panel.with_name("scene.usda")
    made = dress([panel.with_name("coat.usda")], out, fabric="linen_plain")
    assert made.files == (out,)
    scene = read_scene(out)
    garment = next(each for each in scene.meshes if each.path.endswith("Front"))
    assert garment.points.max(axis=0) == pytest.approx([0.6, 0.8, 0.0], abs=1e-6)
    assert worn(out)[0].binding.fabric.name == "linen_plain"


def test_two_garments_of_one_name_are_kept_apart(panel: Path, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "panel.obj").write_text(OBJ)
    out = panel.with_name("scene.usda")
    made = dress([panel, tmp_path / "other" / "panel.obj"], out, fabric="linen_plain", units="cm")
    assert len(made.meshes) == 2
    assert len([m for m in read_scene(out).meshes if "Garments" in m.path]) == 2


@pytest.mark.parametrize(
    ("name", "text", "fabric", "output", "said"),
    [
        ("bare.obj", BARE, "linen_plain", "out.usda", "has no mesh that can wear a fabric"),
        ("bad.obj", "f 1 2 3\n", "linen_plain", "out.usda", "bad.obj"),
        ("a.obj", OBJ, "no_such", "out.usda", "neither a file nor a preset"),
        ("a.obj", OBJ, "linen_plain", "out.fbx", "must end in one of .usda"),
        ("a.obj", OBJ, "linen_plain", "no/out.usda", "which is not a directory"),
        ("a.stl", OBJ, "linen_plain", "out.usda", "is not a scene file"),
    ],
)
def test_what_cannot_be_dressed_is_refused_and_nothing_is_written(
    tmp_path: Path, name: str, text: str, fabric: str, output: str, said: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(FabricError, match=said):
        dress([tmp_path / name], tmp_path / output, fabric=fabric)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_dry_run_writes_nothing(panel: Path) -> None:
    made = dress([panel], panel.with_name("s.usda"), fabric="linen_plain", units="cm", write=False)
    assert len(made.files) == 2
    assert [path.name for path in panel.parent.iterdir()] == ["panel.obj"]
