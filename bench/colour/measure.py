"""The colour of cloth by routes that share nothing with the solver of `fabricusd.dye`.

`by_quadrature` integrates `surface.evaluate`, the law that is rendered, over both hemispheres.
`by_tracing` renders a stack of layers in a uniform sky.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import qmc

from fabricusd.appearance import surface
from fabricusd.appearance.conserving.by_side import by_side

VIEW = math.radians(8.0)


def shares(fabric, logarithm: int = 15, seed: int = 1):
    """(2, 2, 3) R and T of one layer, for a view at 8 degrees and in diffuse light, per channel."""
    u = qmc.Sobol(4, seed=seed).random_base2(logarithm)
    phi = 2 * math.pi * u[:, 1]
    sine = np.sqrt(u[:, 0])
    diffuse = np.stack((sine * np.cos(phi), sine * np.sin(phi), np.sqrt(1 - u[:, 0])), axis=1)
    tilted = np.stack(
        (
            math.sin(VIEW) * np.cos(phi),
            math.sin(VIEW) * np.sin(phi),
            np.full(len(u), math.cos(VIEW)),
        ),
        axis=1,
    )
    # Light from everywhere above or below, drawn by the cosine.
    around, rise = 2 * math.pi * u[:, 3], np.sqrt(1 - u[:, 2])
    flat = np.sqrt(u[:, 2])
    above = np.stack((flat * np.cos(around), flat * np.sin(around), rise), axis=1)
    found = np.empty((2, 2, 3))
    for row, wo in enumerate((tilted, diffuse)):
        polar = np.arccos(wo[:, 2])
        gap = float(by_side(fabric, polar, phi).gap.mean())
        for side, sign in enumerate((1.0, -1.0)):
            wi = above * (1.0, 1.0, sign)
            value = surface.evaluate(fabric, wi, wo) * (math.pi / rise)[:, None]
            found[row, side] = value.mean(axis=0)
        found[row, 1] += gap
    return found


def stacked(shares):
    """(3,) reflectance of layers that are added until nothing changes, one after another."""
    (r_view, t_view), (r, t) = shares
    below = np.zeros(3)
    for _ in range(100_000):
        more = r + t * t * below / (1 - r * below)
        if np.abs(more - below).max() < 1e-9:
            break
        below = more
    return r_view + t_view * t * below / (1 - r * below)
