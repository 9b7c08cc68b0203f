"""Threads as continuous bands: how wide each set is so that it covers the area that it should.

End `i` covers `|u - (i + 1/2)| < x_warp/2` and pick `j` covers `|v - (j + 1/2)| < x_weft/2`, in
threads. Where both bands are, the grid decides which is on top; where neither is, there is gap.
With `c_j` the share of cells that set j is on top in, set j is seen on

    x_j (c_j + c_k (1 - x_k)) = a_j

of the cloth. With P = c_0 x_0, Q = c_1 x_1, A = c_0 a_0 and B = c_1 a_1 these two equations read
P (1 - Q) = A, Q (1 - P) = B: P - Q = A - B, and P solves a quadratic. Of its two roots only the
smaller has P + Q <= 1, which widths up to 1 need. The square of widths from 0 to 1 is mapped one to
one (the determinant is 1 - c_0 x_0 - c_1 x_1 >= 0), its edges onto the edges of the triangle
a_0 + a_1 <= 1: every pair of areas that a fabric may state has exactly one pair of widths.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def band_widths(cells: Floats, area: Floats) -> Floats:
    """(2,) widths `x_j` that solve `x_j (c_j + c_k (1 - x_k)) = a_j`, as shares of the pitch.

    cells : (2,) shares `c_j`, which sum to 1; area : (2,) shares `a_j`, which sum to 1 at most. A
    sum that rounding has put above 1 takes the nearest widths.
    """
    product = cells * area
    difference = float(product[0] - product[1])
    root = math.sqrt(max(0.0, (1.0 - float(product.sum())) ** 2 - 4.0 * float(product.prod())))
    x = np.zeros(2)
    for j, sign in ((0, 1.0), (1, -1.0)):
        below = 1.0 + sign * difference + root
        # Below is 0 only for a set that is never on top of one that fills the cloth: not seen.
        x[j] = min(1.0, 2.0 * float(area[j]) / below) if below > 0.0 else 0.0
    # A width within rounding of its pitch leaves no strip that could show another thread.
    return np.where(x > 1.0 - 1e-9, 1.0, x)


def band_areas(cells: Floats, width: Floats) -> Floats:
    """(2,) areas `a_j` on which sets of the given widths are seen: `band_widths` inverted."""
    return np.asarray(width * (cells + cells[::-1] * (1.0 - width[::-1])))


def seen_length(cells: float, cross_width: float) -> float:
    """Length of a visible run [cells] that lies over `cells` threads of width `cross_width`.

    A thread is seen until the next thread that lies over it begins: half of what the two crossing
    threads leave of their pitches is added at each end.
    """
    return cells + 1.0 - cross_width
