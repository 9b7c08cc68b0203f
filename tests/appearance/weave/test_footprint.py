"""Level auto: probabilities that sum to 1, and change smoothly with the size of the pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.appearance.levels import FAR, LEVELS, THREAD, WEAVE
from fabricusd.appearance.weave.footprint import (
    Limits,
    extent_of,
    level_weights,
    pick_level,
    weights,
)
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from tests.appearance.presets import PRESETS
from tests.strategies import fabrics

LINEN = PRESETS["linen_plain"]

SEEN = {
    # extent of a pixel in threads (a repeat is 2 x 2) -> level
    "many repeats in a pixel": ((20, 20), FAR),
    "two repeats in a pixel": ((4, 4), FAR),
    "a repeat narrower than two pixels, which no picture can show": ((1.2, 1.2), FAR),
    "a thread is two pixels wide": ((0.5, 0.5), THREAD),
    "a thread is eight pixels wide": ((0.125, 0.125), THREAD),
    "no extent at all": ((0, 0), THREAD),
    "grazing: a line of pixels over every repeat": ((0.05, 300), WEAVE),
    "grazing, and all threads narrower than the pixel is long": ((0.5, 2.1), WEAVE),
    "the horizon": ((math.inf, math.inf), FAR),
}


@pytest.mark.parametrize(("extent", "level"), SEEN.values(), ids=SEEN.keys())
def test_a_pixel_sees_the_level_of_its_size(extent: tuple[float, float], level: int) -> None:
    expected = np.eye(len(LEVELS))[level]
    np.testing.assert_array_equal(weights(LINEN, [extent])[0], expected)


@given(fabrics(back=False), st.floats(0, 1e6), st.floats(0, 1e6))
def test_weights_are_probabilities(fabric: Fabric, u: float, v: float) -> None:
    w = weights(fabric, [[u, v]])[0]
    assert (w >= 0).all()
    assert w.sum() == pytest.approx(1.0, abs=1e-15)


@given(st.floats(-10, 10), st.floats(-10, 10))
def test_weights_change_smoothly_with_the_extent(a: float, b: float) -> None:
    step = 1e-3  # of an octave
    extents = 2.0 ** (np.array([[a, b]]) + step * np.arange(50)[:, None])
    change = np.abs(np.diff(weights(LINEN, extents), axis=0))
    assert change.max() <= 1.52 * step


def test_far_comes_later_for_a_larger_repeat() -> None:
    assert weights(LINEN, [[0.8, 0.8]])[0, FAR] == pytest.approx(0.5)
    satin = PRESETS["polyester_satin_charmeuse"]
    assert weights(satin, [[0.8, 0.8]])[0, FAR] == 0
    assert weights(satin, [[2, 2]])[0, FAR] == pytest.approx(0.5)


@given(st.floats(-3, 5))
def test_picking_by_an_even_number_gives_the_weights_and_an_even_number_again(size: float) -> None:
    far, weave, thread = weights(LINEN, [[2.0**size, 2.0**size]])[0]
    numbers = (np.arange(2000) + 0.5) / 2000
    picked = np.array([pick_level(np.float64, far, weave, x) for x in numbers])
    for level, share in ((FAR, far), (WEAVE, weave), (THREAD, thread)):
        again = picked[picked[:, 0] == level, 1]
        assert abs(len(again) / 2000 - share) <= 1 / 2000
        if len(again) > 20:
            even = (np.arange(len(again)) + 0.5) / len(again)
            assert np.abs(np.sort(again) - even).max() < 2.0 / len(again)
            assert again.min() >= 0
            assert again.max() < 1


def test_levels_of_one_mean_never_make_the_picture_jump() -> None:
    # A pattern whose finer levels average to the coarser: means stay, whatever the mixture.
    satin = PRESETS["polyester_satin_charmeuse"]
    x = (np.arange(512) + 0.5) / 512
    weave = 1 + 0.5 * np.sign(x - 0.5)
    thread = weave * (1 + 0.3 * np.cos(2 * math.pi * 8 * x))
    means = np.array([1.0, weave.mean(), thread.mean()])
    extents = np.repeat(2.0 ** np.linspace(-5, 5, 200)[:, None], 2, axis=1)
    mixed = weights(satin, extents) @ means
    assert np.abs(np.diff(mixed)).max() < 1e-12
    # The twin: a level that is 5 % off shows as a ramp.
    assert np.ptp(weights(satin, extents) @ (means * [1, 1.05, 1])) > 0.04


def test_limits_that_are_never_reached_leave_level_thread_and_no_nan() -> None:
    never = Limits(repeats=math.inf, pixels=0.0, octaves=0.0)
    found = weights(LINEN, [[1.0, 1.0], [1e15, 1e15], [math.inf, math.inf]], never)
    assert np.isfinite(found).all()
    assert (found[:2, THREAD] == 1.0).all()


def test_rolling_the_camera_leaves_the_extent() -> None:
    across, down = np.array([[0.3, 0.1]]), np.array([[-0.2, 0.4]])
    c, s = math.cos(0.7), math.sin(0.7)
    turned = extent_of(c * across + s * down, -s * across + c * down)
    np.testing.assert_allclose(turned, extent_of(across, down))


def test_an_extent_that_is_not_a_number_is_refused_and_never_hidden() -> None:
    with pytest.raises(FabricError, match=r"has 1 of 2 rows .* first at 1"):
        weights(LINEN, [[1, 1], [math.nan, 1]])
    with pytest.raises(FabricError, match="negative"):
        weights(LINEN, [[-1, 1]])
    with pytest.raises(FabricError, match=r"must be \(n, 2\)"):
        weights(LINEN, [1, 1])
    for u, v in ((math.nan, 1.0), (1.0, math.nan)):
        assert np.isnan(level_weights(np.float64, 2.0, 2.0, 1.0, 1.0, u, v)).all()
