"""The divisor that keeps a law with an absolute shadow from making light, see
`published.excess`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from fabricusd.appearance.frame import diamond
from fabricusd.kernels.real import INLINE, index

ROWS, COLUMNS = 24, 32
"""Entries of a table by view: in 1 - sqrt(N.wo), which is dense at grazing views, and in the
diamond angle; one more column repeats the first."""

EXCESS_FIELDS = ("excess",)
"""excess : (ROWS, COLUMNS + 1) real, flat - at least 1; a single entry for none. Of `visible` cloth
it is divided by what does not pass the gaps"""

LOWEST = 0.001
"""Sine of the lowest view: at 0 no law is defined."""


def no_excess(precision: Any) -> dict[str, Any]:
    """EXCESS_FIELDS of a law whose cloth is not asked how bright it is."""
    return {"excess": np.ones(1, precision)}


def view(row: int, column: float) -> tuple[float, float, float]:
    """The view of an entry, as a unit vector."""
    z = max((1.0 - row / (ROWS - 1)) ** 2, LOWEST)
    quadrant, f = divmod(4.0 * column / COLUMNS, 1.0)
    x, y = 1.0 - f, f
    for _ in range(int(quadrant)):
        x, y = -y, x
    flat = math.sqrt(1.0 - z * z) / math.hypot(x, y)
    return flat * x, flat * y, z


@njit(**INLINE)
def excess_at(R, tables, x, y, z):
    """The divisor for a view from (x, y, z)."""
    if tables.excess.size == 1:
        return R(1)
    return by_view(R, tables.excess, x, y, z)


@njit(**INLINE)
def by_view(R, table, x, y, z):
    """What a table by view holds for one from (x, y, z)."""
    across = (R(1) - math.sqrt(max(R(0), min(R(1), z)))) * R(ROWS - 1)
    turn = diamond(R, x, y) * R(0.25 * COLUMNS)
    row = max(min(np.int32(across), np.int32(ROWS - 2)), np.int32(0))
    column = max(min(np.int32(turn), np.int32(COLUMNS - 1)), np.int32(0))
    a, b = across - R(row), turn - R(column)
    near = index(row * np.int32(COLUMNS + 1), column)
    far = index(near, COLUMNS + 1)
    low = table[near]
    low += (table[index(near, 1)] - low) * b
    high = table[far]
    high += (table[index(far, 1)] - high) * b
    return low + (high - low) * a
