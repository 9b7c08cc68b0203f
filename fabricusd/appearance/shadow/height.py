"""The height field of the repeat, and the ray that is marched through it exactly.

A point's height is the height of its thread's axis plus half the thread's thickness, flat across
the thread (level `weave`) or times sqrt(1 - w^2) (level `thread`). Gaps and pile have no height:
they hide nothing. Along a straight line every visible stretch of thread has a closed form, so the
march steps from stretch to stretch and misses nothing between. `docs/model.md` sections 3 and 5.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.curve import peak
from fabricusd.appearance.weave.lookup import crown_on, lookup, rise_on, wrap
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import INLINE, PART

CELLS = 512
"""Cells that a march crosses at most: light a quarter of a degree above the cloth clears the
highest thread of the published fabrics within 40."""

NEAREST = 1e-4
"""Of a pitch: the march begins this far from its point, where the slope to the next point of the
same thread is still resolved in float32 and is the tangent to within the curve's bend."""

_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@njit(**INLINE)
def crown_of(R, cloth, rounded, which, thread, w):
    """Height [m] of a thread's visible side over its axis at `w`, flat or round."""
    if rounded != 0:
        return crown_on(R, cloth, which, thread, w)
    return cloth.half_thickness[which, thread]


@njit(**PART)
def steepest(cloth, rounded, highest, u, v, which, crown, h, dx, dy, k, first):
    """Slope of the steepest line from a point at height `h` [m] to the height field, at least `k`.

    u, v : weave coordinates of the point; dx, dy : unit direction on the cloth, metres along U, V
    which, crown : the point's thread set and `crown_of` there. Along its own thread the march takes
        the round for flat at that height: a thread's far side is dark because `f_s` says so, and g
        must not say it again.
    highest : no point of the field is higher [m]
    first : return at the first slope above `k`: enough to know whether light at slope `k` arrives
    """
    du, dv = dx / float(cloth.pitch[WARP]), dy / float(cloth.pitch[WEFT])
    nearest = NEAREST * min(float(cloth.pitch[WARP]), float(cloth.pitch[WEFT]))
    end, pick = np.floor(u), np.floor(v)
    begin, asked = 0.0, k
    for _ in range(CELLS):
        to_end = ((end + 1.0 if du > 0.0 else end) - u) / du if du != 0.0 else np.inf
        to_pick = ((pick + 1.0 if dv > 0.0 else pick) - v) / dv if dv != 0.0 else np.inf
        leave = min(to_end, to_pick)
        k = _cross_cell(
            cloth, rounded, end, pick, u, v, which, crown, du, dv, max(begin, nearest), leave, h, k
        )  # fmt: skip
        if (first and k > asked) or leave * k > highest - h:
            return k
        if to_end <= to_pick:
            end += 1.0 if du > 0.0 else -1.0
        else:
            pick += 1.0 if dv > 0.0 else -1.0
        begin = leave
    return k


@njit(**INLINE)
def _cross_cell(cloth, rounded, end, pick, u, v, which, crown, du, dv, t0, t1, h, k):
    """`steepest` over the threads seen in one cell, distances t0 to t1 [m]."""
    i, j = wrap(end, cloth.grid.shape[0]), wrap(pick, cloth.grid.shape[1])
    warp = int(cloth.sequence[WARP, wrap(end, cloth.sequence_length[WARP])])
    weft = int(cloth.sequence[WEFT, wrap(pick, cloth.sequence_length[WEFT])])
    top = int(cloth.grid[i, j])
    own = end == np.floor(u) if which == WARP else pick == np.floor(v)
    if top == WARP:
        over, over_t, along, along_t = u - end, du, v - pick, dv
        above, below, crossing, below_crossing = warp, weft, cloth.pitch[WEFT], cloth.pitch[WARP]
    else:
        over, over_t, along, along_t = v - pick, dv, u - end, du
        above, below, crossing, below_crossing = weft, warp, cloth.pitch[WARP], cloth.pitch[WEFT]
    width = float(cloth.width[top])
    low, high = 0.5 - 0.5 * width, 0.5 + 0.5 * width
    if width > 0.0 and cloth.pile[above] == 0:
        a, b = _within(over, over_t, low, high, t0, t1)
        cells = float(cloth.runs[i, j, 0, 1])
        mine = own and which == top
        k = _cross_thread(
            cloth, 0 if mine else rounded, above,
            crown if mine else float(cloth.half_thickness[top, above]),
            a, b, h, k, cells * float(crossing),
            (float(cloth.runs[i, j, 0, 0]) + along) / cells, along_t / cells,
            2.0 * (over - 0.5) / width, 2.0 * over_t / width,
        )  # fmt: skip
    if cloth.under == 1 - top and cloth.pile[below] == 0:
        seen = float(cloth.under_width)
        a0, b0 = _within(along, along_t, 0.5 - 0.5 * seen, 0.5 + 0.5 * seen, t0, t1)
        share = 1.0 - width
        cells = float(cloth.runs[i, j, 1, 1])
        for side in range(2):
            if side == 0:
                a, b = _within(over, over_t, 0.0, low, a0, b0)
                skipped = 0.0
            else:
                a, b = _within(over, over_t, high, 1.0, a0, b0)
                skipped = width
            place = float(cloth.runs[i, j, 1, 0]) + (over - skipped) / share
            mine = own and which != top
            k = _cross_thread(
                cloth, 0 if mine else rounded, below,
                crown if mine else float(cloth.half_thickness[1 - top, below]),
                a, b, h, k, cells * share * float(below_crossing), place / cells,
                over_t / share / cells, 2.0 * (along - 0.5) / seen, 2.0 * along_t / seen,
            )  # fmt: skip
    return k


@njit(**INLINE)
def _within(x, x_t, low, high, t0, t1):
    """The part of [t0, t1] with x + x_t t from `low` to `high`; empty where its end is less."""
    if x_t == 0.0:
        if low <= x <= high:
            return t0, t1
        return t0, t0 - 1.0
    a, b = (low - x) / x_t, (high - x) / x_t
    return max(t0, min(a, b)), min(t1, max(a, b))


@njit(**INLINE)
def _cross_thread(cloth, rounded, thread, half, a, b, h, k, length, s, s_t, w, w_t):
    """`steepest` over a stretch of thread: distances a to b [m], position s + s_t t, w + w_t t."""
    if not b > a:
        return k
    pieces = cloth.curve_start.shape[1]
    for p in range(pieces):
        low = float(cloth.curve_start[thread, p])
        if low >= 1.0:
            break
        high = min(1.0, float(cloth.curve_start[thread, p + 1])) if p + 1 < pieces else 1.0
        # Stretch to both ends: rounding must not open a seam there.
        low = -1.0 if p == 0 else low
        high = 2.0 if high >= 1.0 else high
        t0, t1 = _within(s, s_t, low, high, a, b)
        if not t1 >= t0:
            continue
        k = max(k, _slope(cloth, rounded, thread, p, half, h, length, s, s_t, w, w_t, t0))
        k = max(k, _slope(cloth, rounded, thread, p, half, h, length, s, s_t, w, w_t, t1))
        if rounded != 0:
            t = _summit(cloth, thread, p, half, h, length, s, s_t, w, w_t, t0, t1, k)
            k = max(k, _slope(cloth, rounded, thread, p, half, h, length, s, s_t, w, w_t, t))
            continue
        bend = float(cloth.curve_slope[thread, p])
        if bend == 0.0 or s_t == 0.0:
            continue
        for _ in range(3):
            # Highest above the line of slope k where the thread runs parallel to it; raising k to
            # the slope found there is Newton's method on the tangent from the point.
            angle = -math.atan(k / (length * s_t))
            turn = (
                float(cloth.curve_start[thread, p])
                + (angle - float(cloth.curve_angle[thread, p])) / bend
            )
            t = (turn - s) / s_t
            if t <= t0 or t >= t1:
                break
            k = max(k, _slope(cloth, rounded, thread, p, half, h, length, s, s_t, w, w_t, t))
    return k


@njit(**INLINE)
def _slope(cloth, rounded, thread, p, half, h, length, s, s_t, w, w_t, t):
    """Slope from the point to the thread at distance `t` [m]."""
    at = max(0.0, min(1.0, s + s_t * t))
    crown = half
    if rounded != 0:
        across = w + w_t * t
        crown *= math.sqrt(max(0.0, 1.0 - across * across))
    return (length * rise_on(np.float64, cloth, thread, p, at) + crown - h) / t


@njit(**PART)
def _summit(cloth, thread, p, half, h, length, s, s_t, w, w_t, t0, t1, k):
    """Where a round thread stands highest above the line of slope `k`, by golden section.

    Crown and hump are both concave, so there is one summit; a valley's highest points are its ends,
    which the caller asks too.
    """
    low, high = t0, t1
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_left = (_slope(cloth, 1, thread, p, half, h, length, s, s_t, w, w_t, left) - k) * left
    at_right = (_slope(cloth, 1, thread, p, half, h, length, s, s_t, w, w_t, right) - k) * right
    for _ in range(16):
        if at_left > at_right:
            high, right, at_right = right, left, at_left
            left = high - _GOLDEN * (high - low)
            at_left = (
                _slope(cloth, 1, thread, p, half, h, length, s, s_t, w, w_t, left) - k
            ) * left
        else:
            low, left, at_left = left, right, at_right
            right = low + _GOLDEN * (high - low)
            at_right = (
                _slope(cloth, 1, thread, p, half, h, length, s, s_t, w, w_t, right) - k
            ) * right
    return 0.5 * (low + high)


def highest_point(fabric: Fabric, cloth: CompiledFabric) -> float:
    """Height of the highest thread of the repeat, half its thickness included [m]; 0 if all pile.

    cloth : `fabric` compiled; its run tables are used. A type counts at every length of visible run
    that it can meet: places of the grid meet those places of the sequence that leave the same
    remainder by their greatest common divisor.
    """
    found = 0.0
    peaks = [peak(t.curve) for t in fabric.thread_list]
    for which, sequence in ((WARP, fabric.warp.sequence), (WEFT, fabric.weft.sequence)):
        crossing = float(cloth.pitch[1 - which])
        for longest, share in _longest_runs(cloth, which):
            common = math.gcd(len(longest), len(sequence))
            for place, kind in enumerate(sequence):
                cells = longest[place % common :: common].max()
                if cloth.pile[kind] or cells == 0:
                    continue
                half = float(cloth.half_thickness[which, kind])
                found = max(found, peaks[kind] * float(cells) * share * crossing + half)
    return found


def _longest_runs(cloth: CompiledFabric, which: int) -> list[tuple[NDArray[np.int64], float]]:
    """Longest visible run of each thread of a set, in cells, with the share of a cell that shows:
    once on top and, where the set is seen underneath, once there."""
    axis = 1 if which == WARP else 0
    on_top = cloth.grid == which
    answer = []
    if cloth.width[which] > 0:
        lengths = np.where(on_top, cloth.runs[..., 0, 1], 0).max(axis=axis)
        answer.append((lengths.astype(np.int64), 1.0))
    if cloth.under == which:
        lengths = np.where(on_top, 0, cloth.runs[..., 1, 1]).max(axis=axis)
        answer.append((lengths.astype(np.int64), 1.0 - float(cloth.width[1 - which])))
    return answer


def height_field(
    fabric: Fabric, resolution: tuple[int, int], *, level: str = "weave"
) -> NDArray[np.float64]:
    """Heights [m] at the centres of `resolution` texels over one grid repeat, indexed [u, v].

    level : "weave", threads flat across their width, or "thread", round. Gaps and pile are 0, the
    height that a straight thread's axis has.
    """
    if min(resolution) < 1:
        raise FabricError("resolution", f"is {resolution}; it must be at least 1 by 1")
    rounded = level_is_round(level)
    cloth = compile_fabric(fabric, precision=np.float64)
    ends, picks = fabric.weave.cells.shape
    u = (np.arange(resolution[0]) + 0.5) / resolution[0] * ends
    v = (np.arange(resolution[1]) + 0.5) / resolution[1] * picks
    uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    hit = lookup(cloth, uv)
    half = cloth.half_thickness[np.minimum(hit.set, 1), hit.thread]
    height = hit.height + (hit.crown if rounded else half)
    hidden = hit.gap | (cloth.pile[hit.thread] != 0)
    field: NDArray[np.float64] = np.where(hidden, 0.0, height).reshape(resolution)
    return field


def level_is_round(level: str) -> int:
    """1 for level "thread", where threads are round, 0 for "weave", where they are flat."""
    if level not in ("weave", "thread"):
        raise FabricError("level", f"is '{level}'; it must be 'weave' or 'thread'")
    return int(level == "thread")
