"""Compute the share of the cloth that each thread set covers, from the coverage and the grid.

The grid says which set is on top in a cell; the coverage says how much of the cloth a set shows.
Where they disagree, the coverage takes precedence (`docs/model.md` section 3). A set that covers
less than its cells takes the middle of their width. The space that it leaves goes first to the set
that covers more than its cells, which is seen beside it, running underneath. The rest is gap.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.fabric import Fabric, ThreadSet

__all__ = ["GAP", "WARP", "WEFT", "Coverage", "coverage", "sets"]

Floats = NDArray[np.float64]

GAP = 2
"""In place of WEFT or WARP: no thread is seen."""


class Coverage(NamedTuple):
    """The division of the cloth's area. Sets are indexed by WEFT and WARP.

    cells : (2,) float - share `c_j` of the cells with set j on top
    area : (2,) float - share `a_j` of the cloth that set j covers
    type_area : (2, k) float - the same for each thread type; row j sums to `area[j]`
    gap : float - 1 - sum of `area`
    width : (2,) float - share of its cells' width that set j takes where it is on top
    under : int - the set that is seen beside the other, running underneath, or GAP if there is none
    under_width : float - share of its own width that this set shows there
    """

    cells: Floats
    area: Floats
    type_area: Floats
    gap: float
    width: Floats
    under: int
    under_width: float


def sets(fabric: Fabric) -> tuple[ThreadSet, ThreadSet]:
    """The thread sets in index order: weft, warp."""
    return fabric.weft, fabric.warp


def coverage(fabric: Fabric) -> Coverage:
    """The division of the area of `fabric` between its sets, its thread types, and the gap.

    A set without an authored coverage takes `c_j thickness/pitch` (the mean over its visible
    threads), limited to `c_j` and to what the authored coverage of the other set leaves. A thread
    of unknown thickness fills its pitch.
    """
    shown, hidden = _type_cells(fabric)
    c = shown.sum(axis=1)
    a = np.zeros(2)
    for j, thread_set in enumerate(sets(fabric)):
        if thread_set.coverage is not None:
            a[j] = thread_set.coverage
            continue
        thickness = np.array([t.thickness for t in fabric.thread_list])
        fill = np.where(thickness > 0, np.minimum(thickness / thread_set.pitch, 1.0), 1.0)
        other = sets(fabric)[1 - j].coverage or 0.0
        a[j] = min(float(shown[j] @ fill), 1.0 - other)
    width = np.array([min(1.0, a[j] / c[j]) if c[j] > 0 else 0.0 for j in (WEFT, WARP)])
    excess = a - c
    under, under_width = GAP, 0.0
    j = int(np.argmax(excess))
    # An excess below 1e-12 is a rounding error of c, not a visible strip.
    if excess[j] > 1e-12:
        under = j
        under_width = min(1.0, float(excess[j] / (c[1 - j] * (1.0 - width[1 - j]))))
        under_width = 1.0 if under_width > 1.0 - 1e-9 else under_width
    type_area = shown * width[:, None]
    if under != GAP:
        type_area[under] += hidden[under] * (1.0 - width[1 - under]) * under_width
    return Coverage(c, a, type_area, max(0.0, 1.0 - float(a.sum())), width, under, under_width)


def _type_cells(fabric: Fabric) -> tuple[Floats, Floats]:
    """(2, k) shares of the cells in which type k of set j is on top, and in which it is underneath.

    The true repeat is the least common multiple of grid and sequence. In it, a place of the grid
    meets equally often every place of the sequence that has the same remainder modulo their
    greatest common divisor, so sums over the remainders are exact and short.
    """
    shown = np.zeros((2, len(fabric.threads)))
    hidden = np.zeros_like(shown)
    by_end, by_pick = fabric.weave.shares_on_top
    on_top = {WARP: by_end, WEFT: by_pick}
    for j, thread_set in enumerate(sets(fabric)):
        sequence = np.asarray(thread_set.sequence)
        common = math.gcd(len(on_top[j]), len(sequence))
        for remainder in range(common):
            share = float(on_top[j][remainder::common].mean())
            types = np.bincount(sequence[remainder::common], minlength=len(fabric.threads))
            of_type = types / (len(sequence) // common) / common
            shown[j] += share * of_type
            hidden[j] += (1.0 - share) * of_type
    return shown, hidden
