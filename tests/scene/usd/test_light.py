"""UsdLux lights: what they give on a plane, and what is said of those that make no sense."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdUtils

from fabricusd.images.files import write_exr, write_png
from fabricusd.reference.lights.row import AREA, P, X, Y, Z
from fabricusd.reference.lights.table import build_lights
from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.scene import Camera, Light
from tests.reference.scenes import above, grid, lambert, looking, picture
from tests.reference.stages import new_stage, read, square

DOWN = ((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 1, 0, 1))
"""A frame one unit up that looks down."""


def light(stage: Usd.Stage, kind: str, *rows: tuple[float, ...], **inputs: object) -> Usd.Prim:
    """A light at /light that shines down, with rows of `DOWN` replaced by their numbers."""
    prim = stage.DefinePrim("/light", kind)
    matrix = [list(row) for row in DOWN]
    for number, *row in rows:
        matrix[int(number)] = list(row)
    UsdGeom.Xformable(prim).AddTransformOp().Set(Gf.Matrix4d(matrix))
    for name, value in inputs.items():
        prim.GetAttribute(f"inputs:{name}").Set(value)
    return prim


def irradiance(scene) -> float:
    """Straight below, on a plane at the origin."""
    r = picture([grid()], [lambert(math.pi * 0.25)], scene.lights, above(width=0.002), spp=64)
    return float(r.layers["beauty"][..., 0].mean()) * 4


def of_rect(width: float, height: float) -> float:
    """[Howell] of a rectangle one unit above the point, radiance 1."""
    a, b = width / 2, height / 2
    return 2 * (
        a / math.hypot(1, a) * math.atan(b / math.hypot(1, a))
        + b / math.hypot(1, b) * math.atan(a / math.hypot(1, b))
    )


LIT = {
    # name: (kind, rows of the frame, inputs, irradiance)
    "a rect, normalised and scaled along x": (
        "RectLight", [(0, 2, 0, 0, 0)], {"height": 0.6, "normalize": True},
        of_rect(2, 0.6) / 1.2,
    ),
    "a rect without thickness": ("RectLight", [(2, 0, 0, 0, 0)], {"height": 0.6}, of_rect(1, 0.6)),
    "a rect in a sheared frame": (
        "RectLight", [(2, 0.5, 1, 0, 0)], {"height": 0.6}, of_rect(1, 0.6),
    ),
    "a rect that is mirrored": ("RectLight", [(0, -1, 0, 0, 0)], {}, of_rect(1, 1)),
    "a sphere without radius, normalised": (
        "SphereLight", [(3, 0, 2, 0, 1)], {"radius": 0.0, "normalize": True}, 1 / 16,
    ),
    "a sun wider than half the sky, normalised": (
        "DistantLight", [], {"angle": 300.0, "intensity": 1.0, "normalize": True}, 1 / 1.75,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LIT)
def test_a_light_gives_what_usdlux_says(tmp_path, name):
    kind, rows, inputs, expected = LIT[name]
    stage = new_stage(tmp_path)
    light(stage, kind, *rows, **inputs)
    assert irradiance(read(stage)) == pytest.approx(expected, rel=0.01)


def test_names_from_before_the_prefix_are_read(tmp_path):
    stage = new_stage(tmp_path)
    prim = light(stage, "RectLight")
    for name, value in (("intensity", 3.0), ("exposure", 1.0), ("width", 0.5)):
        prim.CreateAttribute(name, Sdf.ValueTypeNames.Float).Set(value)
    [found] = read(stage).lights
    assert found.radiance == pytest.approx((6, 6, 6))
    assert found.width == 0.5


def point_hint(prim):
    UsdLux.SphereLight(prim).CreateTreatAsPointAttr(True)


def test_a_light_treated_as_a_point_is_as_bright_as_its_sphere(tmp_path):
    stage = new_stage(tmp_path)
    point_hint(light(stage, "SphereLight", (3, 0, 2, 0, 1)))
    assert irradiance(read(stage)) == pytest.approx(math.pi * 0.25 / 4, rel=0.01)


def test_a_cylinder_lies_along_x(tmp_path):
    stage = new_stage(tmp_path)
    light(stage, "CylinderLight", length=3.0, radius=0.1)
    table, _ = build_lights(read(stage).lights, np.zeros(3))
    assert table[0, X : X + 3] == pytest.approx([1.5, 0, 0])
    assert table[0, AREA] == pytest.approx(2 * math.pi * 0.1 * 3)


def test_a_rect_shines_along_its_normal(tmp_path):
    stage = new_stage(tmp_path)
    light(stage, "RectLight", (2, 0.5, 1, 0, 0))
    table, _ = build_lights(read(stage).lights, np.zeros(3))
    assert table[0, Z : Z + 3] == pytest.approx([0, -1, 0])
    assert table[0, P : P + 3] == pytest.approx([0, 1, 0])
    assert table[0, Y : Y + 3] == pytest.approx([0, 0, -0.5])


def focus(prim):
    UsdLux.ShapingAPI.Apply(prim).CreateShapingFocusAttr(2.0)


def no_shadow(prim):
    UsdLux.ShadowAPI.Apply(prim).CreateShadowEnableAttr(False)


def linked(prim):
    UsdLux.LightAPI(prim).GetLightLinkCollectionAPI().ExcludePath("/square")


def filtered(prim):
    prim.GetRelationship("light:filters").SetTargets(["/filter"])


def mistyped(prim):
    prim.GetAttribute("inputs:color").Clear()
    prim.CreateAttribute("color", Sdf.ValueTypeNames.Float).Set(1.0)


FAULTS = {
    # name: (kind, inputs, change, words, whether it is rendered)
    "no width": ("RectLight", {"width": 0.0}, None, "has width 0", False),
    "a radius that is no number": ("SphereLight", {"radius": math.nan}, None, "radius nan", False),
    "exposure beyond all numbers": ("RectLight", {"exposure": 2000.0}, None, "not finite", False),
    "a temperature that is no number": (
        "RectLight", {"enableColorTemperature": True, "colorTemperature": math.nan}, None,
        "not finite", False,
    ),
    "a temperature out of range": (
        "RectLight", {"enableColorTemperature": True, "colorTemperature": 20000.0}, None,
        "has colorTemperature 20000; 10000 is taken", True,
    ),
    "radiance beyond squares of 32 bits": (
        "RectLight", {"intensity": 1e30}, None, "has a radiance of 1e+30", False,
    ),
    "a width beyond areas of 32 bits": (
        "RectLight", {"width": 1e30}, None, "reaches beyond 1e+15 m", False,
    ),
    "negative intensity": ("RectLight", {"intensity": -1.0}, None, "negative intensity", True),
    "a colour of one number": ("RectLight", {}, mistyped, "has color '1.0'", True),
    "a diffuse multiplier": ("RectLight", {"diffuse": 0.5}, None, "diffuse multiplier", True),
    "a specular multiplier": ("DiskLight", {"specular": 0.0}, None, "specular multiplier", True),
    "a texture": ("RectLight", {"texture:file": Sdf.AssetPath("a.png")}, None, "texture", True),
    "a focus": ("DiskLight", {}, focus, "focus", True),
    "no shadows": ("DiskLight", {}, no_shadow, "asks for no shadows", True),
    "a link": ("DiskLight", {}, linked, "lightLink", True),
    "filters": ("DiskLight", {}, filtered, "filters", True),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_what_a_light_asks_for_in_vain_is_one_line(tmp_path, name):
    kind, inputs, change, words, rendered = FAULTS[name]
    stage = new_stage(tmp_path)
    square(stage)
    prim = light(stage, kind, **inputs)
    if change:
        change(prim)
    scene = read(stage)
    matching = [note for note in scene.notes if note.startswith("/light") and words in note]
    assert len(matching) == 1, scene.notes
    assert len(scene.lights) == rendered
    assert all(np.isfinite(found.radiance).all() for found in scene.lights)


UNEVEN = {
    "a sphere": ("SphereLight", (0, 3, 0, 0, 0), True),
    "a cylinder along its axis": ("CylinderLight", (0, 3, 0, 0, 0), False),
    "a cylinder across it": ("CylinderLight", (1, 0, 0, -3, 0), True),
}


@pytest.mark.parametrize("name", UNEVEN)
def test_a_light_that_is_not_round_any_more_is_noted(tmp_path, name):
    kind, row, noted = UNEVEN[name]
    stage = new_stage(tmp_path)
    light(stage, kind, row)
    assert any("unevenly" in note for note in read(stage).notes) == noted


@pytest.mark.parametrize("kind", ["RectLight", "DiskLight", "CylinderLight"])
def test_a_light_that_is_scaled_to_nothing_is_noted(tmp_path, kind):
    stage = new_stage(tmp_path)
    light(stage, kind, (0, 0, 0, 0, 0), normalize=True)
    scene = read(stage)
    assert scene.lights == []
    assert "/light has a scale of 0, left out" in scene.notes


def test_a_mesh_that_shines_is_noted_and_rendered(tmp_path):
    stage = new_stage(tmp_path)
    UsdLux.MeshLightAPI.Apply(square(stage).GetPrim())
    scene = read(stage)
    assert len(scene.meshes) == 1
    assert [n for n in scene.notes if n.startswith("/square is a light as well")]


def test_an_infinite_sun_stays_the_brightest_of_a_sky(tmp_path):
    sky = np.ones((2, 4, 3), np.float32)
    sky[0, 0], sky[0, 1], sky[0, 2], sky[1, 1] = np.inf, np.nan, 5.0, -1.0
    write_exr(tmp_path / "sky.exr", {"beauty": sky}, {"beauty": ("R", "G", "B")}, {})
    stage = new_stage(tmp_path)
    stage.DefinePrim("/sky", "DomeLight").GetAttribute("inputs:texture:file").Set("sky.exr")
    scene = read(stage)
    picture = scene.lights[0].image[..., 0]
    assert picture.tolist() == [[5, 0, 5, 1], [1, 0, 1, 1]]
    assert any("6 values that are not finite" in note for note in scene.notes)
    assert any("3 negative values" in note for note in scene.notes)


def test_a_sky_is_found_inside_a_package(tmp_path):
    write_png(tmp_path / "sky ü.png", np.full((2, 4, 3), 188, np.uint8))
    stage = new_stage(tmp_path)
    stage.DefinePrim("/sky", "DomeLight").GetAttribute("inputs:texture:file").Set("./sky ü.png")
    stage.GetRootLayer().Save()
    package = str(tmp_path / "all in one.usdz")
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(stage.GetRootLayer().realPath), package)
    scene = read(Usd.Stage.Open(package))
    assert scene.lights[0].image.mean() == pytest.approx(0.503, abs=2e-3)


POLES = {
    # name: (kind, stage's up axis, pole axis, where the picture's top and middle point to)
    "a dome's pole is y on any stage": ("DomeLight", "Z", None, (0, 1, 0), (0, 0, 1)),
    "the stage's axis": ("DomeLight_1", "Z", "scene", (0, 0, 1), (0, -1, 0)),
    "y asked for": ("DomeLight_1", "Z", "Y", (0, 1, 0), (0, 0, 1)),
    "z asked for": ("DomeLight_1", "Y", "Z", (0, 0, 1), (0, -1, 0)),
}


@pytest.mark.parametrize("name", POLES)
def test_a_dome_has_its_pole_where_it_says(tmp_path, name):
    kind, up, axis, top, middle = POLES[name]
    stage = new_stage(tmp_path, up=up)
    prim = stage.DefinePrim("/sky", kind)
    if axis:
        prim.GetAttribute("poleAxis").Set(axis)
    frame = read(stage).lights[0].frame[:3, :3]
    assert frame @ [0, 1, 0] == pytest.approx(top)
    assert frame @ [0, 0, 1] == pytest.approx(middle)


def test_a_dome_lies_as_openexr_lays_out_latitude_and_longitude(tmp_path):
    # +z in the middle, +x a quarter of the width to the left of it, +y at the top.
    sky = np.zeros((4, 8, 3), np.float32)
    sky[..., 0] = np.arange(8)
    sky[..., 1] = np.arange(4)[:, None]
    light = Light(path="sky", kind=DOME, radiance=(1, 1, 1), image=sky)
    for way, column, row in (
        ((0, 0, 1), 3.5, 1.5), ((1, 0, 0), 1.5, 1.5), ((-1, 0, 0), 5.5, 1.5), ((0, 1, 0), None, 0),
        ((0, -1, 0), None, 3),
    ):  # fmt: skip
        camera = Camera(frame=looking((0, 0, 0), at=way), focal_length=1.0, aperture=(1e-4, 1e-4))
        seen = (
            picture([], [], [light], camera, size=2, spp=1).layers["beauty"][..., :2].mean((0, 1))
        )
        assert seen[1] == pytest.approx(row, abs=1e-3)
        assert column is None or seen[0] == pytest.approx(column, abs=1e-3)
