"""Compute the share of the cloth that each thread set covers, from the coverage and the grid.

The grid says which set is on top where two threads cross; the coverage says how much of the cloth a
set shows. Threads are continuous bands (`bands`), and their widths are those that show exactly the
stated areas: a thread is seen where it is on top, and beside the threads that cross over it. Where
neither set has a band there is gap.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.bands import band_widths
from fabricusd.fabric import Fabric, ThreadSet

__all__ = ["GAP", "WARP", "WEFT", "Coverage", "coverage", "sets", "true_repeat"]

Floats = NDArray[np.float64]

GAP = 2
"""In place of WEFT or WARP: no thread is seen."""


class Coverage(NamedTuple):
    """How the area of the cloth is shared. Indices of sets are WEFT and WARP.

    cells : (2,) float - share `c_j` of the cells with set j on top
    area : (2,) float - share `a_j` of the cloth that set j covers
    type_area : (2, k) float - the same for each thread type; a row sums to `area[j]`
    gap : float - share that no thread covers, `(1 - x_0)(1 - x_1)`
    width : (2,) float - share `x_j` of its pitch that a thread of set j takes, see `bands`
    """

    cells: Floats
    area: Floats
    type_area: Floats
    gap: float
    width: Floats


def sets(fabric: Fabric) -> tuple[ThreadSet, ThreadSet]:
    """The thread sets in index order: weft, warp."""
    return fabric.weft, fabric.warp


def true_repeat(fabric: Fabric) -> tuple[int, int]:
    """Numbers of ends and picks after which weave and thread sequences repeat together."""
    return (
        math.lcm(fabric.weave.ends, len(fabric.warp.sequence)),
        math.lcm(fabric.weave.picks, len(fabric.weft.sequence)),
    )


def coverage(fabric: Fabric) -> Coverage:
    """The division of the area of `fabric` between its sets, its thread types, and the gap.

    A set without an authored coverage has bands as wide as its threads are thick, in the mean over
    them, and covers what such bands show. If the other set has one, its own is limited to what that
    leaves. A thread of unknown thickness fills its pitch.
    """
    shown, hidden = _type_cells(fabric)
    c = shown.sum(axis=1)
    x = _widths(fabric, c, shown + hidden)
    # Beside a thread on top, what the crossing threads leave of their pitch shows the one beneath.
    type_area = x[:, None] * (shown + hidden * (1.0 - x[::-1])[:, None])
    gap = float((1.0 - x[WEFT]) * (1.0 - x[WARP]))
    return Coverage(c, type_area.sum(axis=1), type_area, gap, x)


def _widths(fabric: Fabric, c: Floats, often: Floats) -> Floats:
    """(2,) widths `x_j`; c : (2,) shares `c_j`; often : (2, k) share of each type in its set."""
    asked = [s.coverage for s in sets(fabric)]
    x = np.zeros(2)
    for j, thread_set in enumerate(sets(fabric)):
        thickness = np.array([t.thickness for t in fabric.thread_list])
        fill = np.where(thickness > 0, np.minimum(thickness / thread_set.pitch, 1.0), 1.0)
        x[j] = min(float(often[j] @ fill), 1.0)
    if asked[WEFT] is None and asked[WARP] is None:
        return x
    a = np.zeros(2)
    for j, stated in enumerate(asked):
        if stated is not None:
            a[j] = stated
            continue
        # The other set is as wide as shows its coverage beside bands of this width.
        other = float(asked[1 - j] or 0.0)
        beside = c[1 - j] + c[j] * (1.0 - x[j])
        wide = min(other / beside, 1.0) if beside > 0.0 else 0.0
        a[j] = min(float(x[j] * (c[j] + c[1 - j] * (1.0 - wide))), 1.0 - other)
    return band_widths(c, a)


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
