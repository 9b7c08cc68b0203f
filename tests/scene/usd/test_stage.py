"""What a USD stage says, as the path tracer understands it."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from fabricusd.images.files import write_exr, write_png
from fabricusd.reference.rays.triangles import build_tables
from fabricusd.scene.scene import FabricSurface, PreviewSurface
from tests.reference.stages import area, bind_fabric, new_stage, read, square, up_share


def test_lengths_become_metres(tmp_path):
    stage = new_stage(tmp_path, metres=0.01)
    square(stage)
    assert area(read(stage)) == pytest.approx(4e-4)


ORIENTATIONS = {
    # name: (orientation, scale of x, sign of the normal's y)
    "right-handed": ("rightHanded", 1, 1),
    "left-handed": ("leftHanded", 1, -1),
    "mirrored": ("rightHanded", -1, 1),
    "left-handed and mirrored": ("leftHanded", -1, -1),
}


@pytest.mark.parametrize("name", ORIENTATIONS)
def test_the_front_is_where_the_orientation_says_it_is(tmp_path, name):
    orientation, scale, sign = ORIENTATIONS[name]
    stage = new_stage(tmp_path)
    mesh = square(stage)
    mesh.CreateOrientationAttr(orientation)
    UsdGeom.XformCommonAPI(mesh).SetScale((scale, 1, 1))
    assert up_share(read(stage)) == pytest.approx(sign)


def test_a_polygon_with_a_reflex_corner_keeps_its_area(tmp_path):
    stage = new_stage(tmp_path)
    mesh = square(stage, uv=False)
    arrow = [(0, 0, 0), (2, 0, 2), (0, 0, -2), (-2, 0, 2), (-0.5, 0, 0.6)]
    mesh.GetPointsAttr().Set(arrow)
    mesh.GetFaceVertexCountsAttr().Set([5])
    mesh.GetFaceVertexIndicesAttr().Set([0, 1, 2, 3, 4])
    x, z = np.array(arrow)[:, 0], np.array(arrow)[:, 2]
    expected = 0.5 * abs(np.dot(x, np.roll(z, -1)) - np.dot(z, np.roll(x, -1)))
    assert area(read(stage)) == pytest.approx(expected)


def test_what_is_invisible_or_a_guide_is_not_rendered(tmp_path):
    stage = new_stage(tmp_path)
    square(stage, "/seen")
    square(stage, "/hidden").CreateVisibilityAttr("invisible")
    square(stage, "/guide").CreatePurposeAttr("guide")
    square(stage, "/proxy").CreatePurposeAttr("proxy")
    square(stage, "/final").CreatePurposeAttr("render")
    assert {m.path for m in read(stage).meshes} == {"/seen", "/final"}


def test_native_instances_are_each_in_their_place(tmp_path):
    stage = new_stage(tmp_path)
    square(stage, "/Prototype/square")
    for k in range(3):
        prim = UsdGeom.Xform.Define(stage, f"/copy{k}")
        prim.AddTranslateOp().Set((10 * (k + 1), 0, 0))
        prim.GetPrim().GetReferences().AddInternalReference("/Prototype")
        prim.GetPrim().SetInstanceable(True)
    centres = sorted(m.points[:, 0].mean() for m in read(stage).meshes)
    assert centres == pytest.approx([0, 10, 20, 30])


def test_a_point_instancer_places_its_prototypes_and_obeys_its_mask(tmp_path):
    stage = new_stage(tmp_path)
    instancer = UsdGeom.PointInstancer.Define(stage, "/many")
    square(stage, "/many/protos/a")
    UsdGeom.XformCommonAPI(stage.GetPrimAtPath("/many/protos/a")).SetScale((0.5, 0.5, 0.5))
    instancer.CreatePrototypesRel().SetTargets(["/many/protos/a"])
    instancer.CreatePositionsAttr([(0, 0, 0), (5, 0, 0), (9, 0, 0)])
    instancer.CreateProtoIndicesAttr([0, 0, 0])
    instancer.InvisId(1, Usd.TimeCode.Default())
    scene = read(stage)
    assert sorted(m.points[:, 0].mean() for m in scene.meshes) == pytest.approx([0, 9])
    assert area(scene) == pytest.approx(2.0)


def test_subsets_have_materials_of_their_own(tmp_path):
    stage = new_stage(tmp_path)
    mesh = square(stage)
    mesh.GetFaceVertexCountsAttr().Set([3, 3])
    mesh.GetFaceVertexIndicesAttr().Set([0, 3, 2, 0, 2, 1])
    UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Set([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)])
    red = UsdShade.Material.Define(stage, "/red")
    shader = UsdShade.Shader.Define(stage, "/red/shader")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set((1, 0, 0))
    red.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    subset = UsdGeom.Subset.CreateGeomSubset(mesh, "part", UsdGeom.Tokens.face, [1])
    UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(red)
    bind_fabric(stage, mesh.GetPrim())
    scene = read(stage)
    kinds = [scene.materials[k] for k in scene.meshes[0].material]
    assert isinstance(kinds[0], FabricSurface)
    assert isinstance(kinds[1], PreviewSurface)
    assert kinds[1].diffuse == (1, 0, 0)


INTERPOLATIONS = {
    "vertex": [(0, 0), (0, 1), (1, 1), (1, 0)],
    "varying": [(0, 0), (0, 1), (1, 1), (1, 0)],
    "faceVarying": [(0, 0), (1, 0), (1, 1), (0, 1)],
}


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
@pytest.mark.parametrize("indexed", [False, True])
def test_every_interpolation_of_uvs_gives_the_same_corners(tmp_path, interpolation, indexed):
    stage = new_stage(tmp_path)
    mesh = square(stage, uv=False)
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, interpolation
    )
    values = INTERPOLATIONS[interpolation]
    primvar.Set(values[::-1] if indexed else values)
    if indexed:
        primvar.SetIndices([3, 2, 1, 0])
    bind_fabric(stage, mesh.GetPrim())
    scene = read(stage)
    [mesh_] = scene.meshes
    for tri, uv in zip(mesh_.triangles, mesh_.uv, strict=True):
        for point, at in zip(mesh_.points[tri], uv, strict=True):
            assert at == pytest.approx([(point[2] + 1) / 2, (point[0] + 1) / 2])


def test_the_camera_and_its_lengths_are_in_metres(tmp_path):
    stage = new_stage(tmp_path, metres=0.01)
    square(stage)
    camera = UsdGeom.Camera.Define(stage, "/cam")
    camera.CreateFocalLengthAttr(50)
    camera.CreateHorizontalApertureAttr(36)
    camera.CreateFStopAttr(2.8)
    camera.CreateFocusDistanceAttr(300)
    UsdGeom.XformCommonAPI(camera).SetTranslate((0, 100, 0))
    c = read(stage).camera
    assert c.focal_length == pytest.approx(0.05)
    assert c.aperture[0] == pytest.approx(0.036)
    assert c.focus_distance == pytest.approx(3.0)
    assert c.f_stop == pytest.approx(2.8)
    assert c.frame[:3, 3] == pytest.approx([0, 1, 0])


def test_time_samples_are_read_at_the_time_asked_for(tmp_path):
    stage = new_stage(tmp_path)
    mesh = square(stage)
    op = UsdGeom.Xformable(mesh).AddTranslateOp()
    op.Set((0, 0, 0), 1)
    op.Set((10, 0, 0), 11)
    for code, x in ((None, 0.0), (6.0, 5.0), (11.0, 10.0)):
        scene = read(stage, time_code=code)
        assert scene.meshes[0].points[:, 0].mean() == pytest.approx(x)


def test_lights_follow_exposure_temperature_and_normalisation(tmp_path):
    stage = new_stage(tmp_path, metres=0.01)
    square(stage)
    rect = UsdLux.RectLight.Define(stage, "/rect")
    rect.CreateWidthAttr(200)
    rect.CreateHeightAttr(50)
    rect.CreateIntensityAttr(3)
    rect.CreateExposureAttr(2)
    rect.CreateNormalizeAttr(True)
    warm = UsdLux.SphereLight.Define(stage, "/warm")
    warm.CreateEnableColorTemperatureAttr(True)
    warm.CreateColorTemperatureAttr(3000)
    sun = UsdLux.DistantLight.Define(stage, "/sun")
    sun.CreateAngleAttr(2)
    sun.CreateIntensityAttr(1)
    sun.CreateNormalizeAttr(True)
    lights = {light.path: light for light in read(stage).lights}
    assert lights["/rect"].radiance[0] == pytest.approx(12 / 10000)
    assert lights["/rect"].width == pytest.approx(2.0)
    assert lights["/warm"].radiance[0] > 1.5 * lights["/warm"].radiance[2]
    irradiance = lights["/sun"].radiance[0] * math.pi * math.sin(math.radians(1)) ** 2
    assert irradiance == pytest.approx(1.0)


def test_a_dome_has_its_picture_and_a_missing_one_is_noted(tmp_path):
    picture = np.zeros((4, 8, 3), np.float32)
    picture[0] = (1, 2, 3)
    write_exr(tmp_path / "sky.exr", {"beauty": picture}, {"beauty": ("R", "G", "B")}, {})
    stage = new_stage(tmp_path)
    square(stage)
    UsdLux.DomeLight.Define(stage, "/sky").CreateTextureFileAttr(str(tmp_path / "sky.exr"))
    UsdLux.DomeLight.Define(stage, "/lost").CreateTextureFileAttr(str(tmp_path / "none.exr"))
    scene = read(stage)
    lights = {light.path: light for light in scene.lights}
    assert lights["/sky"].image[0, 0] == pytest.approx([1, 2, 3])
    assert lights["/lost"].image is None
    assert any("/lost is rendered as constant" in n and "none.exr" in n for n in scene.notes)


def test_textures_of_a_preview_surface_are_decoded_once(tmp_path):
    write_png(tmp_path / "grey.png", np.full((2, 2, 3), 188, np.uint8))
    stage = new_stage(tmp_path)
    mesh = square(stage)
    material = UsdShade.Material.Define(stage, "/m")
    shader = UsdShade.Shader.Define(stage, "/m/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    reader = UsdShade.Shader.Define(stage, "/m/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    for name, kind in (("diffuseColor", "rgb"), ("roughness", "g")):
        texture = UsdShade.Shader.Define(stage, f"/m/{name}")
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(str(tmp_path / "grey.png"))
        texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(
            reader.ConnectableAPI(), "result"
        )
        texture.CreateInput("wrapS", Sdf.ValueTypeNames.Token).Set("clamp")
        shader.CreateInput(name, Sdf.ValueTypeNames.Color3f).ConnectToSource(
            texture.ConnectableAPI(), kind
        )
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    scene = read(stage)
    surface = scene.materials[scene.meshes[0].material[0]]
    assert surface.textures["diffuse"].pixels[0, 0] == pytest.approx([0.503] * 3, abs=2e-3)
    assert surface.textures["roughness"].pixels.shape == (2, 2, 1)
    assert surface.textures["roughness"].pixels[0, 0, 0] == pytest.approx(188 / 255, abs=1e-4)
    assert surface.textures["diffuse"].wrap == ("clamp", "repeat")


def test_weave_coordinates_far_from_the_origin_keep_their_place_in_the_thread(tmp_path):
    stage = new_stage(tmp_path)
    mesh = square(stage)
    far = [(1e4 + u, 1e4 + v) for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))]
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    primvar.Set([Gf.Vec2f(*uv) for uv in far])
    bind_fabric(stage, mesh.GetPrim())
    mesh.GetPrim().GetAttribute("fabric:binding:threadsPerUnit").Set(Gf.Vec2d(777, 555))
    records = build_tables(read(stage)).records
    base = records[:, 27:29]
    repeat = 2.0
    expected = np.mod(np.float64(np.float32(1e4)) * np.array([777, 555]), repeat)
    assert (
        np.abs(base[0] - expected).max() < 1e-3
        or np.abs(np.abs(base[0] - expected) - repeat).max() < 1e-3
    )


def test_prototypes_below_an_over_and_below_a_flat_parent_are_placed(tmp_path):
    stage = new_stage(tmp_path)
    square(stage, "/hidden/a")
    stage.GetPrimAtPath("/hidden").SetSpecifier(Sdf.SpecifierOver)
    flat = UsdGeom.Xform.Define(stage, "/flat")
    UsdGeom.XformCommonAPI(flat).SetScale((0, 0, 0))
    square(stage, "/flat/b")
    instancer = UsdGeom.PointInstancer.Define(stage, "/many")
    instancer.CreatePrototypesRel().SetTargets(["/hidden/a", "/flat/b"])
    instancer.CreatePositionsAttr([(5, 0, 0), (9, 0, 0)])
    instancer.CreateProtoIndicesAttr([0, 1])
    placed = [m for m in read(stage).meshes if np.ptp(m.points) > 0]
    assert sorted(m.points[:, 0].mean() for m in placed) == pytest.approx([5, 9])


def test_a_transform_that_is_reset_ignores_its_parents(tmp_path):
    stage = new_stage(tmp_path)
    UsdGeom.XformCommonAPI(UsdGeom.Xform.Define(stage, "/group")).SetTranslate((0, 9, 0))
    mesh = square(stage, "/group/square")
    UsdGeom.XformCommonAPI(mesh).SetTranslate((0, 0, 3))
    mesh.SetResetXformStack(True)
    assert read(stage).meshes[0].points.mean(axis=0) == pytest.approx([0, 0, 3])


def test_the_same_file_is_read_as_it_is_now(tmp_path):
    from fabricusd.scene.read import read_scene

    stage = new_stage(tmp_path)
    square(stage)
    path = stage.GetRootLayer().realPath
    assert len(read(stage).meshes) == 1
    text = stage.GetRootLayer().ExportToString()
    (tmp_path / "scene.usda").write_text(text + text[text.index("def") :].replace("square", "two"))
    assert len(read_scene(path).meshes) == 2


def test_a_purpose_of_its_own_goes_before_that_of_a_parent(tmp_path):
    stage = new_stage(tmp_path)
    for name in ("/proxy/square", "/proxy/final"):
        square(stage, name)
    UsdGeom.Xform.Define(stage, "/proxy").CreatePurposeAttr("proxy")
    UsdGeom.Mesh(stage.GetPrimAtPath("/proxy/final")).CreatePurposeAttr("render")
    assert [m.path for m in read(stage).meshes] == ["/proxy/final"]


def test_layers_that_are_no_longer_used_do_not_stop_the_next_reading(tmp_path):
    from fabricusd.scene.read import read_scene

    scene = tmp_path / "scene.usda"
    names = [f"part{k}.usda" for k in range(8)]
    for name in names:
        (tmp_path / name).write_text('#usda 1.0\n(\n defaultPrim="p"\n)\ndef "p" {\n}\n')
    parts = "".join(f'def "a{k}" (references=@./{n}@) {{\n}}\n' for k, n in enumerate(names))
    scene.write_text("#usda 1.0\n" + parts)
    held = Usd.Stage.Open(str(scene))
    scene.write_text('#usda 1.0\ndef "b" {\n}\n')
    os.utime(scene, (1, 1))
    assert read_scene(scene).meshes == []
    assert held.GetPrimAtPath("/b")


def test_a_scene_of_a_millionth_of_a_metre_asks_for_its_unit(tmp_path):
    stage = new_stage(tmp_path, metres=1e-8)
    square(stage)
    assert any("is metersPerUnit right?" in note for note in read(stage).notes)
