"""The statistical tests accept what is true and bite on what is not."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd import FabricError
from fabricusd.quality.statistics import chi_squared, z_test


def noisy(rng, truth, variance):
    return truth + rng.normal(size=truth.shape) * np.sqrt(variance)


def test_true_pairs_fail_as_often_as_the_significance_says():
    rng = np.random.default_rng(7)
    truth, variance = rng.random((32, 32, 3)), np.full((32, 32, 3), 1e-4)
    passes = [
        z_test(noisy(rng, truth, variance), variance, noisy(rng, truth, variance), variance, 0.1)[0]
        for _ in range(400)
    ]
    # Binomial with mean 40 of 400 failures: 20 to 60 is 3.3 standard deviations.
    assert 20 <= passes.count(False) <= 60


def test_one_wrong_pixel_fails_the_picture():
    rng = np.random.default_rng(8)
    truth, variance = rng.random((64, 64)), np.full((64, 64), 1e-4)
    wrong = noisy(rng, truth, variance)
    wrong[10, 10] += 0.1
    assert not z_test(wrong, variance, noisy(rng, truth, variance), variance)[0]


def test_pixels_without_noise_must_agree():
    flat, none = np.ones((4, 4)), np.zeros((4, 4))
    assert z_test(flat, none, flat, none)[0]
    assert not z_test(flat * 1.01, none, flat, none)[0]


def test_what_is_not_finite_is_refused():
    flat = np.ones((2, 2))
    with pytest.raises(FabricError, match="not finite"):
        z_test(flat * np.nan, flat, flat, flat)


def test_chi_squared_accepts_a_fair_die_as_often_as_it_should():
    rng = np.random.default_rng(9)
    values = [
        chi_squared(rng.multinomial(6000, np.full(60, 1 / 60)), np.full(60, 100.0))[1]
        for _ in range(500)
    ]
    # p-values of the truth are uniform: 50 of 500 below 0.1, 3.3 standard deviations either way.
    assert 28 <= sum(p < 0.1 for p in values) <= 72


def test_chi_squared_bites_on_a_five_percent_error():
    rng = np.random.default_rng(10)
    loaded = np.full(60, 1 / 60)
    loaded[:30] *= 1.05
    counts = rng.multinomial(200_000, loaded / loaded.sum())
    assert chi_squared(counts, np.full(60, 200_000 / 60))[1] < 1e-6


def test_a_sample_where_the_density_is_zero_is_caught():
    assert chi_squared(np.array([100, 100, 1]), np.array([100.0, 100.0, 0.0]))[1] == 0
