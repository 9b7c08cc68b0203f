"""Tubes: what has a geometry, that sections leave each other room, that rays come back in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.centre import RINGS, centre_line
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.errors import FabricError
from fabricusd.fabric import DEGREE, TangentCurve, Weave
from fabricusd.geometry import tubes
from fabricusd.geometry.rays import NOTHING, blocked, nearest
from fabricusd.schema import load, published_names

REFUSED = {
    "polyester_satin_charmeuse_back": "pass through one another",
}


@pytest.mark.parametrize("name", sorted(set(published_names()) - set(REFUSED)))
def test_presets_have_a_geometry(name: str) -> None:
    fabric = load(name)
    cloth = tubes(fabric)
    assert cloth.repeat.reach == (0.8 if name == "rayon_shantung" else 1.0)
    assert (cloth.flatness > 0.04).all()
    assert (cloth.flatness <= 1.001).all()
    widths = [ln.half_width for ln in cloth.repeat.lines]
    pitch = {WARP: fabric.warp.pitch, WEFT: fabric.weft.pitch}
    stated = [0.5 * coverage(fabric).width[ln.which] * pitch[ln.which] for ln in cloth.repeat.lines]
    np.testing.assert_allclose(widths, stated, rtol=2e-3)


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_geometry_says_why(name: str) -> None:
    with pytest.raises(FabricError, match=REFUSED[name]):
        tubes(load(name))


def test_large_repeats_are_refused_before_the_work() -> None:
    weave = Weave(np.indices((128, 128)).sum(axis=0) % 2 == 0)
    with pytest.raises(FabricError, match="repeats after 128 by 128 threads"):
        tubes(replace(load("linen_plain"), weave=weave))


@pytest.mark.parametrize("squash", [0.0, 1.1, np.nan])
def test_squash_out_of_range_is_refused(squash: float) -> None:
    with pytest.raises(FabricError, match="squash"):
        tubes(load("linen_plain"), squash=squash)


def test_hidden_runs_go_on_from_the_seen_ones_without_a_kink() -> None:
    curve = TangentCurve(angles=(-30 * DEGREE, 30 * DEGREE), positions=(0.0, 1.0))
    on_top = np.array([True, True, False, True, False])
    z, psi = centre_line(curve, on_top, 1e-3, 0.4)
    s = (np.arange(len(z)) + 0.5) / RINGS * 1e-3
    slope = np.gradient(z, s)[1:-1]
    inside = np.abs(np.diff(psi, 2)) < 2 * DEGREE
    np.testing.assert_allclose(slope[inside], -np.tan(psi[1:-1])[inside], atol=0.03)


def test_rays_are_hit_from_outside_and_come_back_into_the_repeat() -> None:
    cloth = tubes(load("linen_plain"))
    rng = np.random.default_rng(0)
    n = 4000
    origin = np.column_stack((rng.random((n, 2)) * cloth.patch.size, np.full(n, cloth.patch.top)))
    down = np.tile((0.0, 0.0, -1.0), (n, 1))
    hits = nearest(cloth, origin, down)
    on = hits.primitive != NOTHING
    assert on.mean() == pytest.approx(0.66, abs=0.02)
    assert not hits.back.any()
    moved = nearest(
        cloth, origin + np.array((7.0, -9.0, 0.0)) * np.append(cloth.patch.size, 0.0), down
    )
    assert (moved.primitive == hits.primitive).mean() > 0.99
    np.testing.assert_array_equal(blocked(cloth, origin, down), on)
    # From the axis of a thread every ray hits the tube from inside.
    inside = np.tile(cloth.mesh.rings.centre[len(cloth.mesh.rings.centre) // 8], (50, 1))
    w = rng.normal(size=(50, 3))
    w /= np.linalg.norm(w, axis=1)[:, None]
    assert nearest(cloth, inside, w).back.mean() > 0.9


def test_a_grazing_ray_crosses_as_many_repeats_as_it_takes() -> None:
    cloth = tubes(load("linen_plain"))
    thick = cloth.patch.top - cloth.patch.bottom
    steep = np.array([[np.cos(1e-3), 0.0, -np.sin(1e-3)]])
    start = np.array([[1e-4, 2e-4, cloth.patch.top - 1e-9]])
    # It enters 1 m of cloth for each mm of depth, and meets a thread's crown on the way.
    assert nearest(cloth, start, steep).primitive[0] != NOTHING
    assert thick < 1e-3
