"""The z-test of pictures: chance is accepted as often as stated, a real difference is found."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd import FabricError
from fabricusd.quality.noise import noise_test

SHAPE = (30, 45, 3)  # no multiple of a block


def pair(rng, change=1.0):
    """Two noisy pictures with their variances; the first shows `change` times the second."""
    truth = 0.2 + rng.random(SHAPE)
    variance = np.full(SHAPE, 4e-4)
    a, b = (rng.normal(x, np.sqrt(variance)) for x in (change * truth, truth))
    return a, variance, b, variance


def test_pictures_of_the_same_are_called_different_as_often_as_the_significance_says():
    rng = np.random.default_rng(5)
    found = [noise_test(*pair(rng), 0.1).larger for _ in range(400)]
    # Binomial with mean 40 of 400: 20 to 60 is 3.3 standard deviations.
    assert 20 <= found.count(True) <= 60


def test_p_is_uniform_for_pictures_of_the_same():
    rng = np.random.default_rng(6)
    p = np.sort([noise_test(*pair(rng)).p for _ in range(400)])
    # Kolmogorov's bound at 0.001.
    assert np.abs(p - (np.arange(400) + 0.5) / 400).max() < 1.95 / np.sqrt(400)


def test_a_picture_five_per_cent_brighter_is_different():
    found = noise_test(*pair(np.random.default_rng(7), change=1.05))
    assert found.larger
    assert found.p < 1e-6


def test_a_difference_in_one_place_is_found_there():
    a, va, b, vb = pair(np.random.default_rng(8))
    a[20:24, 40:44] += 0.1
    found = noise_test(a, va, b, vb)
    assert found.larger
    assert found.pixel == (42, 22)


def test_a_difference_at_the_cut_border_is_found_inside_the_picture():
    a, va, b, vb = pair(np.random.default_rng(9))
    a[28:, 44:] += 0.5
    assert noise_test(a, va, b, vb).pixel == (44, 29)


def test_pixels_that_are_not_finite_do_not_count():
    a, va, b, vb = pair(np.random.default_rng(10))
    a[3, 4], vb[9, 9] = np.nan, np.inf
    a[9, 9] = 100.0
    assert not noise_test(a, va, b, vb).larger


def test_a_difference_without_noise_is_certain():
    flat, none = np.ones((8, 8, 3)), np.zeros((8, 8, 3))
    assert noise_test(flat, none, flat, none).p == 1.0
    found = noise_test(flat * 1.01, none, flat, none)
    assert found.larger
    assert found.p == 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a, v: (a[:-1], v), "must be equal"),
        (lambda a, v: (a * np.nan, v), "no pixel that is finite"),
        (lambda a, v: (a, v - 1.0), "must be at least 0"),
    ],
)
def test_arrays_that_cannot_be_tested_are_refused(change, words):
    a, va, b, vb = pair(np.random.default_rng(11))
    with pytest.raises(FabricError, match=words):
        noise_test(*change(a, va), b, vb)
