"""Threads as continuous bands: how wide each set is so that it covers the area that it should.

End `i` covers `|u - (i + 1/2)| < x_warp/2` and pick `j` covers `|v - (j + 1/2)| < x_weft/2`, in
threads. Where both bands are, the grid decides which is on top; where neither is, there is gap.
With `c_j` the share of cells that set j is on top in, set j is seen on

    x_j (c_j + c_k (1 - x_k)) = a_j

of the cloth. That is two equations for two widths. With P = c_0 x_0, Q = c_1 x_1, A = c_0 a_0 and
B = c_1 a_1 they read P (1 - Q) = A, Q (1 - P) = B: P - Q = A - B, and P solves a quadratic. Of its
two roots only the smaller has P + Q <= 1, which widths up to 1 need. The square of widths from 0
to 1 is mapped one to one (the determinant is 1 - c_0 x_0 - c_1 x_1 >= 0), its edges onto the edges
of the triangle a_0 + a_1 <= 1: every pair of areas that a fabric may state has one pair of widths.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.coverage import WARP, WEFT, _type_cells, coverage
from fabricusd.fabric import Fabric

__all__ = ["Bands", "band_widths", "bands", "seen_length"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Bands:
    """The widths of both sets and what they cover. Indices of sets are WEFT and WARP.

    width : (2,) float - share `x_j` of its pitch that a thread of set j takes
    area : (2,) float - share of the cloth on which set j is seen: `x_j (c_j + c_k (1 - x_k))`
    type_area : (2, k) float - the same for each thread type; a row sums to `area[j]`. Types are
        seen as their places in the grid have it, so that a type's part of `area` may differ from
        that of `coverage`, which shares by the cells alone
    gap : float - (1 - x_0)(1 - x_1), where neither band is
    error : float - the largest |area - a_j|; rounding, for every fabric whose coverages sum to 1 at
        most
    """

    width: Floats
    area: Floats
    type_area: Floats
    gap: float
    error: float


def bands(fabric: Fabric) -> Bands:
    """The bands of `fabric`, which cover what `coverage` says that each set covers."""
    share = coverage(fabric)
    shown, hidden = _type_cells(fabric)
    x = band_widths(share.cells, share.area)
    type_area = x[:, None] * (shown + hidden * (1.0 - x[::-1])[:, None])
    area = type_area.sum(axis=1)
    return Bands(
        width=x,
        area=area,
        type_area=type_area,
        gap=float((1.0 - x[WEFT]) * (1.0 - x[WARP])),
        error=float(np.abs(area - share.area).max()),
    )


def band_widths(cells: Floats, area: Floats) -> Floats:
    """(2,) widths `x_j` that solve `x_j (c_j + c_k (1 - x_k)) = a_j`.

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
    return x


def seen_length(cells: float, cross_width: float) -> float:
    """Length of a visible run [cells] that lies over `cells` threads of width `cross_width`.

    A thread is seen until the next thread that lies over it begins: half of what the two crossing
    threads leave of their pitches is added at each end.
    """
    return cells + 1.0 - cross_width
