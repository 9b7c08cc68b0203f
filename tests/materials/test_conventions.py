"""Which way is the tangent, which axis is rough, is green up: each row of docs/conventions.md.

Each test says which wrong convention makes it fail. The cloth is a satin, whose warp shows and
shines across itself: its highlights are long along the weft.
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade

from fabricusd.appearance import surface
from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings as BakeSettings
from fabricusd.bake.layout.garment import garments
from fabricusd.bake.layout.tangents import corner_tangents
from fabricusd.fabric import Binding
from fabricusd.images.files import read_mip_level
from fabricusd.materials.fit.models import Surface, evaluate
from fabricusd.materials.materials import write_materials
from fabricusd.materials.networks.graph import Value
from fabricusd.materials.networks.look import Look
from fabricusd.materials.networks.surfaces import GRAPHS, MAPS
from fabricusd.materials.recipes import NEUTRAL, Settings
from fabricusd.materials.targets.gltf.layers import rougher, strength
from fabricusd.materials.targets.swatch import pictures as swatch_pictures
from fabricusd.materials.targets.tile import Tile
from fabricusd.materials.targets.u3m import pictures as u3m_pictures
from fabricusd.scene.read import read_scene
from fabricusd.schema import load, write_binding, write_fabric
from fabricusd.srgb import srgb_decode, srgb_encode
from tests.materials.graphs import alphas, value_of
from tests.materials.scenes import MAPS as BAKED_MAPS
from tests.materials.targets.gltf.files import GlbFile
from tests.reference.stages import new_stage

pytest.importorskip("pygltflib")

SIDE = 0.3
"""Side of a shell, in metres and in UV."""

SHELLS = {
    "straight": (0.02, ((1.0, 0.0), (0.0, 1.0))),
    "mirrored": (0.34, ((-1.0, 0.0), (0.0, 1.0))),
    "turned": (0.66, ((0.0, -1.0), (1.0, 0.0))),
}
"""Name -> (least u, columns of the matrix from UV to x and y). The turned shell's u runs along y
and its v against x."""

CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
"""Of a square, counter-clockwise in x and y."""

STEEP = np.radians(50.0)
"""Tilt of the half vectors, beyond the satin's highlights along the warp (25 to 32 degrees)."""


def uv_of(name):
    """(4, 2) UVs of the square's corners."""
    low, matrix = SHELLS[name]
    flat = (CORNERS - 0.5) @ np.array(matrix)
    return SIDE * (flat + 0.5) + (low, 0.05)


def write_shells(folder):
    """Three squares in the plane z = 0 that face +z, whose shells are all of one bake."""
    stage = new_stage(folder)
    mesh = UsdGeom.Mesh.Define(stage, "/Cloth")
    points = [
        (*(SIDE * c + (0.4 * k, 0.0)), 0.0) for k in range(len(SHELLS)) for c in CORNERS
    ]  # fmt: skip
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr([4] * len(SHELLS))
    mesh.CreateFaceVertexIndicesAttr(list(range(len(points))))
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    st.Set([tuple(uv) for name in SHELLS for uv in uv_of(name)])
    write_fabric(stage, "/Looks/Satin", load("polyester_satin_charmeuse"))
    laid = Binding(fabric=load("polyester_satin_charmeuse"), threads_per_uv=(24.0, 24.0))
    write_binding(mesh.GetPrim(), "/Looks/Satin", laid)
    stage.GetRootLayer().Save()
    return folder / "scene.usda"


class Made:
    """The files of a bake, and what they say at the texels of each shell."""

    def __init__(self, folder):
        self.folder = folder
        scene = write_shells(folder)
        maps = (*BAKED_MAPS, "height")
        bake(scene, folder / "baked", BakeSettings(resolution=128, maps=maps), workers=1)
        settings = Settings(
            surfaces=("openpbr", "standard_surface", "gltf_pbr"), fitted=False,
            targets={"glb": folder / "look.glb"},
        )  # fmt: skip
        write_materials(folder / "baked", folder / "look.usda", settings)
        self.stage = Usd.Stage.Open(str(folder / "look.usda"))
        (self.mesh,) = (UsdGeom.Mesh(p) for p in self.stage.Traverse() if p.IsA(UsdGeom.Mesh))
        self.glb = GlbFile(folder / "look.glb")
        self.maps = {name: read_mip_level(folder / f"baked/Cloth.{name}.exr") for name in maps}

    def texels(self, name, every=1):
        """Rows and columns of the texels well inside a shell; row 0 is the top."""
        low, _ = SHELLS[name]
        first, last = int((low + 0.02) * 128), int((low + SIDE - 0.02) * 128)
        top, bottom = int((1 - 0.33) * 128), int((1 - 0.07) * 128)
        rows, columns = np.mgrid[top:bottom:every, first:last:every]
        return rows.ravel(), columns.ravel()

    def frame(self, name):
        """The mesh's own tangent, bitangent and normal on a shell, from USD primvars."""
        primvars = UsdGeom.PrimvarsAPI(self.mesh)
        one = {
            k: np.array(primvars.GetPrimvar(k).ComputeFlattened()) for k in ("tangents", "normals")
        }
        uv = np.array(primvars.GetPrimvar("st").ComputeFlattened())
        return _frame(one["tangents"], one["normals"], uv[:, 0], name)

    def glb_frame(self, name):
        """The same from the glTF file, which has another v."""
        ((attributes, _, _),) = self.glb.primitives()
        tangent, normal = attributes["TANGENT"], attributes["NORMAL"]
        return _frame(tangent, normal, attributes["TEXCOORD_0"][:, 0], name)

    def picture(self, reference):
        """The pixels of a texture of the glTF file."""
        said = self.glb.said
        image = said["images"][said["textures"][reference["index"]]["source"]]
        (self.folder / "picture.png").write_bytes(self.glb.view(image["bufferView"]))
        return read_mip_level(self.folder / "picture.png")


def _frame(tangents, normals, u, name):
    """A frame from all corners of a shell, which agree."""
    low, _ = SHELLS[name]
    mine = (u > low - 0.01) & (u < low + SIDE + 0.01)
    tangent, normal = tangents[mine], normals[mine]
    assert mine.sum() >= 4
    assert np.allclose(tangent, tangent[0], atol=1e-5)
    t, n = tangent[0, :3].astype(float), normal[0].astype(float)
    return {"tangent": t, "bitangent": tangent[0, 3] * np.cross(n, t), "normal": n}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return Made(tmp_path_factory.mktemp("conventions"))


@pytest.mark.parametrize("name", SHELLS)
def test_tangents_are_the_direction_of_u_and_bitangents_that_of_v_in_usd_and_gltf(made, name):
    """Fails if the sign in w is lost on the mirrored shell, or if glTF's v turns the bitangent."""
    matrix = np.array(SHELLS[name][1])
    for frame in (made.frame(name), made.glb_frame(name)):
        assert np.allclose(frame["tangent"][:2], matrix[:, 0], atol=1e-5)
        assert np.allclose(frame["bitangent"][:2], matrix[:, 1], atol=1e-5)
        assert np.allclose(frame["normal"], (0, 0, 1), atol=1e-5)
    hand = np.cross(frame["tangent"], frame["bitangent"])[2]
    assert hand == pytest.approx(-1.0 if name == "mirrored" else 1.0)


def glow(kind, frame, inputs, look, alpha):
    """(along x, along y) light that comes back from half vectors tilted that way in the world."""
    graph = GRAPHS[kind](inputs, True)
    given = {
        k: value_of(graph, s, frame, look) for k, s in graph.node(graph.terminal).inputs.items()
    }
    x = np.asarray(given.get("geometry_tangent", given.get("tangent")))
    n = frame["normal"]
    rough, smooth = alpha(kind, given)
    one = np.ones(1)
    worn = Surface(
        base=np.zeros((1, 3)), ior=1.5 * one, alpha_rough=rough * one, alpha_smooth=smooth * one,
        tint=np.ones((1, 3)), fuzz_weight=0 * one, fuzz_color=np.ones((1, 3)),
        fuzz_roughness=0.5 * one,
    )  # fmt: skip
    x = x - (x @ n) * n
    axes = np.stack((x / np.linalg.norm(x), np.cross(n, x / np.linalg.norm(x)), n))
    half = np.array([(np.sin(STEEP), 0, np.cos(STEEP)), (0, np.sin(STEEP), np.cos(STEEP))])
    local = half @ axes.T
    return evaluate(kind, worn, local, local).mean(axis=-1)


def inputs_at(made, row, column):
    """Constants in place of the textures, as the networks read them at one texel."""
    found = dict(NEUTRAL)
    for name, kind in MAPS.items():
        if name in made.maps:
            value = made.maps[name][row, column]
            value = 0.5 * value + 0.5 if name == "normal" else value
            found[name] = Value(kind, tuple(map(float, value)) if len(value) > 1 else value[0])
    return found


def weft_and_warp(name):
    """Indices, of x and y, of the weft's and the warp's direction in the world."""
    return (1, 0) if name == "turned" else (0, 1)


def test_the_cloth_itself_shines_across_its_warp():
    """What the other tests call right comes from the law of the cloth and from no map."""
    fabric = load("polyester_satin_charmeuse")
    half = np.array([(np.sin(STEEP), 0, np.cos(STEEP)), (0, np.sin(STEEP), np.cos(STEEP))])
    shadow = surface.mean_shadow(fabric)
    weft, warp = surface.evaluate(fabric, half, half, level="far", shadow=shadow).mean(axis=1)
    assert weft > 4.0 * warp


@pytest.mark.parametrize("kind", GRAPHS)
@pytest.mark.parametrize("name", SHELLS)
def test_highlights_are_long_across_the_warp_on_every_shell(made, kind, name):
    """Fails if the tangent is the smoother axis, or if a mirrored or turned shell turns it."""
    frame = made.frame(name)
    lights = [
        glow(kind, frame, inputs_at(made, r, c), Look(), alphas)
        for r, c in zip(*made.texels(name, every=9), strict=True)
    ]
    weft, warp = weft_and_warp(name)
    mean = np.mean(lights, axis=0)
    assert mean[weft] > 2.0 * mean[warp]


@pytest.mark.parametrize("name", SHELLS)
def test_the_anisotropy_texture_of_gltf_is_rough_across_the_warp_on_every_shell(made, name):
    """Fails if red and green hold the smoother axis, or green counts down as glTF's v does."""
    frame = made.glb_frame(name)
    material = made.glb.material("Cloth")
    told = material["extensions"]["KHR_materials_anisotropy"]["anisotropyTexture"]
    red, green, blue = np.moveaxis(made.picture(told)[made.texels(name)][:, :3], 1, 0)
    world = np.outer(2 * red - 1, frame["tangent"]) + np.outer(2 * green - 1, frame["bitangent"])
    share = np.average(world[:, :2] ** 2, axis=0, weights=blue)
    weft, warp = weft_and_warp(name)
    assert share[weft] > 2.0 * share[warp]


def leans_down(made, name, normals, frame):
    """Correlation, in the world along the warp, of codes' lean and the slope of the baked height.

    normals : (h, w, 3) codes, row 0 at the top
    """
    rows, columns = made.texels(name)
    height = made.maps["height"][..., 0]
    # Rows count down, v up.
    slope = np.stack(
        (
            height[rows, columns + 1] - height[rows, columns - 1],
            height[rows - 1, columns] - height[rows + 1, columns],
        ),
        axis=1,
    ) @ np.linalg.inv(np.array(SHELLS[name][1]))  # fmt: skip
    code = 2.0 * normals[rows, columns, :3] - 1.0
    world = code @ np.stack((frame["tangent"], frame["bitangent"], frame["normal"]))
    _, warp = weft_and_warp(name)
    # Only where the warp is on top and no other thread beside: its crest is the known shape.
    top = np.abs(made.maps["tangent"][rows, columns, 1]) > 0.9
    return np.corrcoef(slope[top, warp], world[top, warp])[0, 1]


@pytest.mark.parametrize("name", SHELLS)
def test_normals_lean_down_the_slope_of_a_crest_on_every_shell(made, name):
    """Fails if green is down, if red and green change places, or if w is lost when mirrored."""
    coded = read_mip_level(made.folder / "look_maps/Cloth.normal.1001.png")
    in_glb = made.picture(made.glb.material("Cloth")["normalTexture"])
    assert leans_down(made, name, coded, made.frame(name)) < -0.2
    assert leans_down(made, name, in_glb, made.glb_frame(name)) < -0.2
    flipped = coded * (1, -1, 1) + (0, 1, 0)
    assert leans_down(made, name, flipped, made.frame(name)) > 0.2


def test_the_preview_surface_reads_normals_from_minus_one_to_one(made):
    """Fails if the reader's scale and bias are left out, or if they flip green."""
    (reader,) = (
        UsdShade.Shader(p) for p in made.stage.Traverse() if p.GetName() == "Preview_normal"
    )
    scale, bias = (np.array(reader.GetInput(k).Get())[:3] for k in ("scale", "bias"))
    assert np.allclose(scale, 2.0)
    assert np.allclose(bias, -1.0)


def test_every_texture_says_its_colour_space_and_holds_what_it_says(made):
    """Fails if data pass through a curve, if colours do not, or if a reader is not told."""
    images = 0
    for prim in made.stage.Traverse():
        shader = UsdShade.Shader(prim) if prim.IsA(UsdShade.Shader) else None
        file = shader.GetInput("file") if shader else None
        if not file:
            continue
        images += 1
        color = "base_color" in file.Get().path
        if shader.GetIdAttr().Get() == "UsdUVTexture":
            # The EXR is linear, so the reader may not decode it; its primaries are told besides.
            assert shader.GetInput("sourceColorSpace").Get() == "raw"
            assert file.GetAttr().GetColorSpace() == ("lin_rec709_scene" if color else "raw")
        else:
            assert file.GetAttr().GetColorSpace() == ("lin_rec709" if color else "raw")
            assert shader.GetIdAttr().Get().startswith("ND_image_color3") == color
    assert images == 8
    root = ElementTree.parse(made.folder / "look.mtlx").getroot()
    assert root.get("colorspace") == "lin_rec709"
    files = [
        (node, one) for node in root.iter("image") for one in node if one.get("name") == "file"
    ]
    for node, one in files:
        color = "base_color" in one.get("value")
        # MaterialX converts color3 and color4 alone, so data are neither.
        assert (node.get("type") == "color3") == color
        assert one.get("colorspace") == ("lin_rec709" if color else None)
    assert len(files) == 15
    material = made.glb.material("Cloth")
    at = made.texels("straight")
    base = made.picture(material["pbrMetallicRoughness"]["baseColorTexture"])[at][:, :3]
    assert np.abs(base - srgb_encode(made.maps["base_color"][at])).max() < 0.003
    packed = made.picture(material["pbrMetallicRoughness"]["metallicRoughnessTexture"])[at]
    smooth = np.minimum(made.maps["roughness_along"][at][:, 0] ** 2, 1.0)
    assert np.abs(packed[:, 1] - np.sqrt(smooth)).max() < 0.003
    normal = made.picture(material["normalTexture"])[at]
    assert np.abs(normal - (0.5 * made.maps["normal"][at] + 0.5)).max() < 0.004


def test_cloth_has_two_sides_in_usd_and_gltf_and_its_surfaces_are_thin(made):
    """Fails if a renderer may cull the back, or would take the sheet for a solid."""
    assert made.mesh.GetDoubleSidedAttr().Get()
    assert all(one["doubleSided"] for one in made.glb.said["materials"])
    root = ElementTree.parse(made.folder / "look.mtlx").getroot()
    for category, name in (
        ("open_pbr_surface", "geometry_thin_walled"), ("standard_surface", "thin_walled"),
    ):  # fmt: skip
        nodes = root.findall(category)
        assert nodes
        for node in nodes:
            told = {one.get("name"): one.get("value") for one in node.findall("input")}
            assert told[name] == "true"
    variants = made.stage.GetPrimAtPath("/Garment").GetVariantSets().GetVariantSet("fabricLook")
    variants.SetVariantSelection("off")
    assert not made.mesh.GetDoubleSidedAttr().HasAuthoredValue()
    variants.SetVariantSelection("baked")


def test_a_garment_that_says_how_many_sides_it_has_keeps_its_word(tmp_path, made):
    """Fails if the look overrides the garment's own opinion."""
    stage = Usd.Stage.Open(str(write_shells(tmp_path)))
    UsdGeom.Mesh(stage.GetPrimAtPath("/Cloth")).CreateDoubleSidedAttr(False)
    stage.GetRootLayer().Save()
    settings = Settings(fitted=False)
    write_materials(
        made.folder / "baked", tmp_path / "own.usda", settings, scene=tmp_path / "scene.usda"
    )
    own = Usd.Stage.Open(str(tmp_path / "own.usda"))
    assert UsdGeom.Mesh(own.GetPrimAtPath("/Cloth")).GetDoubleSidedAttr().Get() is False


def test_tangents_meet_at_a_seam_of_tiles_and_turn_with_the_shell_beyond(tmp_path):
    """Fails if corners of two shells share a tangent, or if a tile's number changes it."""
    stage = new_stage(tmp_path)
    mesh = UsdGeom.Mesh.Define(stage, "/Cloth")
    mesh.CreatePointsAttr([(x, y, 0.0) for y in (0, 1) for x in (0, 1, 2, 3)])
    mesh.CreateFaceVertexCountsAttr([4] * 3)
    mesh.CreateFaceVertexIndicesAttr([k for x in range(3) for k in (x, x + 1, x + 5, x + 4)])
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    # Tiles 1001, 1002 and 1003; the third shell is turned by a quarter.
    shells = np.stack((CORNERS, CORNERS, np.roll(CORNERS, 1, axis=0)))
    shells[..., 0] += np.arange(3)[:, None]
    st.Set([tuple(uv) for uv in shells.reshape(-1, 2).tolist()])
    stage.GetRootLayer().Save()
    scene = read_scene(tmp_path / "scene.usda", fabric=load("linen_plain"))
    found = corner_tangents(garments(scene)[0]).reshape(3, -1, 4)
    assert np.allclose(found[:2], (1, 0, 0, 1), atol=1e-6)
    assert np.allclose(found[2], (0, 1, 0, 1), atol=1e-6)


TURN = np.radians(np.array([[10.0, 30.0, 80.0, 100.0], [120.0, 150.0, -20.0, 45.0]]))


@pytest.mark.parametrize("kind", GRAPHS)
@pytest.mark.parametrize("name", SHELLS)
def test_networks_turn_an_oblique_axis_with_the_shell(made, kind, name):
    """Fails if the quarter turn goes the other way, or if a mirrored shell keeps the axis."""
    frame, graph_of = made.frame(name), GRAPHS[kind]
    for angle in TURN.ravel():
        axis = np.array((np.cos(angle), np.sin(angle)))
        graph = graph_of({**NEUTRAL, "tangent": Value("vector3", (*axis, 0.0))}, True)
        inputs = graph.node(graph.terminal).inputs
        source = inputs.get("geometry_tangent", inputs.get("tangent"))
        rough = value_of(graph, source, frame, Look())
        smooth = np.array(SHELLS[name][1]) @ axis
        assert rough[:2] @ smooth == pytest.approx(0.0, abs=1e-6)
        assert np.linalg.norm(rough) == pytest.approx(1.0)


@pytest.fixture(scope="module")
def oblique():
    """A tile whose axes lie at all angles, so that a wrong sense of rotation shows."""
    rng = np.random.default_rng(2)
    along = rng.uniform(0.3, 0.5, (*TURN.shape, 1))
    axis = np.stack((np.cos(TURN), np.sin(TURN), 0 * TURN), axis=-1)
    maps = {
        "roughness_along": along, "roughness_across": along + 0.3, "tangent": axis,
        "normal": np.full((*TURN.shape, 3), (0.0, 0.6, 0.8)), "height": rng.random(along.shape),
        "opacity": np.ones_like(along), "base_color": rng.random((*TURN.shape, 3)),
    }  # fmt: skip
    fabric = load("polyester_satin_charmeuse")
    return Tile(fabric=fabric, ends=4, picks=2, size=(1.0, 1.0), maps=maps, texels=None)


def painter(tile):
    """lib-sampler.md and lib-vectors.md: alpha.x along T cos - B sin, U being the first axis."""
    found = {k: v.pixels[..., 0] for k, v in swatch_pictures(tile, Look()).items()}
    angle = 2 * np.pi * found["AnisotropyAngle"]
    smooth = found["Roughness"] ** 2
    rough = (found["Roughness"] / np.sqrt(1.0 - found["Anisotropy"])) ** 2
    return (np.cos(angle), -np.sin(angle)), smooth, rough


def painter_asm(tile):
    """As `_swatch.json` says; lib-sampler.md's ASM is rougher along its own first axis."""
    found = {k: v.pixels[..., 0] for k, v in swatch_pictures(tile, Look()).items()}
    smooth = found["Roughness"] ** 2
    level = (smooth / (1.0 - found["Anisotropy"]) - smooth) ** 0.25
    angle = 2 * np.pi * found["AnisotropyAngle"] + np.pi / 2
    rough = np.minimum(1.0, smooth + level**4)
    first = np.stack((np.cos(angle), -np.sin(angle)))
    return (-first[1], first[0]), smooth, rough


def unreal(tile):
    """Kulla and Conty: alpha (1 + a) along the tangent, alpha (1 - a) across it."""
    found = {k: v.pixels[..., 0] for k, v in swatch_pictures(tile, Look()).items()}
    a = found["Anisotropy"] / (2.0 - found["Anisotropy"])
    alpha = (found["Roughness"] / np.sqrt(1.0 - a)) ** 2
    clockwise = 2 * np.pi * found["AnisotropyAngle"] + np.pi / 2
    tangent = np.cos(clockwise), -np.sin(clockwise)
    return (-tangent[1], tangent[0]), alpha * (1.0 - a), alpha * (1.0 + a)


def cycles(tile):
    """U3M's principled shader is Blender's: T turned counter-clockwise by a share of a turn."""
    found = {k: v[..., 0] for k, v in u3m_pictures(tile, Look())[0].items()}
    aspect = np.sqrt(1.0 - 0.9 * found["anisotropy"])
    turn = 2 * np.pi * found["anisotropy_rotation"]
    alpha = found["roughness"] ** 2
    return (-np.sin(turn), np.cos(turn)), alpha * aspect, alpha / aspect


def khronos(tile):
    """KHR_materials_anisotropy: the direction in red and green is the rougher one."""
    smooth = tile.maps["roughness_along"][..., 0] ** 2
    rough = tile.maps["roughness_across"][..., 0] ** 2
    direction, s = rougher(tile.maps["tangent"]), strength(smooth, rough)
    return (-direction[..., 1], direction[..., 0]), smooth, smooth * (1 - s**2) + s**2


@pytest.mark.parametrize("tool", [painter, painter_asm, unreal, cycles, khronos])
def test_the_formulas_of_each_tool_give_the_axis_and_both_alphas_of_the_bake(tool, oblique):
    """Fails if the rougher axis is taken for the smoother, or an angle turns the other way."""
    (x, y), smooth, rough = tool(oblique)
    assert np.allclose(x * np.sin(TURN) - y * np.cos(TURN), 0.0, atol=1e-6)
    assert np.allclose(smooth, oblique.maps["roughness_along"][..., 0] ** 2)
    assert np.allclose(rough, oblique.maps["roughness_across"][..., 0] ** 2)


def test_green_is_up_for_all_swatches_but_the_one_for_directx(oblique):
    """Fails if the two files change places, or if U3M's green is down. The tile leans up."""
    found = swatch_pictures(oblique, Look())
    assert np.allclose(found["Normal_OpenGL"].pixels[0, 0], (0.5, 0.8, 0.9))
    assert np.allclose(found["Normal_DirectX"].pixels[0, 0], (0.5, 0.2, 0.9))
    u3m, _ = u3m_pictures(oblique, Look())
    assert np.allclose(u3m["normal"][0, 0], (0.5, 0.8, 0.9))
    # White is nearest to the viewer.
    assert np.argmax(u3m["displacement"][..., 0]) == np.argmax(oblique.maps["height"][..., 0])
    assert np.allclose(srgb_decode(u3m["basecolor"]), oblique.maps["base_color"], atol=1e-6)
