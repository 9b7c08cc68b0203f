"""Light from a sky whose radiance is linear in the height, by a table over views."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.appearance.frame import diamond
from fabricusd.kernels.real import LEAN

ROWS, COLUMNS = 32, 48
"""Entries of the table: in sqrt(1 - N.wo), and in the diamond angle; one more column repeats the
first."""


@njit(**LEAN)
def sky_light(R, table, even, slope, wo, zenith, out):
    """Add to out (3, n) what cloth sends to wo (3, n) of a sky of the radiance even + slope up.w.

    table : (ROWS, COLUMNS + 1, 4, 3) - integrals of f over the sky, and of f times each component
        of wi; zenith : (3, n) - `up` in the surface frame
    """
    for k in range(out.shape[1]):
        if not wo[2, k] > R(0):
            continue
        row = math.sqrt(max(R(0), R(1) - min(R(1), wo[2, k]))) * R(ROWS - 1)
        turn = diamond(R, wo[0, k], wo[1, k]) * R(0.25 * COLUMNS)
        i = max(min(np.int32(row), np.int32(ROWS - 2)), np.int32(0))
        j = max(min(np.int32(turn), np.int32(COLUMNS - 1)), np.int32(0))
        a, b = row - R(i), turn - R(j)
        for channel in range(3):
            total = R(0)
            for r in range(2):
                for s in range(2):
                    entry = table[i + r, j + s]
                    value = even * entry[0, channel]
                    for x in range(3):
                        value += slope * zenith[x, k] * entry[1 + x, channel]
                    total += (a if r else R(1) - a) * (b if s else R(1) - b) * value
            out[channel, k] += total
