"""The shares of a sampler's lobes that leave the least variance, measured over a grid of views.

At every view, directions are drawn from each lobe in turn; with the law's value and all lobes'
densities there, the integral of f^2/p is lessened over the shares of the mixture p by its fixed
point, as mixtures are adapted in population Monte Carlo [Douc2007]. A lobe's own energy would be
the better known choice, but lobes overlap: on `conserving` velvet the cosine lobe does most of what
the stretches' are there for, and by energy twice the variance was left.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import INLINE, cos, sin

ELEVATIONS, AZIMUTHS = 13, 16
"""Views at which the shares are measured: inclination 0 to 90 degrees, azimuth all round."""

VIEWS = ELEVATIONS * AZIMUTHS

STRATA = (5, 3)
"""Directions drawn from a lobe at one view."""

DRAWS = STRATA[0] * STRATA[1]

ADAPTATIONS = 32
"""Rounds of the fixed point."""

VALUE, EVEN, LOBES = 0, 1, 2
"""What is noted of a direction: the value, the density of the uniform part, those of the lobes."""


def noted(drawn: int, lobes: int) -> NDArray[np.float32]:
    """(views, draws, lobes + 2) zeros for the directions of `drawn` lobes out of `lobes`."""
    return np.zeros((VIEWS, drawn * DRAWS, LOBES + lobes), np.float32)


def best_shares(
    found: NDArray[np.float32], possible: NDArray[np.intp], uniform: float, least: float
) -> NDArray[np.float64]:
    """(views, lobes) shares, which sum to 1 - uniform at each view; 0 of lobes not `possible`.

    found : as `noted` made it, the draws shared evenly by the possible lobes
    uniform : share of the uniform part
    least : share of the rest that the lobes divide evenly before the measured ones, for what the
        few directions of a lobe miss
    """
    all_lobes = np.zeros((len(found), found.shape[2] - LOBES))
    if not len(possible):
        return all_lobes
    value, even = found[:, :, VALUE], found[:, :, EVEN]
    lobes = np.ascontiguousarray(found[:, :, LOBES + possible])
    drawn_by = lobes.mean(axis=2)
    weight = np.divide(value * value, drawn_by, out=np.zeros_like(value), where=drawn_by > 1e-9)
    # A view's scale cancels, and squares of dim views would vanish in single precision.
    weight /= np.maximum(weight.max(axis=1, keepdims=True, initial=0.0), np.float32(1e-30))
    level = np.full(lobes.shape[::2], 1.0 / lobes.shape[2], np.float32)
    shares = level
    for _ in range(ADAPTATIONS):
        p = uniform * even + (1.0 - uniform) * (lobes @ shares[:, :, None])[:, :, 0]
        over = weight / np.maximum(p * p, np.float32(1e-30))
        part = shares * (over[:, None, :] @ lobes)[:, 0, :]
        total = part.sum(axis=1, keepdims=True)
        shares = np.where(total > 0, part / np.where(total > 0, total, 1.0), level)
    all_lobes[:, possible] = (1.0 - uniform) * ((1.0 - least) * shares + least * level)
    return all_lobes


@njit(**INLINE)
def grid_view(R, view):
    """Direction of one of the VIEWS, short of 90 degrees, where nothing is seen."""
    e, a = view // AZIMUTHS, view % AZIMUTHS
    theta = R(0.5 * math.pi) * min(R(e) / R(ELEVATIONS - 1), R(0.99))
    phi = R(2 * math.pi / AZIMUTHS) * R(a)
    return sin(R, theta) * cos(R, phi), sin(R, theta) * sin(R, phi), cos(R, theta)


@njit(**INLINE)
def stratum(R, m):
    """The middle of one of the DRAWS strata of two numbers in [0, 1)."""
    u1 = (R(m % STRATA[0]) + R(0.5)) / R(STRATA[0])
    u2 = (R(m // STRATA[0]) + R(0.5)) / R(STRATA[1])
    return u1, u2
