"""Level `auto` on a zoom from 20 threads a pixel to 50 pixels a thread, against exact means.

Without shadows: with them the levels' means are the same only about, see docs/shadowing.md.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance.weave.footprint import weights
from fabricusd.chart.level_errors import LIGHTS, TO_EYE, WIDTHS, Zoom, coarsest, zoom
from fabricusd.fabric import even
from fabricusd.reference.choice import choose_limits, read_limits
from fabricusd.schema import load, published_names
from tests.appearance.presets import LINEN, often

PIXELS_PER_THREAD = 1.0 / WIDTHS
NAMES = ("linen_plain", "polyester_satin_charmeuse")
FABRICS = {name: even(load(name)) for name in NAMES}
LIGHT_NOISE = 0.1
"""Variance over mean^2 that the drawing of lights leaves to a sample, whatever the level."""


@pytest.fixture(scope="module", params=often(NAMES, LINEN))
def steps(request) -> list[Zoom]:
    return [zoom(FABRICS[request.param], WIDTHS, wi, TO_EYE, "none") for wi in LIGHTS]


def bounded(steps: list[Zoom], name: str, bound: float) -> list[Zoom]:
    limits, _ = choose_limits([name], bound)
    extents = np.stack((WIDTHS, WIDTHS), axis=1)
    return [replace(z, weights=weights(FABRICS[name], extents, limits)) for z in steps]


def name_of(request) -> str:
    return request.node.callspec.params["steps"]


def test_auto_is_never_off_by_more_than_the_worse_of_the_levels_it_mixes(steps):
    for z in steps:
        mixed = np.where(z.weights > 0, z.errors, 0.0).max(axis=1)
        assert (z.auto_errors <= mixed + 1e-9).all()


def test_far_away_and_close_by_auto_is_the_truth(steps):
    for z in steps:
        assert (z.auto_errors[PIXELS_PER_THREAD >= 2.1] == 0.0).all()
        assert (z.auto_errors[PIXELS_PER_THREAD <= 0.12] < 0.03).all()


def test_from_weave_to_far_nothing_jumps(steps):
    """What `far` takes away at each step is less than `weave` itself was off there."""
    for z in steps:
        change = np.diff(z.weights[:, 0])
        shown = np.abs(change) * np.maximum(z.errors[1:, 0], z.errors[:-1, 0])
        # .057 on satin.
        assert shown.max() < 0.06


def test_a_level_too_coarse_for_the_view_is_told(steps):
    """The measure bites: `far` close by has lost all of the cloth's contrast."""
    assert steps[0].errors[0, 0] > 0.5
    assert steps[0].errors[0, 1] > 0.3


@pytest.mark.parametrize("bound", [0.2, 0.1, 0.05, 0.02])
def test_with_a_bound_auto_keeps_it_at_every_step_and_costs_no_more_than_the_cheapest(
    steps, bound, request
):
    """Cost is that of equal noise: a ray costs the same at each level, a level's own values inside
    a pixel add to what the lights leave. A level meets the bound where it does so at every wider
    pixel too: one that is right because the pixel's width happens to be the repeat's is not."""
    taken = bounded(steps, name_of(request), bound)
    for z in taken:
        assert (z.auto_errors <= bound).all()
    cost = LIGHT_NOISE + np.mean([z.inside**2 for z in taken], axis=0)
    worst = np.max([z.errors for z in taken], axis=0)
    worst = np.maximum.accumulate(worst[::-1], axis=0)[::-1]
    cheapest = np.where(worst <= bound, cost, np.inf).min(axis=1)
    assert ((taken[0].weights * cost).sum(axis=1) <= 1.1 * cheapest).all()


@pytest.mark.parametrize("bound", [0.1, 0.05])
def test_with_a_bound_no_frame_differs_from_the_next_by_more_than_twice_the_bound(
    steps, bound, request
):
    """What a change of level shows, rms over the pixels, in one frame of the zoom."""
    seen = 0
    for z in bounded(steps, name_of(request), bound):
        change = np.diff(z.weights, axis=0)
        shown = np.sqrt(np.einsum("kl,klm,km->k", change, z.products[1:], change))
        assert shown.max() <= 2 * bound
        seen += int((shown > 0).sum())
    assert seen > 0


@pytest.mark.exhaustive
def test_the_shipped_limits_are_those_that_are_measured():
    name = "silk_shot"
    found = coarsest(even(load(name)), (0.1, 0.02))
    for level, limits in found.items():
        for bound, limit in limits:
            assert read_limits()[name][level][bound] == pytest.approx(limit, rel=1e-3)


def test_every_preset_has_limits_that_ask_more_of_a_smaller_bound():
    assert set(read_limits()) == set(published_names())
    for name in published_names():
        chosen = [choose_limits([name], bound)[0] for bound in (0.5, 0.2, 0.1, 0.05, 0.02)]
        assert [c.repeats for c in chosen] == sorted(c.repeats for c in chosen)
        assert [c.pixels for c in chosen] == sorted((c.pixels for c in chosen), reverse=True)


def test_cloth_that_is_no_preset_takes_the_limits_of_the_hardest():
    hardest, _ = choose_limits([""], 0.1)
    assert hardest.repeats == max(choose_limits([n], 0.1)[0].repeats for n in published_names())
    never, why = choose_limits([""], 1e-4)
    assert never.repeats == np.inf
    assert never.pixels == 0.0
    assert "far never, else thread" in why
