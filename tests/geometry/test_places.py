"""Tubes seen from above show the threads that the lookup finds there; lit shares are shares."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.coverage import GAP, coverage
from fabricusd.appearance.weave.lookup import lookup
from fabricusd.fabric import Fabric, even
from fabricusd.geometry import lit_share, seen, tubes
from fabricusd.schema import load

WOVEN = (
    "linen_plain", "polyester_satin_charmeuse", "rayon_shantung", "silk_crepe_de_chine",
    "silk_shot", "thread_wool_spun", "wool_flannel",
)  # fmt: skip


def places(fabric: Fabric, count: int = 20000) -> np.ndarray:
    rng = np.random.default_rng(5)
    return rng.random((count, 2)) * true_repeat(fabric)


def by_lookup(fabric: Fabric, uv: np.ndarray) -> np.ndarray:
    """(n, 2) set and number in the set at each place, as levels `weave` and `thread` see it."""
    which = lookup(fabric, uv).set.astype(int)
    cell = np.floor(uv).astype(int)
    number = np.where(which == WARP, cell[:, 0], np.where(which == WEFT, cell[:, 1], -1))
    return np.stack((which, number), axis=1)


@pytest.mark.parametrize("name", WOVEN)
def test_the_thread_seen_from_above_is_the_one_that_the_lookup_finds(name: str) -> None:
    fabric = even(load(name))
    uv = places(fabric)
    found = seen(tubes(fabric), uv)
    same = (np.stack((found.set, found.number), axis=1) == by_lookup(fabric, uv)).all(axis=1)
    assert same.mean() >= 0.98


@pytest.mark.parametrize("name", ["linen_plain", "rayon_shantung", "silk_shot", "wool_flannel"])
def test_uneven_threads_are_those_that_the_lookup_finds(name: str) -> None:
    fabric = load(name)
    cloth = tubes(fabric, threads=(10, 10))
    uv = np.random.default_rng(6).random((20000, 2)) * 8 + 1
    found, true = seen(cloth, uv), lookup(fabric, uv)
    same = (found.set == true.set) & (true.gap | (found.number == true.number))
    assert same.mean() >= 0.98
    # That the comparison can fail: even threads lie elsewhere.
    assert (found.set == lookup(even(fabric), uv).set).mean() < 0.98


def test_a_grid_turned_round_shows_other_threads() -> None:
    # That the comparison above can fail.
    fabric = load("polyester_satin_charmeuse")
    uv = places(fabric)
    found = seen(tubes(fabric), uv + np.array((1.0, 0.0)))
    assert (found.number == by_lookup(fabric, uv)[:, 1]).mean() < 0.5


def test_angle_and_place_across_are_those_of_the_curve() -> None:
    fabric = load("linen_plain")
    # Along the middle of end 0, which is on top of pick 0: from 25 degrees one way to the other.
    grid = fabric.weave.cells
    v = np.flatnonzero(grid[0])[0] + np.array([0.1, 0.5, 0.9])
    cloth = tubes(fabric)
    found = seen(cloth, np.stack((np.full(3, 0.5), v), axis=1))
    length = 2.0 - coverage(fabric).width[WEFT]
    # The crown of a section lies off its middle, out along the normal.
    high = cloth.lines.half_height[0] / fabric.weft.pitch
    middle = v - v[1] - high * np.sin(found.angle)
    np.testing.assert_allclose(np.degrees(found.angle), middle / length * 50, atol=0.1)
    np.testing.assert_allclose(found.across, 0.0, atol=0.02)
    beside = seen(cloth, np.array([[0.5 + 0.15, v[1]]]))
    # b of a warp thread points along -U.
    assert beside.across[0] == pytest.approx(-0.3 / coverage(fabric).width[WARP], abs=0.02)


def test_seen_is_periodic_in_the_repeat() -> None:
    fabric = load("silk_shot")
    cloth, uv = tubes(fabric), places(fabric, 500)
    here, there = seen(cloth, uv), seen(cloth, uv + np.array((200.0, -400.0)))
    assert (here.set == there.set).mean() > 0.995
    np.testing.assert_allclose(here.angle, there.angle, atol=1e-3)


def test_light_from_above_gets_everywhere_and_grazing_light_hardly_anywhere() -> None:
    fabric = load("linen_plain")
    cloth, uv = tubes(fabric), places(fabric, 400)
    e = np.radians([90.0, 45.0, 5.0])
    lights = np.stack((np.cos(e), 0 * e, np.sin(e)), axis=1)
    share = lit_share(cloth, uv, lights)
    gap = seen(cloth, uv).set == GAP
    assert np.isnan(share[:, gap]).all()
    mean = share[:, ~gap].mean(axis=1)
    assert mean[0] > 0.97
    assert mean[0] > mean[1] > mean[2]
    assert mean[2] < 0.5
