"""Where formulas fail: each case goes there, the printed formula fails, ours does not."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.chart import stability

CASES = {make.__name__: make for make in stability.CASES}

FAILS = {
    "mirror_at_grazing": lambda c: c.published.max() > 1e4 * c.ours.max(),
    "along_the_thread": lambda c: np.isnan(c.published).any(),
    "wide_lobes": lambda c: c.published[-1] < 0.5,
    "white_furnace": lambda c: c.published.max() > 0.95 > 1.5 * c.ours.max(),
    "steep_curves": lambda c: np.isinf(c.published).any(),
    "far_uv": lambda c: c.published[14] > 1e-4,
    "middle_distance": lambda c: c.published[-1] > 1.0,
    "growing_energy": lambda c: c.published[-1] > 100.0 > c.ours[-1],
    "below_the_cloth": lambda c: not np.isfinite(c.published).all(),
    "upright_threads": lambda c: c.published[-1] > 1000.0,
    "light_at_the_surface": lambda c: c.published[0] > 50 * c.ours.max(),
}
WITHIN = {
    "mirror_at_grazing": 2.0,
    "along_the_thread": 180.0,
    "wide_lobes": 1.001,
    "white_furnace": 1.0,
    "steep_curves": 3.0,
    "far_uv": 1e-3,
    "middle_distance": 0.6,
    "growing_energy": 1.0,
    "below_the_cloth": 0.01,
    "upright_threads": 12.0,
    # A ball of radius r cannot light more than a sky of its radiance: 1/r^2.
    "light_at_the_surface": 1.05e4 * 1.5,
}


@pytest.mark.parametrize("name", CASES)
def test_the_printed_formula_fails_there_and_ours_stays_sound(name):
    case = CASES[name]()
    assert FAILS[name](case), case.published
    assert np.isfinite(case.ours).all()
    assert np.abs(case.ours).max() <= WITHIN[name]


def test_every_lobe_keeps_its_area():
    case = stability.wide_lobes()
    assert np.abs(case.ours - 1.0).max() < 1e-3
