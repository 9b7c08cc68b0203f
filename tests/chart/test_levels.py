"""Level `auto` on a zoom from 20 threads a pixel to 50 pixels a thread, against exact means.

Without shadows: with them the levels' means are the same only about, see docs/shadowing.md.
"""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.chart.level_errors import Zoom, zoom
from fabricusd.schema import load

PIXELS_PER_THREAD = np.geomspace(0.05, 50.0, 31)
TO_LIGHT, TO_EYE = (0.48, 0.36, 0.8), (0.0, -0.28, 0.96)


@pytest.fixture(scope="module", params=["linen_plain", "polyester_satin_charmeuse"])
def steps(request) -> Zoom:
    return zoom(load(request.param), 1.0 / PIXELS_PER_THREAD, TO_LIGHT, TO_EYE, "none")


def test_auto_is_never_off_by_more_than_the_worse_of_the_levels_it_mixes(steps):
    mixed = np.where(steps.weights > 0, steps.errors, 0.0).max(axis=1)
    assert (steps.auto_errors <= mixed + 1e-9).all()


def test_far_away_and_close_by_auto_is_the_truth(steps):
    assert (steps.auto_errors[PIXELS_PER_THREAD >= 8.0] == 0.0).all()
    assert (steps.auto_errors[PIXELS_PER_THREAD <= 0.12] < 0.03).all()


def test_from_weave_to_far_nothing_jumps(steps):
    """What `far` takes away at each step is less than `weave` itself was off there."""
    change = np.diff(steps.weights[:, 0])
    shown = np.abs(change) * np.maximum(steps.errors[1:, 0], steps.errors[:-1, 0])
    assert shown.max() < 0.05


def test_a_level_too_coarse_for_the_view_is_told(steps):
    """The measure bites: `far` close by has lost all of the cloth's contrast."""
    assert steps.errors[-1, 0] > 0.5
    assert steps.errors[-1, 1] > 0.3
