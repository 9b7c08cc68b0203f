"""How much brighter than a white sky cloth would be, by view: what keeps a law from making light.

Threads of the published models are brighter than white at grazing views, and so are traced tubes of
them. Laws with an absolute shadow divide by what the cloth would reflect of a white sky, where that
is above 1 in some channel. The table is by view: rows evenly spaced in 1 - sqrt(N.wo), columns in
the diamond angle.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.laws.excess import COLUMNS, ROWS, view
from fabricusd.appearance.published.far import far_values

Floats = NDArray[np.float64]

RINGS, AROUND = 24, 48
"""Directions of the sky: Gauss-Legendre points in the sine of the elevation, and azimuths."""

FEW, DIM = 4, 0.75
"""Columns that a row is tried at, and the brightness up to which it holds no excess between them.
Cloth is brighter than white at grazing views only, so most rows need no more."""


def excess_of(tables: Any, precision: type[np.floating[Any]]) -> Floats:
    """(ROWS, COLUMNS + 1) reflected of a white sky, at least 1.

    tables : of the law in `precision`, as `Law.make` leaves them
    """
    sky, weight = white_sky()
    found = np.empty((ROWS, COLUMNS + 1))
    wi = np.ascontiguousarray(sky.T, dtype=precision)
    out = np.empty_like(wi)
    weight = weight.astype(precision)
    real: Any = precision

    def reflected(row: int, column: float) -> float:
        wo = np.repeat(np.array([view(row, column)], precision).T, len(sky), axis=1)
        far_values(real, tables, wi, wo, out, 0, len(sky))
        return float((out @ weight).max())

    for row in range(ROWS):
        if max(reflected(row, k * COLUMNS / FEW) for k in range(FEW)) <= DIM:
            found[row] = 1.0
            continue
        for column in range(COLUMNS):
            found[row, column] = max(1.0, reflected(row, column))
    found[:, COLUMNS] = found[:, 0]
    return found


def white_sky() -> tuple[Floats, Floats]:
    """(n, 3) directions above the cloth and (n,) their solid angles."""
    z, ring = np.polynomial.legendre.leggauss(RINGS)
    z, ring = 0.5 * (z + 1.0), 0.5 * ring
    turn = 2.0 * np.pi * (np.arange(AROUND) + 0.5) / AROUND
    height, angle = (x.ravel() for x in np.meshgrid(z, turn, indexing="ij"))
    flat = np.sqrt(1.0 - height * height)
    sky = np.stack((flat * np.cos(angle), flat * np.sin(angle), height), axis=1)
    return sky, np.repeat(ring, AROUND) * (2.0 * np.pi / AROUND)
