"""Scenes with something wrong: one clear line, and the rest is rendered."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import Sdf, UsdGeom, UsdShade

from fabricusd.errors import FabricError
from fabricusd.reference.rays.triangles import build_tables
from fabricusd.reference.render import render_scene
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import FabricSurface
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
    prim.ApplyAPI("WovenBindingAPI")
    prim.GetRelationship("fabric:binding").SetTargets(["/nowhere"])


def fabric_without_target(stage):
    square(stage, "/bad").GetPrim().ApplyAPI("WovenBindingAPI")


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


def infinite_transform(stage):
    mesh = square(stage, "/bad")
    mesh.CreateNormalsAttr([(0, 1, 0)] * 4)
    UsdGeom.XformCommonAPI(mesh).SetTranslate((math.inf, 0, 0))


def far_point(stage):
    square(stage, "/bad").GetPointsAttr().Set([(1e30, 0, 0), *SQUARE[1:]])


def two_corners(stage):
    mesh = square(stage, "/bad", uv=False)
    mesh.GetFaceVertexCountsAttr().Set([2, 3])
    mesh.GetFaceVertexIndicesAttr().Set([0, 1, 0, 3, 2])


def lost_in_the_distance(stage):
    UsdGeom.XformCommonAPI(square(stage, "/bad")).SetTranslate((1e7, 0, 0))


def uv_of(values, kind=Sdf.ValueTypeNames.TexCoord2fArray):
    def make(stage):
        mesh = square(stage, "/bad", uv=False)
        UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", kind, "faceVarying").Set(values)
        bind_fabric(stage, mesh.GetPrim())

    return make


def normals_too_few(stage):
    square(stage, "/bad").CreateNormalsAttr([(0, 1, 0)] * 2)


def overlapping_subsets(stage):
    mesh = square(stage, "/bad")
    material = UsdShade.Material.Define(stage, "/m")
    shader = UsdShade.Shader.Define(stage, "/m/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    for name, faces in (("a", [0, 7]), ("b", [0])):
        subset = UsdGeom.Subset.CreateGeomSubset(mesh, name, UsdGeom.Tokens.face, faces)
        UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(material)


def no_unit(stage):
    UsdGeom.SetStageMetersPerUnit(stage, 0.0)


def no_unit_authored(stage):
    stage.ClearMetadata("metersPerUnit")


def fabric_on_a_camera(stage):
    bind_fabric(stage, UsdGeom.Camera.Define(stage, "/bad").GetPrim())


def fabric_without_its_api(stage):
    prim = square(stage, "/bad").GetPrim()
    prim.CreateRelationship("fabric:binding").SetTargets(["/Looks/Cloth"])


def binding_without_its_api(stage):
    prim = square(stage, "/bad").GetPrim()
    UsdShade.Material.Define(stage, "/m")
    prim.CreateRelationship("material:binding").SetTargets(["/m"])


def abstract_prototype(stage):
    stage.CreateClassPrim("/_proto")
    square(stage, "/_proto/square")
    instancer = UsdGeom.PointInstancer.Define(stage, "/bad")
    instancer.CreatePrototypesRel().SetTargets(["/_proto/square"])
    instancer.CreatePositionsAttr([(0, 0, 0)])
    instancer.CreateProtoIndicesAttr([0])


def instancer_arrays(stage):
    abstract_prototype(stage)
    UsdGeom.PointInstancer(stage.GetPrimAtPath("/bad")).GetProtoIndicesAttr().Set([0, 0])


def instance_nowhere(stage):
    square(stage, "/bad/square")
    instancer = UsdGeom.PointInstancer.Define(stage, "/bad")
    instancer.CreatePrototypesRel().SetTargets(["/bad/square"])
    instancer.CreatePositionsAttr([(0, 0, 0), (math.nan, 0, 0)])
    instancer.CreateProtoIndicesAttr([0, 0])


def camera(**values):
    def make(stage):
        prim = UsdGeom.Camera.Define(stage, "/bad").GetPrim()
        for name, value in values.items():
            prim.GetAttribute(name).Set(value)

    return make


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
    "a transform that is not finite": (infinite_transform, "/bad has a transform that is not fin"),
    "a point beyond 32-bit numbers": (far_point, "/bad has 1 points beyond 1e+09 m"),
    "a face of two corners": (two_corners, "/bad has 1 faces with fewer than three corners"),
    "a mesh lost in its scene": (lost_in_the_distance, "/bad is 2.83 m wide in a scene of 1e+07"),
    "UVs that are not finite": (
        uv_of([(0, 0), (1, 0), (math.nan, 1), (0, 1)]), "/bad has UVs that are not finite",
    ),
    "too few UVs": (uv_of([(0, 0)]), "/bad has a UV set 'st' that does not fit its faces"),
    "UVs of text": (
        uv_of(["a"] * 4, Sdf.ValueTypeNames.StringArray), "/bad has a UV set 'st' that does not",
    ),
    "too few normals": (normals_too_few, "/bad has normals that do not fit its faces"),
    "a subset of lost faces": (overlapping_subsets, "/bad/a names 1 faces that do not exist"),
    "subsets that overlap": (overlapping_subsets, "/bad/b takes 1 faces from another subset"),
    "no unit of length": (no_unit, "scene.usda has metersPerUnit 0; 0.01 is taken"),
    "no unit at all": (no_unit_authored, "scene.usda has no metersPerUnit; USD's 0.01 is taken"),
    "a fabric bound to a camera": (fabric_on_a_camera, "/bad binds a fabric, left out"),
    "a fabric bound without its API": (fabric_without_its_api, "/bad has fabric:binding but not"),
    "a material bound without its API": (binding_without_its_api, "MaterialBindingAPI is not"),
    "a prototype that is a class": (abstract_prototype, "/bad names prototype 0"),
    "an instancer's arrays that differ": (instancer_arrays, "/bad has arrays of different lengths"),
    "an instance that is nowhere": (instance_nowhere, "/bad has instances whose place is not fin"),
    "a camera without focal length": (camera(focalLength=0.0), "/bad has focalLength 0"),
    "a camera without film": (camera(horizontalAperture=0.0), "/bad has horizontalAperture 0"),
    "a camera that is no number": (camera(focalLength=math.nan), "/bad has focalLength nan"),
    "a camera clipped to nothing": (camera(clippingRange=(5, 1)), "/bad has clippingRange 5 to 1"),
    "an aperture without focus": (camera(fStop=2.0), "/bad has f-stop 2 and no focus distance"),
    "clipping planes": (camera(clippingPlanes=[(0, 0, 1, 0)]), "/bad has clipping planes"),
}  # fmt: skip


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


@pytest.mark.parametrize("fault", [nan_points, far_point])
def test_a_view_of_its_own_sees_what_is_sound(tmp_path, fault):
    stage = new_stage(tmp_path)
    square(stage, "/good")
    sound = render_scene(read(stage), width=16, height=16, spp=4)
    fault(stage)
    broken = render_scene(read(stage), width=16, height=16, spp=4)
    seen = sound.layers["beauty"][..., 3]
    assert seen.max() == 1
    assert np.abs(broken.layers["beauty"][..., 3] - seen).max() < 0.3


def test_usd_itself_writes_nothing_to_standard_error(tmp_path, capfd):
    stage = new_stage(tmp_path)
    instancer_arrays(stage)
    missing_reference(stage)
    binding_without_its_api(stage)
    capfd.readouterr()
    read(stage)
    assert capfd.readouterr().err == ""


def test_a_camera_that_is_not_there_is_an_error_that_names_those_that_are(tmp_path):
    stage = new_stage(tmp_path)
    UsdGeom.Camera.Define(stage, "/front")
    with pytest.raises(FabricError, match=r"/side is not a camera; cameras are: /front"):
        read(stage, camera="/side")
    with pytest.raises(FabricError, match=r":frnt is not a camera \(did you mean 'front'\?\)"):
        read(stage, camera="frnt")


def test_a_camera_is_found_by_its_name_where_no_other_has_it(tmp_path):
    stage = new_stage(tmp_path)
    for path in ("/one/close", "/two/close", "/two/wide"):
        UsdGeom.Camera.Define(stage, path)
    assert read(stage, camera="wide").camera.path == "/two/wide"
    with pytest.raises(FabricError, match="is the name of 2 cameras; give a path: /one/close, /t"):
        read(stage, camera="close")


FILES = {
    "missing": (None, "cannot be read"),
    "empty": (b"", "is empty"),
    "not USD": (b"hello", "cannot be read as USD"),
    "a word too many": (b'#usda 1.0\ndef Mesh "m" { int a = 1 b }\n', r"^[^ ]*x.usda .*:2:"),
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
    with pytest.raises(FabricError, match=r"is not a scene file"):
        read_scene(tmp_path / "x.jpg")


def test_an_obj_is_rendered_with_the_fabric_given(tmp_path):
    path = tmp_path / "x.obj"
    path.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
    )
    scene = read_scene(path, fabric="linen_plain")
    assert isinstance(scene.materials[scene.meshes[0].material[0]], FabricSurface)
    assert scene.meshes[0].uv.shape == (2, 3, 2)
