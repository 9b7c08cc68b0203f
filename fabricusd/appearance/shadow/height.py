"""The height field of the repeat, and an exact ray march through it.

The height of a point is the height of its thread's axis plus half the thickness of the thread:
constant across the thread (level `weave`) or times sqrt(1 - w^2) (level `thread`). Gaps and pile
have no height and hide nothing. Along a straight line every visible segment of thread has a closed
form, so the march steps from segment to segment and misses nothing in between. Source:
`docs/model.md` sections 3 and 5.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.curve import peak
from fabricusd.appearance.weave.lookup import (
    lookup,
    lower_run,
    rise_on,
    upper_run,
    wrap,
)
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import INLINE, PART

CELLS = 512
"""Largest number of cells that a march crosses. Light a quarter of a degree above the cloth clears
the highest thread of the published fabrics within 40 cells."""

NEAREST = 1e-4
"""Distance from its point at which a march begins, as a fraction of a pitch. At this distance
float32 still resolves the slope to the next point of the same thread, and the slope is the tangent
to within the bend of the curve."""

_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


class Origin(NamedTuple):
    """The point that a march starts from.

    u, v : float - weave coordinates
    thread_set : int; crown : float - thread set of the point, and height above its axis there [m]
    height : float - height of the point [m]
    """

    u: float
    v: float
    thread_set: int
    crown: float
    height: float


class Track(NamedTuple):
    """A visible segment of thread that a march crosses; t is the distance from the origin [m].

    thread : int - index into `Fabric.threads`
    half : float - height of its surface above its axis, at the middle of its width [m]
    height : float - height of the march's origin above the `lift` of the thread's set [m]
    length : float - length of its visible run [m]
    s, s_t : float - the position along the run is s + s_t t
    w, w_t : float - the position across the thread is w + w_t t
    """

    thread: int
    half: float
    height: float
    length: float
    s: float
    s_t: float
    w: float
    w_t: float


@njit(**PART)
def steepest(cloth, highest, origin, dx, dy, k, first):
    """Slope of the steepest line from an `Origin` to the height field, at least `k`.

    Along the origin's own thread the march treats the thread as flat at its crown there: `f_s`
    already darkens the far side of a round thread, and g must not darken it again.

    highest : upper bound on the height of the field [m]
    dx, dy : unit direction on the cloth, in metres along U and V
    first : return at the first slope above `k`, which tells whether light at slope `k` is blocked
    """
    du, dv = dx / float(cloth.pitch[WARP]), dy / float(cloth.pitch[WEFT])
    nearest = NEAREST * min(float(cloth.pitch[WARP]), float(cloth.pitch[WEFT]))
    u, v = origin.u, origin.v
    end, pick = np.floor(u), np.floor(v)
    begin, asked = 0.0, k
    for _ in range(CELLS):
        to_end = ((end + 1.0 if du > 0.0 else end) - u) / du if du != 0.0 else np.inf
        to_pick = ((pick + 1.0 if dv > 0.0 else pick) - v) / dv if dv != 0.0 else np.inf
        leave = min(to_end, to_pick)
        k = _cross_cell(cloth, end, pick, origin, du, dv, max(begin, nearest), leave, k)
        if (first and k > asked) or leave * k > highest - origin.height:
            return k
        if to_end <= to_pick:
            end += 1.0 if du > 0.0 else -1.0
        else:
            pick += 1.0 if dv > 0.0 else -1.0
        begin = leave
    return k


@njit(**INLINE)
def _cross_cell(cloth, end, pick, origin, du, dv, t0, t1, k):
    """`steepest` over the visible threads of one cell, between the distances t0 and t1 [m]."""
    u, v, which, crown, h = origin
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
        start, cells = upper_run(np.float64, cloth, i, j, top)
        mine = own and which == top
        track = Track(
            above, crown if mine else float(cloth.half_height[top, above]),
            h - float(cloth.lift[top]),
            cells * float(crossing), (start + along) / cells, along_t / cells,
            2.0 * (over - 0.5) / width, 2.0 * over_t / width,
        )  # fmt: skip
        k = _cross_thread(cloth, 0 if mine else 1, track, a, b, k)
    seen = float(cloth.width[1 - top])
    if width < 1.0 and seen > 0.0 and cloth.pile[below] == 0:
        a0, b0 = _within(along, along_t, 0.5 - 0.5 * seen, 0.5 + 0.5 * seen, t0, t1)
        for side in range(2):
            if side == 0:
                a, b = _within(over, over_t, 0.0, low, a0, b0)
            else:
                a, b = _within(over, over_t, high, 1.0, a0, b0)
            start, cells, rises = lower_run(np.float64, cloth, i, j, top, float(side))
            mine = own and which != top
            track = Track(
                below, crown if mine else float(cloth.half_height[1 - top, below]),
                h - float(cloth.lift[1 - top]),
                rises * cells * float(below_crossing), (start + over) / cells, over_t / cells,
                2.0 * (along - 0.5) / seen, 2.0 * along_t / seen,
            )  # fmt: skip
            k = _cross_thread(cloth, 0 if mine else 1, track, a, b, k)
    return k


@njit(**INLINE)
def _within(x, x_t, low, high, t0, t1):
    """The part of [t0, t1] in which x + x_t t is in [low, high]; empty if its end is the
    smaller."""
    if x_t == 0.0:
        if low <= x <= high:
            return t0, t1
        return t0, t0 - 1.0
    a, b = (low - x) / x_t, (high - x) / x_t
    return max(t0, min(a, b)), min(t1, max(a, b))


@njit(**INLINE)
def _cross_thread(cloth, rounded, track, a, b, k):
    """`steepest` over a `Track` between the distances a and b [m]."""
    if not b > a:
        return k
    thread, s, s_t = track.thread, track.s, track.s_t
    pieces = cloth.curve_start.shape[1]
    for p in range(pieces):
        low = float(cloth.curve_start[thread, p])
        if low >= 1.0:
            break
        high = min(1.0, float(cloth.curve_start[thread, p + 1])) if p + 1 < pieces else 1.0
        # Extend the first and the last piece, so that rounding opens no seam at the ends of the
        # run.
        low = -1.0 if p == 0 else low
        high = 2.0 if high >= 1.0 else high
        t0, t1 = _within(s, s_t, low, high, a, b)
        if not t1 >= t0:
            continue
        k = max(k, _slope(cloth, rounded, track, p, t0))
        k = max(k, _slope(cloth, rounded, track, p, t1))
        if rounded != 0:
            t = _summit(cloth, track, p, t0, t1, k)
            k = max(k, _slope(cloth, rounded, track, p, t))
            continue
        bend = float(cloth.curve_slope[thread, p])
        if bend == 0.0 or s_t == 0.0 or track.length == 0.0:
            continue
        for _ in range(3):
            # The thread is highest above the line of slope k where it is parallel to the line.
            # Raising k to the slope found there is Newton's method for the tangent from the point.
            angle = -math.atan(k / (track.length * s_t))
            turn = (
                float(cloth.curve_start[thread, p])
                + (angle - float(cloth.curve_angle[thread, p])) / bend
            )
            t = (turn - s) / s_t
            if t <= t0 or t >= t1:
                break
            k = max(k, _slope(cloth, rounded, track, p, t))
    return k


@njit(**INLINE)
def _slope(cloth, rounded, track, p, t):
    """Slope from the origin to piece `p` of a `Track` at distance `t` [m]."""
    at = max(0.0, min(1.0, track.s + track.s_t * t))
    crown = track.half
    if rounded != 0:
        across = track.w + track.w_t * t
        crown *= math.sqrt(max(0.0, 1.0 - across * across))
    rise = rise_on(np.float64, cloth, track.thread, p, at)
    return (track.length * rise + crown - track.height) / t


@njit(**PART)
def _summit(cloth, track, p, t0, t1, k):
    """Distance [m] at which a round thread is highest above the line of slope `k`.

    Golden-section search is valid because crown and hump are both concave, so there is one summit.
    In a valley the highest points are the ends, which the caller tests as well.
    """
    low, high = t0, t1
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_left = (_slope(cloth, 1, track, p, left) - k) * left
    at_right = (_slope(cloth, 1, track, p, right) - k) * right
    for _ in range(16):
        if at_left > at_right:
            high, right, at_right = right, left, at_left
            left = high - _GOLDEN * (high - low)
            at_left = (_slope(cloth, 1, track, p, left) - k) * left
        else:
            low, left, at_left = left, right, at_right
            right = low + _GOLDEN * (high - low)
            at_right = (_slope(cloth, 1, track, p, right) - k) * right
    return 0.5 * (low + high)


def highest_point(fabric: Fabric, cloth: CompiledFabric) -> float:
    """Height [m] of the highest thread of the repeat, with half its thickness; 0 if all are pile.

    cloth : `fabric` compiled; its run tables are used

    Each type is tested with every length of visible run that it can have: a thread of the grid
    meets those places of the sequence that have the same remainder modulo their greatest common
    divisor.
    """
    found = 0.0
    peaks = [peak(t.curve) for t in fabric.thread_list]
    for which, sequence in ((WARP, fabric.warp.sequence), (WEFT, fabric.weft.sequence)):
        crossing = float(cloth.pitch[1 - which])
        for longest in _longest_runs(cloth, which):
            common = math.gcd(len(longest), len(sequence))
            for place, kind in enumerate(sequence):
                cells = longest[place % common :: common].max()
                if cloth.pile[kind] or cells < 0:
                    continue
                half = float(cloth.half_height[which, kind])
                rise = peaks[kind] * float(cells) * crossing
                found = max(found, rise + half + float(cloth.lift[which]))
    return found


def _longest_runs(cloth: CompiledFabric, which: int) -> list[NDArray[np.float64]]:
    """Longest visible run [cells] of each thread of a set, -1 where there is none.

    The first entry is for runs on top, the second for strips of hidden runs, which rise nowhere.
    """
    axis = 1 if which == WARP else 0
    on_top, rim = cloth.grid == which, float(cloth.rim[which])
    endless = float(cloth.grid.shape[axis])
    answer = []
    if cloth.width[which] > 0:
        count = cloth.runs[..., 0, 1].astype(np.float64)
        cells = np.where(count > 0, count + 2.0 * rim, endless)
        answer.append(np.where(on_top, cells, -1.0).max(axis=axis))
    if cloth.width[which] > 0 and rim > 0:
        answer.append(np.where(on_top, -1.0, 0.0).max(axis=axis))
    return answer


def height_field(
    fabric: Fabric, resolution: tuple[int, int], *, level: str = "weave"
) -> NDArray[np.float64]:
    """Heights [m] at the centres of `resolution` texels over one grid repeat, indexed [u, v].

    level : "weave" for threads that are flat across their width, or "thread" for round ones

    Gaps and pile have the height 0, which is the height of a straight thread's axis.
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
    half = cloth.half_height[np.minimum(hit.set, 1), hit.thread]
    height = hit.height + (hit.crown if rounded else half)
    hidden = hit.gap | (cloth.pile[hit.thread] != 0)
    field: NDArray[np.float64] = np.where(hidden, 0.0, height).reshape(resolution)
    return field


def level_is_round(level: str) -> int:
    """1 for level "thread", with round threads; 0 for level "weave", with flat ones."""
    if level not in ("weave", "thread"):
        raise FabricError("level", f"is '{level}'; it must be 'weave' or 'thread'")
    return int(level == "thread")
