"""UsdPreviewSurface networks and what is bound to whom."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils

from fabricusd.images.files import write_16_bit, write_exr, write_png
from fabricusd.scene.scene import FabricSurface
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


def normal_map(stage, file="./n.png", output="rgb", **inputs):
    """The square with a normal map of codes; `inputs` add to the texture's own."""
    own = {
        "scale": (TYPES.Float4, (2, 2, 2, 1)), "bias": (TYPES.Float4, (-1, -1, -1, 0)),
        "sourceColorSpace": (TYPES.Token, "raw"),
    }  # fmt: skip
    textured(stage, "normal", output, file, **(own | inputs))


def write_normals(path, *normals) -> None:
    """A square picture of columns of unit normals, coded in 16 bits."""
    codes = np.round((np.array([normals] * len(normals)) + 1) / 2 * 65535).astype(np.uint16)
    write_16_bit(path, [codes], len(normals), 3, {})


def normal_of_one_channel(stage, tmp_path):
    write_normals(tmp_path / "n.png", (0, 0, 1))
    normal_map(stage, output="g")


def normal_of_a_grey_picture(stage, tmp_path):
    write_16_bit(tmp_path / "n.png", [np.full((2, 2, 1), 40000, np.uint16)], 2, 1, {})
    normal_map(stage)


def normal_that_is_lost(stage, tmp_path):
    normal_map(stage, "./lost.png")


def normal_that_is_no_picture(stage, tmp_path):
    (tmp_path / "n.png").write_bytes(b"\x89PNG\r\n\x1a\n but no more")
    normal_map(stage)


def normal_without_scale(stage, tmp_path):
    write_normals(tmp_path / "n.png", (0.6, 0, 0.8))
    normal_map(stage, scale=(TYPES.Float4, (1, 1, 1, 1)), bias=(TYPES.Float4, (0, 0, 0, 0)))


def normal_as_srgb(stage, tmp_path):
    write_normals(tmp_path / "n.png", (0.6, 0, 0.8))
    normal_map(stage, sourceColorSpace=(TYPES.Token, "sRGB"))


def normal_from_another_node(stage, tmp_path):
    shader = surface(stage)
    other = node(stage, "/m/reader", "UsdPrimvarReader_normal")
    shader.CreateInput("normal", TYPES.Normal3f).ConnectToSource(other.ConnectableAPI(), "result")
    bind(stage)


FAULTS = {
    "a file named by a string": (file_is_a_string, "names no asset"),
    "a scale of one number": (scale_is_one_number, "scale 2.0"),
    "a texture with values that are not finite": (texture_with_nan, "has 6 values"),
    "a colour from a primvar": (reader_of_a_colour, "UsdPrimvarReader_float3"),
    "a texture without UVs": (no_uvs, "/square has no UVs for its textures"),
    "tiles that are missing": (tiles_missing, "has no tiles"),
    "a normal from one channel": (normal_of_one_channel, "reads normal from one channel"),
    "a normal map in grey": (normal_of_a_grey_picture, "reads normal from one channel"),
    "a normal map that is lost": (normal_that_is_lost, "lost.png"),
    "a normal map that is damaged": (normal_that_is_no_picture, "n.png"),
    "a normal map without scale and bias": (normal_without_scale, "without a bias"),
    "a normal map in sRGB": (normal_as_srgb, "as sRGB"),
    "a normal from a primvar": (normal_from_another_node, "UsdPrimvarReader_normal"),
    "a material that is nowhere": (
        lambda stage, _: UsdShade.MaterialBindingAPI.Apply(square(stage).GetPrim())
        .GetDirectBindingRel().SetTargets(["/lost"]),
        "/square is bound to /lost, which is not a material",
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


def shown_normal(stage) -> np.ndarray:
    """The normal that a picture from above shows in the middle, but for the rest of the square."""
    scene = read(stage)
    camera = above(width=0.002)
    r = picture(scene.meshes, scene.materials, [], camera, size=2, spp=4, aovs=("normal",))
    return r.layers["normal"][0, 0]


TILTED = (0.48, -0.36, 0.8)


def test_a_normal_map_is_read_as_its_codes_say(tmp_path):
    write_normals(tmp_path / "n.png", TILTED)
    stage = new_stage(tmp_path)
    normal_map(stage)
    found, scene = rendered(stage)
    assert scene.notes == []
    assert found.textures["normal"].pixels.ravel() == pytest.approx(TILTED, abs=2e-5)


# `square` lies in the plane y = 0: u grows along +x and v along +z at its points, seen from above
# u to the right and v downwards, so its UVs are mirrored.
SHELLS = {
    # name: (st of the four corners, the normal in the world)
    "mirrored": ([(0, 0), (0, 1), (1, 1), (1, 0)], (0.48, 0.8, -0.36)),
    "as it lies": ([(0, 1), (0, 0), (1, 0), (1, 1)], (0.48, 0.8, 0.36)),
    "u and v flipped": ([(1, 0), (1, 1), (0, 1), (0, 0)], (-0.48, 0.8, -0.36)),
    "a quarter turn": ([(0, 0), (1, 0), (1, 1), (0, 1)], (-0.36, 0.8, 0.48)),
}


@pytest.mark.parametrize("name", SHELLS)
def test_a_normal_map_follows_the_uvs_of_its_shell(tmp_path, name):
    corners, expected = SHELLS[name]
    write_normals(tmp_path / "n.png", TILTED)
    stage = new_stage(tmp_path)
    normal_map(stage)
    UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/square")).GetPrimvar("st").Set(corners)
    assert shown_normal(stage) == pytest.approx(expected, abs=5e-5)


def test_a_transform_turns_the_relief_with_the_picture(tmp_path):
    write_normals(tmp_path / "n.png", TILTED)
    stage = new_stage(tmp_path)
    reader = node(stage, "/m/st", "UsdPrimvarReader_float2", varname=(TYPES.String, "st"))
    turned = node(stage, "/m/turn", "UsdTransform2d", rotation=(TYPES.Float, 90.0))
    turned.CreateInput("in", TYPES.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
    normal_map(stage, st=(TYPES.Float2, turned))
    corners, _ = SHELLS["as it lies"]
    UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/square")).GetPrimvar("st").Set(corners)
    # The picture's u is the mesh's -v, its v the mesh's u.
    assert shown_normal(stage) == pytest.approx((-0.36, 0.8, 0.48), abs=5e-5)


def test_a_missing_tile_and_black_texels_leave_the_surface_its_own_normal(tmp_path):
    write_normals(tmp_path / "n.1001.png", TILTED, (-1, -1, -1))
    write_normals(tmp_path / "n.1012.png", TILTED)
    stage = new_stage(tmp_path)
    normal_map(stage, "./n.<UDIM>.png")
    found, scene = rendered(stage)
    assert scene.notes == []
    pixels = found.textures["normal"].pixels
    assert pixels.shape == (4, 4, 3)
    # The tile at the lower left with its black column; missing ones; the one at the upper right.
    assert pixels[2:, 0] == pytest.approx(np.array([TILTED] * 2), abs=2e-5)
    assert not pixels[2:, 1:].any()
    assert not pixels[:2, :2].any()
    assert pixels[:2, 2:] == pytest.approx(np.full((2, 2, 3), TILTED), abs=2e-5)


CONSTANT_NORMALS = {
    # name: (normal, what is shown, words of the note)
    "tilted": (Gf.Vec3f(0.48, -0.36, 0.8), (0.48, 0.8, 0.36), ""),
    "of another length": (Gf.Vec3f(4.8, -3.6, 8), (0.48, 0.8, 0.36), ""),
    "the surface's own": (Gf.Vec3f(0, 0, 1), (0, 1, 0), ""),
    "of no length": (Gf.Vec3f(0, 0, 0), (0, 1, 0), "normal of length 0"),
    "not finite": (Gf.Vec3f(math.nan, 0, 1), (0, 1, 0), "a vector of three numbers"),
    "one number": (1.0, (0, 1, 0), "a vector of three numbers"),
}  # fmt: skip


@pytest.mark.parametrize("name", CONSTANT_NORMALS)
def test_a_constant_normal_tilts_the_whole_surface(tmp_path, name):
    value, expected, words = CONSTANT_NORMALS[name]
    stage = new_stage(tmp_path)
    surface(stage, normal=value)
    bind(stage)
    corners, _ = SHELLS["as it lies"]
    UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/square")).GetPrimvar("st").Set(corners)
    assert shown_normal(stage) == pytest.approx(expected, abs=1e-6)
    notes = rendered(stage)[1].notes
    assert (notes == []) if not words else (len(notes) == 1 and words in notes[0])


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


OPACITY = {
    # name: (opacity, opacityMode, opacityThreshold, words)
    "opaque": (1.0, "", 0.0, ""),
    "a gap by presence": (0.5, "presence", 0.0, ""),
    "transparent by default": (0.5, "", 0.0, "rendered as 'presence'"),
    "transparent": (0.5, "transparent", 0.0, "rendered as 'presence'"),
    "cut out": (0.5, "transparent", 0.4, ""),
    "an unknown mode": (0.5, "foggy", 0.0, "must be one of transparent, presence"),
}


@pytest.mark.parametrize("name", OPACITY)
def test_opacity_is_presence_and_another_mode_is_noted(name, tmp_path):
    opacity, mode, threshold, words = OPACITY[name]
    stage = new_stage(tmp_path)
    given = {"opacity": opacity, "opacityThreshold": threshold}
    surface(stage, **given)
    if mode:
        shader = next(
            UsdShade.Shader(p) for p in stage.Traverse() if p.IsA(UsdShade.Shader)
        )  # fmt: skip
        shader.CreateInput("opacityMode", Sdf.ValueTypeNames.Token).Set(mode)
    bind(stage)
    shown, scene = rendered(stage)
    assert shown.opacity == opacity
    assert (scene.notes == []) if not words else (words in " ".join(scene.notes))
