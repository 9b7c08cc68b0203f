"""The figures for two pictures, against values known beforehand."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd import FabricError
from fabricusd.quality.colors import delta_e_2000
from fabricusd.quality.pictures import difference, flip_map, heat


@pytest.fixture
def noise() -> np.ndarray:
    return np.random.default_rng(3).random((48, 64, 3)).astype(np.float32)


def test_equal_pictures_differ_by_nothing(noise):
    found = difference(noise, noise)
    assert (found.rmse, found.relative_mse, found.flip, found.delta_e_mean) == (0, 0, 0, 0)


def test_rmse_and_relative_mse_of_a_constant_offset():
    b = np.full((8, 8, 3), 0.5, np.float32)
    found = difference(b + np.float32(0.1), b)
    assert found.rmse == pytest.approx(0.1, rel=1e-6)
    assert found.relative_mse == pytest.approx(0.01 / 0.26, rel=1e-6)


def test_delta_e_of_grey_follows_lightness():
    """Neutral colours differ in L* alone, weighted by 1 + .015 (L-50)^2/sqrt(20 + (L-50)^2)."""
    a, b = np.full((1, 1, 3), 0.2, np.float32), np.full((1, 1, 3), 0.25, np.float32)
    la, lb = (116 * y ** (1 / 3) - 16 for y in (0.2, 0.25))
    middle = ((la + lb) / 2 - 50) ** 2
    expected = (lb - la) / (1 + 0.015 * middle / np.sqrt(20 + middle))
    assert delta_e_2000(a, b)[0, 0] == pytest.approx(expected, rel=1e-3)


def test_flip_grows_with_the_difference(noise):
    means = [flip_map(noise * s, noise, high_range=False).mean() for s in (0.99, 0.9, 0.5)]
    assert 0 < means[0] < means[1] < means[2] < 1


def test_what_is_not_finite_is_counted_and_left_out(noise):
    spoilt = noise.copy()
    spoilt[3, 4, 1] = np.nan
    spoilt[5, 6, 0] = np.inf
    found = difference(spoilt, noise)
    assert found.not_finite == 2
    assert found.rmse == 0


def test_pictures_of_two_sizes_are_refused(noise):
    with pytest.raises(FabricError, match="48 x 64 x 3 and 48 x 63 x 3"):
        difference(noise, noise[:, :-1])


def test_pictures_without_a_finite_pixel_are_refused(noise):
    with pytest.raises(FabricError, match="no pixel that is finite"):
        difference(noise * np.nan, noise)


def test_the_map_runs_from_black_to_white():
    colors = heat(np.array([[0.0, 0.5, 1.0]]))
    assert colors[0, 0].tolist() == [0, 0, 0]
    assert colors[0, 2].tolist() == [255, 255, 255]
