"""UsdPreviewSurface networks and what is bound to whom."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils

from fabricusd.images import write_16_bit, write_exr, write_png
from fabricusd.reference.scene import FabricSurface
from tests.reference.scenes import above, grid, picture
from tests.reference.stages import bind_fabric, new_stage, read, square

TYPES = Sdf.ValueTypeNames


def surface(stage: Usd.Stage, name: str = "/m", **inputs: object) -> UsdShade.Shader:
    """A material `name` with constant inputs; its UsdPreviewSurface."""
    material = UsdShade.Material.Define(stage, name)
    shader = UsdShade.Shader.Define(stage, f"{name}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    for key, value in inputs.items():
        kind = TYPES.Float if isinstance(value, float) else TYPES.Color3f
        shader.CreateInput(key, kind).Set(value)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return shader


def node(
    stage: Usd.Stage, path: str, kind: str, **inputs: tuple[object, object]
) -> UsdShade.Shader:
    shader = UsdShade.Shader.Define(stage, path)
    shader.CreateIdAttr(kind)
    for key, (type_, value) in inputs.items():
        given = shader.CreateInput(key, type_)
        if isinstance(value, UsdShade.Shader):
            given.ConnectToSource(value.ConnectableAPI(), "result")
        else:
            given.Set(value)
    return shader


def textured(
    stage: Usd.Stage, name: str, output: str, file: str, **inputs: tuple[object, object]
) -> None:
    """The material /m whose input `name` reads `output` of a texture; bound to /square."""
    shader = surface(stage)
    inputs["file"] = (TYPES.Asset, file)
    texture = node(stage, "/m/texture", "UsdUVTexture", **inputs)
    shader.CreateInput(name, TYPES.Float).ConnectToSource(texture.ConnectableAPI(), output)
    bind(stage)


def bind(stage: Usd.Stage, to: str = "/m", path: str = "/square", purpose: str = "") -> None:
    prim = stage.GetPrimAtPath(path)
    if not prim:
        prim = square(stage, path).GetPrim()
    api = UsdShade.MaterialBindingAPI.Apply(prim)
    material = UsdShade.Material(stage.GetPrimAtPath(to))
    api.Bind(material, UsdShade.Tokens.weakerThanDescendants, purpose)


def rendered(stage: Usd.Stage):
    """(the surface of the first mesh's first triangle, the scene)."""
    scene = read(stage)
    return scene.materials[scene.meshes[0].material[0]], scene


def rgba(path) -> None:
    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[..., :3], pixels[..., 3] = (200, 100, 50), [[255, 128], [64, 0]]
    write_png(path, pixels)


def test_opacity_comes_from_the_channel_that_is_named(tmp_path):
    rgba(tmp_path / "a.png")
    stage = new_stage(tmp_path)
    textured(stage, "opacity", "a", "./a.png")
    found, _ = rendered(stage)
    expected = np.array([[255, 128], [64, 0]]) / 255
    assert found.textures["opacity"].pixels[..., 0] == pytest.approx(expected, abs=1e-6)


def test_the_opacity_of_a_picture_does_not_darken_its_colours(tmp_path):
    rgba(tmp_path / "a.png")
    stage = new_stage(tmp_path)
    textured(stage, "diffuseColor", "rgb", "./a.png", sourceColorSpace=(TYPES.Token, "raw"))
    pixels = rendered(stage)[0].textures["diffuse"].pixels
    assert pixels == pytest.approx(np.broadcast_to(np.array([200, 100, 50]) / 255, (2, 2, 3)))


def test_scale_and_bias_are_those_of_the_channel(tmp_path):
    rgba(tmp_path / "a.png")
    stage = new_stage(tmp_path)
    textured(
        stage, "roughness", "g", "./a.png", scale=(TYPES.Float4, (9, 0.5, 9, 9)),
        bias=(TYPES.Float4, (9, 0.25, 9, 9)),
    )  # fmt: skip
    pixels = rendered(stage)[0].textures["roughness"].pixels
    assert pixels == pytest.approx(np.full((2, 2, 1), 0.5 * 100 / 255 + 0.25))


SPACES = {"auto": 188 / 255, "raw": 188 / 255, "sRGB": 0.503}


@pytest.mark.parametrize("space", SPACES)
def test_data_is_decoded_only_where_somebody_says_so(tmp_path, space):
    write_png(tmp_path / "a.png", np.full((2, 2, 3), 188, np.uint8))
    stage = new_stage(tmp_path)
    textured(stage, "roughness", "r", "./a.png", sourceColorSpace=(TYPES.Token, space))
    found = rendered(stage)[0].textures["roughness"].pixels
    assert found.mean() == pytest.approx(SPACES[space], abs=1e-3)


def test_sixteen_bits_are_linear_unless_somebody_says_otherwise(tmp_path):
    write_16_bit(tmp_path / "a.png", [np.full((2, 2, 3), 32768, np.uint16)], 2, 3, {})
    stage = new_stage(tmp_path)
    textured(stage, "diffuseColor", "rgb", "./a.png")
    assert rendered(stage)[0].textures["diffuse"].pixels.mean() == pytest.approx(0.5, abs=1e-4)


def test_a_fallback_stands_for_a_missing_texture_as_it_is(tmp_path):
    stage = new_stage(tmp_path)
    textured(
        stage, "opacity", "a", "./lost.png", fallback=(TYPES.Float4, (0.1, 0.2, 0.3, 0.7)),
        scale=(TYPES.Float4, (2, 2, 2, 2)),
    )  # fmt: skip
    found, scene = rendered(stage)
    assert found.textures["opacity"].pixels.ravel() == pytest.approx([0.7])
    assert any("lost.png" in note for note in scene.notes)


def test_a_texture_is_moved_as_usdtransform2d_says(tmp_path):
    # Four texels in a row; scaled by two, turned by 90 degrees and moved, u of the picture is
    # 1 - 2 v.
    pixels = np.repeat(np.array([[0, 80, 160, 240]], np.uint8)[..., None], 3, axis=2)
    write_png(tmp_path / "a.png", pixels)
    stage = new_stage(tmp_path)
    st = node(stage, "/m/st", "UsdPrimvarReader_float2", varname=(TYPES.String, "st"))
    move = node(
        stage, "/m/move", "UsdTransform2d", **{"in": (TYPES.Float2, st)},
        scale=(TYPES.Float2, (2, 2)), rotation=(TYPES.Float, 90.0),
        translation=(TYPES.Float2, (1, 0)),
    )  # fmt: skip
    textured(
        stage, "diffuseColor", "rgb", "./a.png", st=(TYPES.Float2, move),
        sourceColorSpace=(TYPES.Token, "raw"),
    )  # fmt: skip
    found, scene = rendered(stage)
    assert scene.notes == []
    assert np.reshape(found.textures["diffuse"].place, (2, 3)) @ [0.3, 0.2, 1] == pytest.approx(
        [1 - 0.4, 0.6]
    )
    mesh = grid()
    mesh.uv[:] = [0.5, (1 - 0.625) / 2]
    r = picture([mesh], [found], [], above(width=0.002), size=2, spp=4, aovs=("albedo",))
    shown = float(r.layers["albedo"][0, 0, 0])
    mesh.uv[:] = [0.5, (1 - 0.375) / 2]
    r = picture([mesh], [found], [], above(width=0.002), size=2, spp=4, aovs=("albedo",))
    assert shown > 1.5 * float(r.layers["albedo"][0, 0, 0])


def test_tiles_of_a_udim_texture_lie_beside_one_another(tmp_path):
    for tile, value in ((1001, 50), (1002, 100), (1011, 200)):
        side = 2 if tile == 1001 else 1
        write_png(tmp_path / f"a.{tile}.png", np.full((side, side, 3), value, np.uint8))
    stage = new_stage(tmp_path)
    textured(
        stage, "roughness", "r", "./a.<UDIM>.png", sourceColorSpace=(TYPES.Token, "raw")
    )  # fmt: skip
    texture = rendered(stage)[0].textures["roughness"]
    assert texture.wrap == ("black", "black")
    h, w, _ = texture.pixels.shape
    for u, v, value in ((0.5, 0.5, 50), (1.5, 0.5, 100), (0.5, 1.5, 200), (1.5, 1.5, 0)):
        x, y = np.reshape(texture.place, (2, 3)) @ [u, v, 1]
        assert texture.pixels[int((1 - y) * h), int(x * w), 0] == pytest.approx(value / 255)


def test_a_texture_is_found_inside_a_package(tmp_path):
    write_png(tmp_path / "a b ü.png", np.full((2, 2, 3), 188, np.uint8))
    stage = new_stage(tmp_path)
    textured(stage, "diffuseColor", "rgb", "./a b ü.png")
    stage.GetRootLayer().Save()
    package = str(tmp_path / "all.usdz")
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(stage.GetRootLayer().realPath), package)
    found, scene = rendered(Usd.Stage.Open(package))
    assert found.textures["diffuse"].pixels.mean() == pytest.approx(0.503, abs=2e-3)
    assert scene.notes == []


CONSTANTS = {
    # name: (input, its value, words, field, what is rendered)
    "a colour of one number": ("diffuseColor", 1.0, "must be a colour", "diffuse", (0.18,) * 3),
    "a number of three": ("roughness", (1, 1, 1), "must be a number", "roughness", 0.5),
    "a colour that is no number": (
        "diffuseColor", (math.nan, 0, 0), "must be a colour", "diffuse", (0.18,) * 3,
    ),
    "a negative colour": ("diffuseColor", (-1, 0.5, 0), "cut off", "diffuse", (0, 0.5, 0)),
    "a colour beyond all measure": (
        "diffuseColor", (1e30, 0, 0), "cut off", "diffuse", (100, 0, 0),
    ),
    "too metallic": ("metallic", 7.0, "cut off", "metallic", 1),
    "clearcoat": ("clearcoat", 1.0, "has clearcoat, left out", "roughness", 0.5),
}  # fmt: skip


@pytest.mark.parametrize("name", CONSTANTS)
def test_a_constant_that_makes_no_sense_is_one_line(tmp_path, name):
    key, value, words, field, expected = CONSTANTS[name]
    stage = new_stage(tmp_path)
    surface(stage, **{key: value if isinstance(value, float) else Gf.Vec3f(*value)})
    bind(stage)
    found, scene = rendered(stage)
    assert getattr(found, field) == pytest.approx(expected)
    assert [note for note in scene.notes if words in note and note.startswith("/m ")]


def file_is_a_string(stage, tmp_path):
    textured(stage, "diffuseColor", "rgb", "./a.png")
    stage.GetPrimAtPath("/m/texture").RemoveProperty("inputs:file")
    shader = UsdShade.Shader(stage.GetPrimAtPath("/m/texture"))
    shader.CreateInput("file", TYPES.String).Set("a.png")


def scale_is_one_number(stage, tmp_path):
    rgba(tmp_path / "a.png")
    textured(stage, "diffuseColor", "rgb", "./a.png", scale=(TYPES.Float, 2.0))


def texture_with_nan(stage, tmp_path):
    pixels = np.array([[[np.nan] * 3, [np.inf] * 3, [0.5] * 3]], np.float32)
    write_exr(tmp_path / "a.exr", {"beauty": pixels}, {"beauty": ("R", "G", "B")}, {})
    textured(stage, "diffuseColor", "rgb", "./a.exr")


def reader_of_a_colour(stage, tmp_path):
    shader = surface(stage)
    other = node(stage, "/m/reader", "UsdPrimvarReader_float3")
    shader.CreateInput("diffuseColor", TYPES.Color3f).ConnectToSource(
        other.ConnectableAPI(), "result"
    )
    bind(stage)


def no_uvs(stage, tmp_path):
    rgba(tmp_path / "a.png")
    square(stage, uv=False)
    textured(stage, "diffuseColor", "rgb", "./a.png")


def tiles_missing(stage, tmp_path):
    textured(stage, "diffuseColor", "rgb", "./lost.<UDIM>.png")


FAULTS = {
    "a file named by a string": (file_is_a_string, "names no asset"),
    "a scale of one number": (scale_is_one_number, "scale 2.0"),
    "a texture with values that are not finite": (texture_with_nan, "has 6 values"),
    "a colour from a primvar": (reader_of_a_colour, "UsdPrimvarReader_float3"),
    "a texture without UVs": (no_uvs, "/square has no UVs for its textures"),
    "tiles that are missing": (tiles_missing, "has no tiles"),
    "a material that is nowhere": (
        lambda stage, _: UsdShade.MaterialBindingAPI.Apply(square(stage).GetPrim())
        .GetDirectBindingRel().SetTargets(["/lost"]),
        "/square is bound to /lost, which is no material",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_broken_network_is_one_line_and_rendered(tmp_path, name):
    make, words = FAULTS[name]
    stage = new_stage(tmp_path)
    make(stage, tmp_path)
    if not stage.GetPrimAtPath("/square"):
        square(stage)
    found, scene = rendered(stage)
    assert len([note for note in scene.notes if words in note]) == 1, scene.notes
    assert all(np.isfinite(texture.pixels).all() for texture in found.textures.values())


@pytest.mark.parametrize("purpose", ["", "full", "preview"])
def test_a_material_of_any_purpose_is_rendered(tmp_path, purpose):
    stage = new_stage(tmp_path)
    surface(stage, diffuseColor=Gf.Vec3f(1, 0, 0))
    bind(stage, purpose=purpose)
    assert rendered(stage)[0].diffuse == (1, 0, 0)


def test_the_full_purpose_goes_before_the_others(tmp_path):
    stage = new_stage(tmp_path)
    for name, purpose in (("/any", ""), ("/full", "full"), ("/preview", "preview")):
        surface(stage, name)
        bind(stage, name, purpose=purpose)
    assert rendered(stage)[0].name == "/full"


def test_a_subset_without_a_material_wears_the_fabric_of_its_mesh(tmp_path):
    stage = new_stage(tmp_path)
    surface(stage)
    bind(stage)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/square"))
    bind_fabric(stage, mesh.GetPrim())
    UsdGeom.Subset.CreateGeomSubset(mesh, "part", UsdGeom.Tokens.face, [0])
    assert isinstance(rendered(stage)[0], FabricSurface)


def test_a_subset_may_be_bound_by_a_collection(tmp_path):
    stage = new_stage(tmp_path)
    surface(stage, diffuseColor=Gf.Vec3f(0, 1, 0))
    mesh = square(stage, "/group/square")
    bind_fabric(stage, mesh.GetPrim())
    subset = UsdGeom.Subset.CreateGeomSubset(mesh, "part", UsdGeom.Tokens.face, [0])
    group = UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/group"))
    collection = Usd.CollectionAPI.Apply(group.GetPrim(), "parts")
    collection.IncludePath(subset.GetPath())
    group.Bind(collection, UsdShade.Material(stage.GetPrimAtPath("/m")))
    assert rendered(stage)[0].name == "/m"


DISPLAYED = {
    # name: (primvar, type, values, where it is authored, words, diffuse, opacity)
    "inherited": ("displayColor", TYPES.Color3fArray, [(1, 0, 0)], "/group", "", (1, 0, 0), 1),
    "varying": (
        "displayColor", TYPES.Color3fArray, [(1, 0, 0), (0, 1, 0)], "/group/square", "varies",
        (0.5, 0.5, 0), 1,
    ),
    "not finite": (
        "displayColor", TYPES.Color3fArray, [(math.nan, 0, 0)], "/group/square", "not finite",
        (0.18,) * 3, 1,
    ),
    "of another type": (
        "displayColor", TYPES.FloatArray, [1.0], "/group", "type float[]", (0.18,) * 3, 1,
    ),
    "opacity": ("displayOpacity", TYPES.FloatArray, [0.3], "/group/square", "", (0.18,) * 3, 0.3),
}  # fmt: skip


@pytest.mark.parametrize("name", DISPLAYED)
def test_a_mesh_without_a_material_has_its_display_colour(tmp_path, name):
    primvar, kind, values, where, words, diffuse, opacity = DISPLAYED[name]
    stage = new_stage(tmp_path)
    square(stage, "/group/square")
    UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(where)).CreatePrimvar(primvar, kind).Set(values)
    found, scene = rendered(stage)
    assert found.diffuse == pytest.approx(diffuse)
    assert found.opacity == pytest.approx(opacity)
    assert [words] == [words for note in scene.notes if words in note] or not words
