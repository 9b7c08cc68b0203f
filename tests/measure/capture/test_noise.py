"""The variance of a value, learnt from pairs of shots."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.measure.capture.noise import deviation, variance_model

VALUE = np.geomspace(0.1, 300, 400)


@pytest.mark.parametrize("truth", [(0.04, 0.0, 0.0), (0.04, 0.01, 0.0), (0.01, 0.002, 1e-4)])
def test_the_variance_of_the_mean_is_found_from_differences_of_halves(truth):
    rng = np.random.default_rng(0)
    variance = truth[0] + truth[1] * VALUE + truth[2] * VALUE**2
    # Each half has twice the variance of their mean.
    halves = np.diff(rng.standard_normal((400, 2)) * np.sqrt(2 * variance)[:, None], axis=1)[:, 0]
    found = deviation(VALUE, variance_model(VALUE, halves)) ** 2
    for part in np.array_split(np.arange(400), 4):
        assert found[part].mean() == pytest.approx(variance[part].mean(), rel=0.35)
    assert (found / variance).mean() == pytest.approx(1, abs=0.2)


def test_few_pairs_give_one_deviation():
    model = variance_model(np.array([1.0, 2.0]), np.array([0.2, -0.2]))
    np.testing.assert_allclose(deviation(np.array([1.0, 100.0]), model), 0.1)
