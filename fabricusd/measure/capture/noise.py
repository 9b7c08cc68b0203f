"""How uncertain each value is, learnt from pairs of shots: nothing is assumed of the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Floats = NDArray[np.float64]

FEWEST = 12
"""Pairs below which a model of the variance is not worth fitting."""
ROUNDS = 6


def variance_model(value: Floats, halves: Floats) -> Floats:
    """(3,) coefficients a, b, c >= 0 of the variance of a mean, a + b q + c q^2.

    value : (n,) means q of two halves of the shots; halves : (n,) their differences

    A half's difference has four times the variance of the mean. Squares of normal numbers are
    weighted by the inverse square of what is expected of them, in turns. Raises nothing: with too
    few pairs, one constant is returned.
    """
    square = 0.25 * halves**2
    if len(value) < FEWEST:
        return np.array([max(float(square.mean()), 0.0), 0.0, 0.0])
    q = np.maximum(value, 0.0)
    columns = np.stack([np.ones_like(q), q, q * q], axis=1)
    scale = np.maximum(columns.mean(axis=0), 1e-300)
    found = np.array([float(square.mean()), 0.0, 0.0])
    for _ in range(ROUNDS):
        expected = np.maximum(columns @ found, 1e-3 * square.mean() + 1e-300)
        found, _ = nnls(columns / scale / expected[:, None], square / expected)
        found = found / scale
    return np.asarray(found, np.float64)


def deviation(value: Floats, model: Floats) -> Floats:
    """(n,) standard deviations by a model of `variance_model`."""
    q = np.maximum(value, 0.0)
    return np.asarray(np.sqrt(model[0] + model[1] * q + model[2] * q * q))
