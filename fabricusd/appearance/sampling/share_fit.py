"""Find the shares of a sampler's lobes that minimise the variance, over a grid of views.

At every view, directions are drawn from each lobe in turn. From the law's value and the densities
of all lobes at these directions, a fixed-point iteration minimises the integral of f^2/p over the
shares of the mixture p, as in population Monte Carlo [Douc2007]. The better-known choice is to
share by the energy of each lobe, but the lobes overlap: on `conserving` velvet the cosine lobe does
most of the work of the stretches' lobes, and shares by energy left twice the variance.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import INLINE, cos, sin

ELEVATIONS, AZIMUTHS = 13, 16
"""Size of the grid of views at which the shares are measured: polar angles from 0 to 90 degrees and
azimuths over a full turn."""

VIEWS = ELEVATIONS * AZIMUTHS

STRATA = (5, 3)
"""Strata of the two uniform numbers for the directions drawn from a lobe at one view."""

DRAWS = STRATA[0] * STRATA[1]

ADAPTATIONS = 32
"""Number of fixed-point iterations."""

VALUE, EVEN, LOBES = 0, 1, 2
"""Columns of a direction's record: the value, the density of the uniform part, those of the
lobes."""


def noted(drawn: int, lobes: int) -> NDArray[np.float32]:
    """(views, draws, lobes + 2) empty records for the directions of `drawn` lobes out of
    `lobes`."""
    return np.zeros((VIEWS, drawn * DRAWS, LOBES + lobes), np.float32)


def best_shares(
    found: NDArray[np.float32], possible: NDArray[np.intp], uniform: float, least: float
) -> NDArray[np.float64]:
    """(views, lobes) shares, which sum to 1 - uniform at each view; 0 for lobes not in `possible`.

    found : records in the form of `noted`, with equally many draws from each possible lobe
    uniform : share of the uniform part
    least : share of the rest that is divided evenly among the lobes before the measured shares
        apply, to cover what the few directions of a lobe miss
    """
    all_lobes = np.zeros((len(found), found.shape[2] - LOBES))
    if not len(possible):
        return all_lobes
    value, even = found[:, :, VALUE], found[:, :, EVEN]
    lobes = np.ascontiguousarray(found[:, :, LOBES + possible])
    drawn_by = lobes.mean(axis=2)
    weight = np.divide(value * value, drawn_by, out=np.zeros_like(value), where=drawn_by > 1e-9)
    # The scale of a view cancels; without it, squares of dim views would underflow in float32.
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
    """Direction of one of the VIEWS, stopping short of 90 degrees, where nothing is seen."""
    e, a = view // AZIMUTHS, view % AZIMUTHS
    theta = R(0.5 * math.pi) * min(R(e) / R(ELEVATIONS - 1), R(0.99))
    phi = R(2 * math.pi / AZIMUTHS) * R(a)
    return sin(R, theta) * cos(R, phi), sin(R, theta) * sin(R, phi), cos(R, theta)


@njit(**INLINE)
def stratum(R, m):
    """The centre of one of the DRAWS strata of two numbers in [0, 1)."""
    u1 = (R(m % STRATA[0]) + R(0.5)) / R(STRATA[0])
    u2 = (R(m // STRATA[0]) + R(0.5)) / R(STRATA[1])
    return u1, u2
