"""The mean of `g` over stretches of the threads' curves, by the light's direction.

All places of a stretch scatter alike at level `weave`. So level `far` is exact under a shadow if it
takes each stretch's mean of g, and cloth keeps its light if g is divided by it: the two ways in
which a surface law may treat a shadow, `laws.Law.absolute`.

Each linear piece of each thread type's curve is cut into stretches over which the tangent angle
changes by no more than a quarter of the surface lobe's width. For each set that shows the type, the
horizons of places of all its runs are sorted and put into groups of equal size, by azimuth: the
mean of g is that over the groups. For the nodes of level `far` it is put into a table by azimuth
and elevation: see docs/decisions/030.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.laws.lit import AZIMUTHS, ROWS, column_of
from fabricusd.appearance.weave.coverage import WARP, WEFT
from fabricusd.appearance.weave.curve import Pieces, pieces
from fabricusd.appearance.weave.lookup import find_all, piece_of
from fabricusd.appearance.weave.quadrature import CurveNodes, shares
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import INLINE, KERNEL, asin, index

Floats = NDArray[np.float64]

WIDEST, NARROWEST = math.radians(2.0), math.radians(0.5)
"""Bounds on the change of tangent angle over a stretch [rad]."""

MOST_STRETCHES = 256
"""Largest number of stretches on one piece of a curve."""

PLACES = 1 << 16
"""Places of the repeat among which those of the stretches are found."""

GROUPS = 24
"""Groups of places that scatter alike: within .001 of the mean over all places. With 16, `far` is
4 % off `weave` on flannel in the light of a sun at 5 degrees."""

LEAST_LIGHT = 0.1
"""Where a stretch's mean of g is below this, g is not divided by all of it: what a stretch in the
shade of others lacks is spread over it evenly, not put on its few bright places."""


SECTORS = 32
"""Sectors of the light's azimuth in which highest and lowest horizons of a stretch are known."""

ELEVATION = 16384.0 / (0.5 * math.pi)
"""Units of those horizons, in one radian of the light's elevation."""


class Stretches(NamedTuple):
    """The stretches of a fabric, numbered set by set, type by type and along the curve.

    set_stretches : int - their number in a set
    piece_first : (k, p) int32 - first stretch of each piece of type k in the first set
    piece_last : (k, p) int32 - the number of stretches in it less 1
    piece_scale : (k, p) float - stretches per run length, so little below their number over the
        piece's length that rounding puts no position beyond the last one
    """

    set_stretches: int
    piece_first: NDArray[np.int32]
    piece_last: NDArray[np.int32]
    piece_scale: Floats


def stretches(fabric: Fabric, longest: int) -> Stretches:
    """The stretches of `fabric`; longest : columns of the tables of pieces."""
    kinds = fabric.thread_list
    shape = (len(kinds), longest)
    first, last = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    scale, totals = np.zeros(shape), np.zeros(len(kinds), np.int64)
    for k, thread in enumerate(kinds):
        p = pieces(thread.curve)
        step = min(max(thread.gamma_surface / 4.0, NARROWEST), WIDEST)
        count = np.ceil(np.abs(p.last - p.first) / step - 1e-9).astype(np.int64)
        count = np.clip(count, 1, MOST_STRETCHES)
        used = slice(0, len(count))
        first[k, used], last[k, used] = np.cumsum(count) - count, count - 1
        # Ends of pieces are rounded to float32, and what they are multiplied by.
        scale[k, used] = count / (p.length + 2.5e-7) * (1.0 - 1e-6)
        totals[k] = count.sum()
    first += (np.cumsum(totals) - totals).astype(np.int32)[:, None]
    return Stretches(int(totals.sum()), first, last, scale)


def types_of(cut: Stretches) -> NDArray[np.int64]:
    """(stretches of both sets,) the type of thread that each is of."""
    starts = cut.piece_first[:, 0]
    return np.tile(np.repeat(np.arange(len(starts)), np.diff(starts, append=cut.set_stretches)), 2)


@njit(**INLINE)
def stretch_of(R, cloth, shadow, which, thread, s):
    """Number of the stretch at position s on a run of `thread` in set `which`; s must be finite."""
    p = piece_of(R, cloth, thread, s)
    part = np.int32((s - cloth.curve_start[thread, p]) * shadow.piece_scale[thread, p])
    return which * shadow.set_stretches + shadow.piece_first[thread, p] + part


def places_on(
    cloth: Any, repeat: tuple[int, int], shadow: Any, count: int, each: int
) -> tuple[Floats, NDArray[np.int64]]:
    """((n, 2) weave coordinates, (n,) stretches): up to `each` places of each of `count` stretches.

    cloth : compiled for float64; repeat : of the threads' shapes; shadow : what `stretch_of` reads
    """
    step = np.array([0.7548776662466927, 0.5698402909980532])
    uv = ((0.5 + np.arange(PLACES)[:, None] * step) % 1.0) * repeat
    n = len(uv)
    sets, threads = np.empty(n, np.uint8), np.empty(n, np.int32)
    s, w, angle, length = (np.empty(n) for _ in range(4))
    find_all(np.float64, cloth, uv, sets, threads, s, w, angle, length)
    found = np.full(n, -1, np.int64)
    _number(np.float64, cloth, shadow, sets, threads, s, found)
    order = np.argsort(found, kind="stable")
    order = order[found[order] >= 0]
    number = found[order]
    rank = np.arange(len(number)) - np.searchsorted(number, number)
    keep = rank < each
    return np.ascontiguousarray(uv[order[keep]]), number[keep]


@njit(cache=True)
def _number(R, cloth, shadow, sets, threads, s, out):
    for k in range(out.size):
        if sets[k] <= 1 and cloth.pile[threads[k]] == 0:
            out[k] = stretch_of(R, cloth, shadow, sets[k], threads[k], s[k])


def groups_of(number: NDArray[np.int64], count: int, horizon: Floats) -> Floats:
    """(count, columns + 1, GROUPS) mean horizons of each group of places, lowest first.

    number : (n,) ascending stretch of each place; horizon : (n, columns). Stretches that no place
    is on have level horizons; the last column repeats the first.
    """
    found = np.zeros((count, horizon.shape[1] + 1, GROUPS))
    for stretch in np.unique(number):
        mine = np.sort(horizon[number == stretch], axis=0)
        # As many copies as make every group whole.
        whole = np.repeat(mine, GROUPS, axis=0).reshape(GROUPS, len(mine), -1).mean(axis=1)
        found[stretch, :-1] = whole.T
    found[:, -1] = found[:, 0]
    return found


def bounds_of(groups: Floats, softness: float) -> NDArray[np.int32]:
    """`Shadow.mean_bounds`, (stretches, SECTORS); groups : of `groups_of`, softness : edge's width
    [rad]."""
    every = (groups.shape[1] - 1) // SECTORS
    sectors = [groups[:, k * every : (k + 1) * every + 1] for k in range(SECTORS)]
    lowest = np.stack([one.min(axis=(1, 2)) for one in sectors], axis=1)
    highest = np.stack([one.max(axis=(1, 2)) for one in sectors], axis=1)
    # Half a softness away from a horizon its place is dark, or lit. One unit more, for rounding.
    dark = np.floor((lowest - 0.5) * softness * ELEVATION) - 1.0
    lit = np.ceil((highest + 0.5) * softness * ELEVATION) + 1.0
    high, low = np.minimum(lit, 32767.0).astype(np.int32), np.maximum(dark, 0.0).astype(np.int32)
    return np.asarray(high << 16 | low)


@njit(**INLINE)
def level_of(R, z, softness):
    """The light's elevation in softnesses, plus a half; z : sine of the elevation."""
    return asin(R, z) / softness + R(0.5)


@njit(**INLINE)
def mean_over(R, horizons, groups, here, beside, c, level):
    """Mean of g over the groups whose horizons begin at `here`, and at `beside` in the next
    column.

    groups : GROUPS; as a constant in `mean_block`, where that is faster, else read from memory
    """
    total = R(0)
    for k in range(groups):
        horizon = horizons[index(here, k)]
        horizon += (horizons[index(beside, k)] - horizon) * c
        t = max(R(0), min(R(1), level - horizon))
        total += t * t * (R(3) - R(2) * t)
    return total * R(1.0 / GROUPS)


@njit(**INLINE)
def mean_of(R, shadow, stretch, x, y, z):
    """Mean of g over a stretch, for light from (x, y, z) above the cloth."""
    columns = shadow.mean_columns
    column, c = column_of(R, columns, x, y)
    begin = (np.int64(stretch) * (columns + 1) + column) * GROUPS
    level = level_of(R, z, shadow.softness)
    return mean_over(R, shadow.mean, shadow.groups, begin, begin + GROUPS, c, level)


@njit(**INLINE)
def relative(R, g, mean):
    """`g` over its mean, see LEAST_LIGHT: a factor whose mean is 1."""
    scale = R(1) / max(mean, R(LEAST_LIGHT))
    return g * scale + (R(1) - mean * scale)


@njit(**KERNEL)
def fill_means(R, groups, softness, out):
    """The mean of g over groups of horizons, by azimuth and elevation.

    groups : (columns + 1, GROUPS) horizons in softnesses; softness : width of a shadow's edge [rad]
    out : (azimuths + 1, rows), elevations even in the root of their sine
    """
    azimuths, rows = out.shape[0] - 1, out.shape[1]
    columns, count = groups.shape[0] - 1, groups.shape[1]
    for azimuth in range(azimuths + 1):
        turn = azimuth * columns / azimuths
        column = min(int(turn), columns - 1)
        here = groups.reshape(-1)
        for row in range(rows):
            level = level_of(R, (R(row) / R(rows - 1)) ** 2, softness)
            begin = column * count
            out[azimuth, row] = mean_over(
                R, here, count, begin, begin + count, turn - column, level
            )


def node_means(shadow: Any, nodes: CurveNodes, fabric: Fabric) -> Floats | None:
    """(AZIMUTHS + 1, ROWS, q) mean of g that each of q nodes takes; None without a shadow.

    shadow : the `Shadow` of `fabric`. See `quadrature.shares`: the sum over nodes of what scatters
    times this mean is the integral of their product.
    """
    if shadow.method == 0:
        return None
    groups, softness = _groups(shadow), float(shadow.softness)
    found = np.zeros((len(nodes.psi0), AZIMUTHS + 1, ROWS))
    for which in (WEFT, WARP):
        mine = np.arange(len(nodes.psi0)) >= nodes.warp_start
        mine = mine if which == WARP else ~mine
        for kind, thread in enumerate(fabric.thread_list):
            here = np.flatnonzero(mine & (nodes.thread == kind))
            if not len(here):
                continue
            cuts = _cuts(pieces(thread.curve), shadow.piece_last[kind] + 1)
            first = which * int(shadow.set_stretches) + int(shadow.piece_first[kind, 0])
            part = shares(nodes, here, cuts)
            for stretch in np.flatnonzero(part.any(axis=0)):
                table = np.empty(found.shape[1:])
                fill_means(np.float64, groups[first + stretch], softness, table)
                for node in np.flatnonzero(part[:, stretch]):
                    found[here[node]] += part[node, stretch] * table
    return np.ascontiguousarray(np.moveaxis(_with_true_means(found), 0, -1))


def _with_true_means(table: Floats) -> Floats:
    """Entries between which straight lines have the means of what (n, azimuths + 1, rows) `table`
    samples; those for light along the cloth and from above stay as they are.

    Lines between samples are to one side of a curve that bends, by a twelfth of its second
    difference on average.
    """
    found = table.copy()
    found[..., 1:-1] -= (table[..., 2:] - 2.0 * table[..., 1:-1] + table[..., :-2]) / 12.0
    around = found[:, :-1]
    bend = np.roll(around, 1, axis=1) - 2.0 * around + np.roll(around, -1, axis=1)
    around[..., 1:-1] -= bend[..., 1:-1] / 12.0
    found[:, -1] = found[:, 0]
    return found


def angle_groups(shadow: Any, fabric: Fabric, which: int, kind: int, psi0: Floats) -> Floats:
    """(columns + 1, n, GROUPS) horizons of the places of set `which` where the thread type `kind`
    has the tangent angles psi0 (n,) [rad], as `groups_of`.

    shadow : the `Shadow` of `fabric`, not of method `none`. An angle that several stretches have is
    in all of them, by their lengths; one that the curve does not have is in the nearest.
    """
    p = pieces(fabric.thread_list[kind].curve)
    counts = shadow.piece_last[kind, : len(p.first)] + 1
    length = np.diff(_cuts(p, shadow.piece_last[kind] + 1))
    ends = [
        a + (b - a) * np.arange(n + 1) / n for a, b, n in zip(p.first, p.last, counts, strict=True)
    ]
    low = np.concatenate([np.minimum(e[:-1], e[1:]) for e in ends])
    high = np.concatenate([np.maximum(e[:-1], e[1:]) for e in ends])
    piece = np.repeat(np.arange(len(counts)), counts)
    first = which * int(shadow.set_stretches) + int(shadow.piece_first[kind, 0])
    rows = _groups(shadow)[first : first + len(length)]
    found = np.empty((rows.shape[1], len(psi0), GROUPS))
    for k, angle in enumerate(psi0):
        away = np.maximum(np.maximum(low - angle, angle - high), 0.0)
        on = np.flatnonzero((away <= away.min() + 1e-9) & (length > 0))
        # Between two stretches of a piece, either will do.
        on = on[np.unique(piece[on], return_index=True)[1]]
        found[:, k] = _mixed(rows[on], length[on])
    return found


def _groups(shadow: Any) -> Floats:
    """(stretches, columns + 1, GROUPS) `Shadow.mean`."""
    return np.asarray(shadow.mean, np.float64).reshape(-1, shadow.mean_columns + 1, GROUPS)


def _cuts(p: Pieces, counts: NDArray[np.int32]) -> Floats:
    """Ends of the stretches of a curve, in run lengths, from 0 to 1."""
    parts = zip(p.start, p.length, counts, strict=False)
    return np.concatenate([a + length * np.arange(n) / n for a, length, n in parts] + [np.ones(1)])


def _mixed(rows: Floats, weight: Floats) -> Floats:
    """(columns + 1, groups) of several stretches together: rows (n, columns + 1, groups)."""
    n, columns, groups = rows.shape
    if n == 1:
        return rows[0]
    sine = rows.transpose(1, 0, 2).reshape(columns, -1)
    order = np.argsort(sine, axis=1)
    sine = np.take_along_axis(sine, order, axis=1)
    mass = np.repeat(weight / weight.sum() / groups, groups)[order]
    upper = np.cumsum(mass, axis=1)
    # Means between equal shares of the mass, from the integral of a step function.
    whole = np.concatenate((np.zeros((columns, 1)), np.cumsum(sine * mass, axis=1)), axis=1)
    cuts = np.arange(groups + 1) / groups
    out = np.empty((columns, groups))
    for k in range(columns):
        edges = np.concatenate(((0.0,), upper[k] / upper[k, -1]))
        out[k] = groups * np.diff(np.interp(cuts, edges, whole[k]))
    return out
