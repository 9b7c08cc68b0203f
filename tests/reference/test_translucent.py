"""Light through translucent cloth: as many bounces as it needs, and what a bound cuts off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.reference.render import RenderResult
from fabricusd.scene.light_kinds import DISK, DOME
from fabricusd.scene.scene import Camera, Light, Mesh, PreviewSurface
from fabricusd.schema import load
from tests.reference.scenes import above, cloth, grid, lambert, looking, picture, sphere

WHITE_DOME = Light(path="dome", kind=DOME, radiance=(1.0, 1.0, 1.0))
LAYERS = 4


def white(preset: str = "linen_plain"):
    """The preset's weave of white threads that conserve energy."""
    fabric = load(preset)
    threads = {n: replace(t, albedo=(1.0,) * 3) for n, t in fabric.threads.items()}
    return replace(fabric, model="conserving", threads=threads, back=None)


def layers(count: int = LAYERS) -> list[Mesh]:
    """Large sheets, one a centimetre below the other."""
    sheets = [grid(size=40.0) for _ in range(count)]
    for k, sheet in enumerate(sheets):
        sheet.points[:, 1] -= 0.01 * k
    return sheets


def mean(result: RenderResult) -> tuple[float, float]:
    """(mean of the picture, its standard error)."""
    beauty = result.layers["beauty"][..., :3].astype(float)
    error = np.sqrt(result.layers["variance"].astype(float).mean() / beauty.shape[0] ** 2)
    return float(beauty.mean()), float(error)


def furnace(preset: str = "linen_plain", **settings) -> RenderResult:
    """White cloth in layers in a white surrounding: whatever is not lost makes the picture 1."""
    return picture(
        layers(), [cloth(white(preset))], [WHITE_DOME], above(), size=32, spp=64, level="far",
        **settings,
    )  # fmt: skip


def test_layers_of_white_cloth_lose_no_light_at_default_settings():
    result = furnace()
    value, error = mean(result)
    assert abs(value - 1.0) < 4 * error + 0.005
    assert result.cut < 1e-3
    assert result.metadata["fabricusd:cut"] == result.cut
    assert not any("of its light" in note for note in result.notes)


def test_a_low_bound_says_how_much_light_it_cut_off():
    """In a white surrounding, what the picture lacks is what the run says that it lost."""
    result = furnace("polyester_satin_charmeuse", max_translucent=2)
    value, error = mean(result)
    assert result.cut > 0.05
    assert abs((1.0 - value) - result.cut) < 4 * error + 0.005
    # Where cloth has gaps, shadow rays bring some of the light of the paths that were cut off.
    result = furnace(max_translucent=2)
    assert 0.8 * result.cut < 1.0 - mean(result)[0] < result.cut
    assert any(f"lost up to {100 * result.cut:.2g} % of its light" in n for n in result.notes)


def test_bounces_at_cloth_do_not_use_up_those_at_other_surfaces():
    """A white floor below two layers of cloth is as bright with one bounce as with many."""
    sheets = layers(3)
    sheets[2].material[:] = 1
    materials = [cloth(white()), lambert(1.0)]
    settings = {"size": 32, "spp": 64, "level": "far", "max_bounces": 40}
    full, error = mean(picture(sheets, materials, [WHITE_DOME], above(), **settings))
    assert abs(full - 1.0) < 4 * error + 0.005


def test_no_bounces_means_none_at_cloth_either():
    ended = furnace(max_bounces=0)
    assert ended.metadata["fabricusd:maxTranslucent"] == 0
    assert ended.cut > 0.1


def test_opaque_surfaces_say_what_they_lose_too():
    bowl = grid(lambda x, z: 1.5 * (x**2 + z**2), cells=24)
    result = picture([bowl], [lambert(0.9)], [WHITE_DOME], above(width=0.9), spp=64, max_bounces=1)
    more = picture([bowl], [lambert(0.9)], [WHITE_DOME], above(width=0.9), spp=64, max_bounces=60)
    missing = mean(more)[0] - mean(result)[0]
    assert more.cut < 1e-3
    assert result.cut > 0.01
    # In a bowl the light that is cut off would have come from surfaces, which are not quite white.
    assert 0.5 * result.cut < missing < result.cut


def test_a_negative_bound_is_refused_in_one_line():
    with pytest.raises(Exception, match="max_translucent is -1; it must be a whole number from 0"):
        furnace(max_translucent=-1)


SHEETS = {
    "diffuse": PreviewSurface(
        diffuse=(0.3, 0.5, 0.2), transmission=(0.7, 0.5, 0.8), ior=1.0, roughness=1.0
    ),
    "glossy": PreviewSurface(
        diffuse=(0.3, 0.3, 0.3), transmission=(0.4, 0.2, 0.1), ior=1.5, roughness=0.3
    ),
}


def seen_from(eye: tuple[float, float, float]) -> Camera:
    return Camera(frame=looking(eye, up=(1.0, 0.0, 0.0)), orthographic=True, aperture=(0.2, 0.2))


def test_a_white_sheet_keeps_all_light_in_a_white_surrounding():
    for eye in ((0.0, 2.0, 0.0), (0.0, -2.0, 0.0), (1.5, 1.0, 0.0)):
        made = picture([grid()], [SHEETS["diffuse"]], [WHITE_DOME], seen_from(eye), spp=64)
        assert np.allclose(made.layers["beauty"][..., :3], 1.0, atol=0.05)
        assert np.allclose(made.layers["beauty"][..., :3].mean(axis=(0, 1)), 1.0, atol=0.003)


@pytest.mark.parametrize("name", SHEETS)
def test_estimators_agree_on_a_sheet_lit_from_behind(name):
    lamp = Light(
        path="lamp", kind=DISK, radius=0.5, radiance=(3.0, 2.0, 1.0),
        frame=looking((0.0, -1.0, 0.0), up=(1.0, 0.0, 0.0)),
    )  # fmt: skip
    found = {}
    for estimator in ("mis", "light", "surface", "uniform"):
        made = picture(
            [grid()], [SHEETS[name]], [lamp], seen_from((0.0, 2.0, 0.0)), size=32, spp=256,
            estimator=estimator,
        )  # fmt: skip
        value = made.layers["beauty"][..., :3].mean(axis=(0, 1))
        error = np.sqrt(made.layers["variance"].mean(axis=(0, 1))) / 32
        found[estimator] = value, error
    value, error = found["mis"]
    assert value.min() > 0.01
    for other, off in found.values():
        assert np.all(np.abs(other - value) < 4.5 * np.hypot(error, off) + 1e-5)


def test_a_sphere_of_thin_sheet_glows_as_much_as_its_walls_let_through():
    """Inside a sphere whose wall transmits t and reflects r of all light, from a white surrounding:
    the wall is 1 bright only if r + t is 1."""
    half = PreviewSurface(diffuse=(0.25,) * 3, transmission=(0.25,) * 3, ior=1.0, roughness=1.0)
    inside = Camera(frame=looking((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), aperture=(0.02, 0.02))
    made = picture([sphere()], [half], [WHITE_DOME], inside, size=32, spp=64, max_translucent=64)
    # L = r L + t inside a closed sphere.
    value, error = mean(made)
    assert abs(value - 0.25 / 0.75) < 4.5 * error + 2e-3
