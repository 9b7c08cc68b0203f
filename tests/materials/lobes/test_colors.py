"""Residuals of colours."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.materials.lobes.colors import BEYOND_WHITE, Colors
from fabricusd.quality.colors import delta_e_2000

RNG = np.random.default_rng(2)
TARGET = RNG.uniform(0.02, 0.9, (300, 3))


def test_near_the_target_the_squares_are_those_of_delta_e():
    near = TARGET * RNG.uniform(0.97, 1.03, TARGET.shape)
    got, _ = Colors(TARGET).residuals(near)
    wanted = delta_e_2000(near, TARGET)
    assert np.sqrt((got**2).sum(axis=1)).mean() == pytest.approx(wanted.mean(), rel=0.15)


def test_the_derivatives_are_those_of_differences():
    colors = Colors(TARGET)
    values = RNG.uniform(0.001, 1.5, TARGET.shape)
    values = np.where(np.abs(values - 1.0) < 1e-3, 0.9, values)
    _, slopes = colors.residuals(values)
    for c in range(3):
        step = np.zeros(3)
        step[c] = 1e-6
        ahead, behind = (colors.residuals(values + s)[0] for s in (step, -step))
        assert slopes[:, :, c] == pytest.approx((ahead - behind) / 2e-6, rel=1e-3, abs=1e-2)


def test_beyond_white_a_residual_goes_on_more_slowly():
    got, _ = Colors(np.ones((1, 3))).residuals(np.full((1, 3), 1.5))
    lightness = 116.0 * np.cbrt(1.0 + 0.5 * BEYOND_WHITE) - 116.0
    scale = 1.0 + 0.015 * 50.0**2 / np.sqrt(20.0 + 50.0**2)
    assert got[0] == pytest.approx([lightness / scale, 0.0, 0.0], abs=1e-3)
