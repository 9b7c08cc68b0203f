"""Scenes with something wrong: one clear line, and the rest is rendered."""

from __future__ import annotations

import math

import pytest
from pxr import Sdf, UsdGeom, UsdShade

from fabricusd.errors import FabricError
from fabricusd.reference.read import read_scene
from fabricusd.reference.scene import FabricSurface
from fabricusd.reference.triangles import build_tables
from tests.reference.stages import SQUARE, bind_fabric, new_stage, read, square


def nan_points(stage):
    square(stage, "/bad").GetPointsAttr().Set([(math.nan, 0, 0), *SQUARE[1:]])


def degenerate(stage):
    square(stage, "/bad").GetPointsAttr().Set([(0, 0, 0)] * 4)


def no_uv(stage):
    bind_fabric(stage, square(stage, "/bad", uv=False).GetPrim())


def bad_indices(stage):
    square(stage, "/bad").GetFaceVertexIndicesAttr().Set([0, 3, 2, 9])


def wrong_counts(stage):
    square(stage, "/bad").GetFaceVertexCountsAttr().Set([7])


def subdivision(stage):
    square(stage, "/bad").CreateSubdivisionSchemeAttr("catmullClark")


def fabric_to_nowhere(stage):
    prim = square(stage, "/bad").GetPrim()
    prim.ApplyAPI("FabricBindingAPI")
    prim.GetRelationship("fabric:binding").SetTargets(["/nowhere"])


def fabric_without_target(stage):
    square(stage, "/bad").GetPrim().ApplyAPI("FabricBindingAPI")


def unknown_light(stage):
    stage.DefinePrim("/bad", "LavaLampLight")


def missing_texture(stage):
    mesh = square(stage, "/bad")
    material = UsdShade.Material.Define(stage, "/m")
    shader = UsdShade.Shader.Define(stage, "/m/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    texture = UsdShade.Shader.Define(stage, "/m/t")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("./lost.png")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(
        texture.ConnectableAPI(), "rgb"
    )
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def other_material(stage):
    mesh = square(stage, "/bad")
    material = UsdShade.Material.Define(stage, "/m")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def cyclic_instancer(stage):
    instancer = UsdGeom.PointInstancer.Define(stage, "/bad")
    instancer.CreatePrototypesRel().SetTargets(["/bad/group"])
    UsdGeom.Xform.Define(stage, "/bad/group")
    inner = UsdGeom.PointInstancer.Define(stage, "/bad/group/inner")
    inner.CreatePrototypesRel().SetTargets(["/bad/group"])
    for one in (instancer, inner):
        one.CreatePositionsAttr([(0, 0, 0)])
        one.CreateProtoIndicesAttr([0])


def cyclic_reference(stage):
    UsdGeom.Xform.Define(stage, "/bad").GetPrim().GetReferences().AddInternalReference("/bad")


def solid(stage):
    UsdGeom.Cube.Define(stage, "/bad")


def missing_reference(stage):
    UsdGeom.Xform.Define(stage, "/bad").GetPrim().GetReferences().AddReference("./lost.usda")


FAULTS = {
    "points that are not finite": (nan_points, "/bad has 1 points that are not finite"),
    "triangles without area": (degenerate, "/bad has 2 triangles without area"),
    "a fabric without UVs": (no_uv, "/bad fabric:binding:uvSet is 'st'"),
    "an index beyond the points": (bad_indices, "/bad names point 9 of 4"),
    "counts that do not add up": (wrong_counts, "/bad has 4 face vertex indices for 7"),
    "a subdivision surface": (subdivision, "/bad is a subdivision surface (catmullClark)"),
    "a fabric that is nowhere": (fabric_to_nowhere, "/nowhere"),
    "a binding without a fabric": (fabric_without_target, "/bad"),
    "an unknown light": (unknown_light, "/bad is a light of the unknown type 'LavaLampLight'"),
    "a missing texture": (missing_texture, "/m is rendered without a texture"),
    "a material of another kind": (other_material, "/m has no UsdPreviewSurface"),
    "an instancer inside itself": (cyclic_instancer, "instances itself"),
    "a reference to itself": (cyclic_reference, "/bad"),
    "a solid": (solid, "/bad is a Cube, left out"),
    "a reference to a file that is not there": (missing_reference, "lost.usda"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_one_line_and_the_rest_is_rendered(tmp_path, name):
    make, words = FAULTS[name]
    stage = new_stage(tmp_path)
    square(stage, "/good")
    make(stage)
    scene = read(stage)
    build_tables(scene)
    matching = [n for n in scene.notes if words in n]
    assert len(matching) == 1, scene.notes
    assert "\n" not in matching[0]
    assert any(m.path == "/good" for m in scene.meshes)


def test_a_camera_that_is_not_there_is_an_error_that_names_those_that_are(tmp_path):
    stage = new_stage(tmp_path)
    UsdGeom.Camera.Define(stage, "/front")
    with pytest.raises(FabricError, match=r"/side is no camera; the scene's are: /front"):
        read(stage, camera="/side")


FILES = {
    "missing": (None, "cannot be read"),
    "empty": (b"", "is empty"),
    "not USD": (b"hello", "cannot be read as USD"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_no_scene_is_an_error(tmp_path, name):
    content, words = FILES[name]
    path = tmp_path / "x.usda"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FabricError, match=words):
        read_scene(path)


def test_a_suffix_that_is_no_scene_is_an_error(tmp_path):
    with pytest.raises(FabricError, match=r"is no scene"):
        read_scene(tmp_path / "x.jpg")


def test_an_obj_is_rendered_with_the_fabric_given(tmp_path):
    path = tmp_path / "x.obj"
    path.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
    )
    scene = read_scene(path, fabric="linen_plain")
    assert isinstance(scene.materials[scene.meshes[0].material[0]], FabricSurface)
    assert scene.meshes[0].uv.shape == (2, 3, 2)
