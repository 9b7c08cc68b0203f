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
"""Entries of the table: in 1 - sqrt(N.wo), which is dense at grazing views, and in the diamond
angle; one more column repeats the first."""

EXCESS_FIELDS = ("excess",)
"""excess : (ROWS, COLUMNS + 1) real, flat - at least 1; a single entry for none"""


def no_excess(precision: Any) -> dict[str, Any]:
    """EXCESS_FIELDS of a law whose cloth is not asked how bright it is."""
    return {"excess": np.ones(1, precision)}


@njit(**INLINE)
def excess_at(R, tables, x, y, z):
    """The divisor for a view from (x, y, z)."""
    if tables.excess.size == 1:
        return R(1)
    across = (R(1) - math.sqrt(max(R(0), min(R(1), z)))) * R(ROWS - 1)
    turn = diamond(R, x, y) * R(0.25 * COLUMNS)
    row = max(min(np.int32(across), np.int32(ROWS - 2)), np.int32(0))
    column = max(min(np.int32(turn), np.int32(COLUMNS - 1)), np.int32(0))
    a, b = across - R(row), turn - R(column)
    near = index(row * np.int32(COLUMNS + 1), column)
    far = index(near, COLUMNS + 1)
    low = tables.excess[near]
    low += (tables.excess[index(near, 1)] - low) * b
    high = tables.excess[far]
    high += (tables.excess[index(far, 1)] - high) * b
    return low + (high - low) * a
