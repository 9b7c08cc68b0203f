"""Look up the thread under a point: its set, type, position along and across it, and angle.

Weave coordinates count threads in float64: u in ends along +U, v in picks along +V. They are split
into cell and fraction, and the cell is reduced modulo the repeat, before anything is converted to
float32: at 10^4 repeats a float32 coordinate would not resolve the place inside a thread. The rules
are in `docs/model.md`, sections 1 and 3.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.bands import band_areas
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.coverage import GAP, coverage
from fabricusd.appearance.weave.place import Places
from fabricusd.appearance.weave.yarn.compiled import Yarn, compile_yarn
from fabricusd.appearance.weave.yarn.lay import crest, laid, strands_all
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, Weave
from fabricusd.kernels.real import INLINE, KERNEL, PART, index

FARTHEST = 2.0**52
"""Weave coordinates beyond this have no fractional part in float64."""


_CHUNK = 512
"""Number of places that a worker takes at a time: their intermediate results stay in its
first-level cache."""


class WeaveHit(NamedTuple):
    """What lies under each point. The entries of GAP places are 0, those of non-finite places NaN.

    set : (n,) uint8 - WEFT, WARP or GAP
    thread : (n,) int32 - index into `Fabric.threads`
    position : (n,) float - s on the visible run, from 0 to below 1, growing with +U or +V
    across : (n,) float - w on the visible width, from -1 to 1, growing along `b = n_t x t`: along
        +V on the weft and along -U on the warp
    angle : (n,) float - tangent angle psi0 [rad]
    height : (n,) float - height of the thread's axis above the ends of the run [m]
    crown : (n,) float - height of the round thread's surface above its axis at `across` [m]
    gap : (n,) bool - whether no thread is seen
    number : (n,) int64 - of the thread in its set, from the corner of the cloth
    strand : (n,) float - position across the strand that is seen, of a thread of plies; else w
    shade : (n,) float - factor of the thread's albedo; (0,) where that is 1 everywhere
    even_uv : (n, 2) float64 - the place of the even cloth that looks as this one does [threads]
    """

    set: NDArray[np.uint8]
    thread: NDArray[np.int32]
    position: NDArray[Any]
    across: NDArray[Any]
    angle: NDArray[Any]
    height: NDArray[Any]
    crown: NDArray[Any]
    gap: NDArray[np.bool_]
    number: NDArray[np.int64]
    strand: NDArray[Any]
    shade: NDArray[Any]
    even_uv: NDArray[np.float64]

    @property
    def places(self) -> Places:
        """The hits as the kernels of the surface laws take them, in the precision of the lookup."""
        return Places(self.set, self.thread, self.angle, self.strand, self.shade)


@njit(**INLINE)
def wrap(x, period):
    """Whole number `x` (float64) modulo `period`, as a non-negative integer."""
    p = float(period)
    r = x - p * np.floor(x / p)
    # The quotient is rounded, so r can be off by one period if x is a multiple of the period.
    r = r + p if r < 0.0 else r
    r = r - p if r >= p else r
    return np.int32(r)


@njit(**INLINE)
def whole_threads(u, v):
    """(end, pick, sound): whole parts of weave coordinates (float64); 0 if they are not sound.

    Coordinates are sound if they are finite and at most FARTHEST.
    """
    sound = (abs(u) <= FARTHEST) & (abs(v) <= FARTHEST)
    return np.floor(u if sound else 0.0), np.floor(v if sound else 0.0), sound


@njit(**INLINE)
def cell_of(R, cloth, u, v):
    """(i, j, x, y): the cell of the grid and the place in it, as in `split`."""
    end, pick, sound = whole_threads(u, v)
    return (
        wrap(end, cloth.grid.shape[0]),
        wrap(pick, cloth.grid.shape[1]),
        R(u - end) if sound else R(np.nan),
        R(v - pick),
    )


@njit(**INLINE)
def split(R, cloth, u, v):
    """Weave coordinates (float64) split into the arguments of `thread_at`: (i, j, end, pick, x, y).

    i, j : cell of the grid
    end, pick : places in the sequences of threads
    x, y : place in the cell, of precision R; x is NaN if the coordinates are not sound
    """
    i, j, x, y = cell_of(R, cloth, u, v)
    end, pick, _ = whole_threads(u, v)
    return (
        i, j, wrap(end, cloth.sequence_length[WARP]), wrap(pick, cloth.sequence_length[WEFT]), x, y
    )  # fmt: skip


@njit(**INLINE)
def piece_of(R, cloth, thread, s):
    """Index of the linear piece of the thread's curve at `s`, and of the later one at a jump.

    On curves of a few pieces, counting the starts up to `s` is faster than a binary search, because
    it has no branches to mispredict. Starts beyond 1 pad the table to a power of two.
    """
    k, pieces = 0, cloth.curve_start.shape[1]
    if pieces <= 32:
        for p in range(1, pieces):
            k += int(s >= cloth.curve_start[thread, p])
        return k
    step = pieces >> 1
    while step > 0:
        k += step if s >= cloth.curve_start[thread, k + step] else 0
        step >>= 1
    return k


@njit(**INLINE)
def angle_on(R, cloth, thread, s):
    """Tangent angle [rad] of thread type `thread` at `s`."""
    return angle_of(R, cloth, thread, piece_of(R, cloth, thread, s), s)


@njit(**INLINE)
def angle_of(R, cloth, thread, k, s):
    """`angle_on` where `s` is on piece `k` of the curve."""
    return (
        cloth.curve_angle[thread, k]
        + (s - cloth.curve_start[thread, k]) * cloth.curve_slope[thread, k]
    )


@njit(**INLINE)
def rise_on(R, cloth, thread, k, s):
    """Height at `s` on linear piece `k` of the thread's curve, in run lengths.

    Minus the integral of tan(angle), in closed form as `curve._rise`.
    """
    part = s - cloth.curve_start[thread, k]
    first = cloth.curve_angle[thread, k]
    slope = cloth.curve_slope[thread, k]
    change = part * slope
    if abs(change) < R(1e-3):
        # Second-order Taylor about the middle: the logarithms would cancel in float32.
        tangent = math.tan(first + R(0.5) * change)
        rise = -part * tangent * (R(1) + change * change * (R(1) + tangent * tangent) / R(12))
    else:
        ratio = R(-2) * math.sin(first + R(0.5) * change) * math.sin(R(0.5) * change)
        rise = math.log1p(ratio / math.cos(first)) / slope
    return cloth.curve_height[thread, k] + rise


@njit(**INLINE)
def height_on(R, cloth, thread_set, thread, s, length):
    """Height [m] of the thread's axis at `s` on a visible run of `length` [m]; 0 on pile."""
    if cloth.pile[thread] != 0:
        return R(0)
    rise = length * rise_on(R, cloth, thread, piece_of(R, cloth, thread, s), s)
    return rise + cloth.lift[thread_set]


@njit(**INLINE)
def crown_on(R, cloth, thread_set, thread, w):
    """Height [m] of a round thread above its axis at `w`: half its height times sqrt(1 - w^2)."""
    return cloth.half_height[thread_set, thread] * math.sqrt(max(R(0), R(1) - w * w))


@njit(**INLINE)
def upper_run(R, cloth, i, j, top):
    """(start, cells) of the thread on top in a cell: at `along` it is at s = (start + along)/cells.

    cells : length of the visible run, its ends beyond its cells included
    """
    return seen_run(
        R, cloth.rim[top], cloth.grid.shape[1 if top == WARP else 0],
        R(cloth.runs[i, j, 0, 0]), R(cloth.runs[i, j, 0, 1]),
    )  # fmt: skip


@njit(**INLINE)
def seen_run(R, rim, around, place, count):
    """`upper_run` from what the tables hold.

    rim : of the set on top; around : cells of the repeat along it
    place, count : of the run; a count of 0 says that it has no end
    """
    ended = count > R(0)
    return place + (rim if ended else R(0)), count + R(2) * rim if ended else R(around)


@njit(**INLINE)
def lower_run(R, cloth, i, j, top, over):
    """(start, cells, rises): the run of the thread underneath at `over` along it.

    Beside the thread on top it shows the end of its own visible run in the cell before or behind;
    start and cells are those of `upper_run`.
    Between two threads that both lie over it there is a strip that belongs to no such run: the
    strips of a hidden run, put together, carry the whole curve once. They rise nowhere.

    rises : 1 on a visible run, 0 on a strip
    """
    which = 1 - top
    slot, ahead = cloth.runs.shape[2] - 1, over > R(0.5)
    ends, picks = cloth.grid.shape
    step = 1 if ahead else -1
    # A neighbour of the cell, wrapped around the repeat.
    i_next = wrapped(i + (step if which == WEFT else 0), ends)
    j_next = wrapped(j + (step if which == WARP else 0), picks)
    return hidden_run(
        R, cloth.rim[which], cloth.tiny, picks if which == WARP else ends, ahead,
        R(cloth.runs[i, j, slot, 0]), R(cloth.runs[i, j, slot, 1]),
        R(cloth.runs[i_next, j_next, 0, 1]),
    )  # fmt: skip


@njit(**INLINE)
def hidden_run(R, rim, tiny, around, ahead, place, count, beyond):
    """`lower_run` from what the tables hold.

    rim : of the set underneath; around : cells of the repeat along it
    ahead : whether the place is beyond the thread on top, not before it
    place, count : of the hidden run; beyond : cells of the visible run beside it

    The code selects instead of branching, as in `place_on`.
    """
    ended = count > R(0)
    on_run = ended and place == (count - R(1) if ahead else R(0))
    # Strips 2 rim wide: of a run with an end, the first is that behind the first cell.
    endless_start = R(2) * rim - R(1) if ahead else R(0)
    first = (rim - R(1) if ahead else -rim) if ended else endless_start
    strips = max(R(2) * rim * (count - R(1) if ended else R(around)), tiny)
    start = (rim - R(1) if ahead else beyond + rim) if on_run else R(2) * rim * place + first
    return start, beyond + R(2) * rim if on_run else strips, R(1) if on_run else R(0)


@njit(**INLINE)
def wrapped(k, count):
    """`k` from -1 to `count` as an index of a ring of `count`."""
    k = count - 1 if k < 0 else k
    return 0 if k >= count else k


@njit(**INLINE)
def place_on(R, cloth, top, width, other, upper_start, upper_cells, lower_start, lower_cells, x, y):
    """(set or GAP, s, w, length in cells) of the thread seen at (x, y) in a cell with `top` above.

    width, other : `CompiledFabric.width` of the set on top and of the other one
    upper_start, upper_cells, lower_start, lower_cells : what `upper_run` and `lower_run` give

    The code selects instead of branching, because it cannot be predicted which thread a point
    meets.
    """
    warp = top == WARP
    over, along = (x, y) if warp else (y, x)
    offset, aside = over - R(0.5), along - R(0.5)
    on_top = abs(offset) <= R(0.5) * width and width > R(0)
    beside = abs(aside) <= R(0.5) * other and other > R(0)
    hit = top if on_top else 1 - top
    seen = upper_start + along if on_top else lower_start + over
    cells = upper_cells if on_top else lower_cells
    w = R(2) * (offset if on_top else aside) / max(width if on_top else other, cloth.tiny)
    s = max(R(0), min(seen / cells, cloth.last))
    # The direction b of increasing w is along -U on the warp.
    w = max(R(-1), min(-w if hit == WARP else w, R(1)))
    return hit if on_top or beside else GAP, s, w, cells


@njit(**INLINE)
def thread_at(R, cloth, i, j, end, pick, x, y):
    """The result of `find` for coordinates that `split` has split."""
    none = R(0)
    if not x >= none:
        nan = R(np.nan)
        return WEFT, 0, nan, nan, nan, nan
    top = int(cloth.grid[i, j])
    upper_start, upper_cells = upper_run(R, cloth, i, j, top)
    lower_start, lower_cells, rises = lower_run(R, cloth, i, j, top, x if top == WARP else y)
    which, s, w, cells = place_on(
        R, cloth, top, cloth.width[top], cloth.width[1 - top],
        upper_start, upper_cells, lower_start, lower_cells, x, y,
    )  # fmt: skip
    if which == GAP:
        return GAP, 0, none, none, none, none
    thread = int(cloth.sequence[which, end if which == WARP else pick])
    return (
        which,
        thread,
        s,
        w,
        angle_on(R, cloth, thread, s),
        cells * cloth.pitch[1 - which] * (R(1) if which == top else rises),
    )


@njit(**INLINE)
def find(R, cloth, u, v):
    """The thread under weave coordinates (u, v), float64.

    Returns (set, thread, s, w, angle, length); `length` is the length of the visible run [m], which
    `height_on` needs. In a gap the set is GAP and the other values are 0. Coordinates that are not
    finite, or that have no fractional part, give the set WEFT with NaN in all real values, so that
    the fault stays visible.
    """
    i, j, end, pick, x, y = split(R, cloth, u, v)
    return thread_at(R, cloth, i, j, end, pick, x, y)


@njit(**PART)
def split_block(R, cloth, uv, begin, cells, x, y):
    """`split` of the places from `begin` on, into cells (4, b) int32 and x, y (b,).

    This is a separate loop because LLVM vectorises it; the lookup that follows consists of gathers.
    """
    for k in range(x.size):
        p = index(begin, k)
        cells[0, k], cells[1, k], cells[2, k], cells[3, k], x[k], y[k] = split(
            R, cloth, uv[p, 0], uv[p, 1]
        )


@njit(parallel=True, **KERNEL)
def find_all(R, cloth, uv, sets, threads, s, w, angle, length):
    """`find` at each of uv (n, 2) float64, into the (n,) arrays that follow."""
    n = uv.shape[0]
    for chunk in prange((n + _CHUNK - 1) // _CHUNK):
        begin, size = chunk * _CHUNK, min(_CHUNK, n - chunk * _CHUNK)
        cells = np.empty((4, size), np.int32)
        x, y = np.empty(size, s.dtype), np.empty(size, s.dtype)
        split_block(R, cloth, uv, begin, cells, x, y)
        for q in range(size):
            k = begin + q
            sets[k], threads[k], s[k], w[k], angle[k], length[k] = thread_at(
                R, cloth, cells[0, q], cells[1, q], cells[2, q], cells[3, q], x[q], y[q]
            )


@njit(parallel=True, **KERNEL)
def heights_all(R, cloth, sets, threads, s, w, length, height, crown):
    """`height_on` and `crown_on` at each hit, into `height` and `crown`; 0 in gaps."""
    for k in prange(sets.shape[0]):
        if sets[k] == GAP:
            height[k] = R(0)
            crown[k] = R(0)
        else:
            height[k] = height_on(R, cloth, sets[k], threads[k], s[k], length[k])
            crown[k] = crown_on(R, cloth, sets[k], threads[k], w[k])


@njit(parallel=True, **KERNEL)
def crests_all(R, cloth, yarn, uv, sets, threads, numbers, s, length, angle):
    """Move the places along the threads that are seen there by `move_along`; uv, s and angle are
    written.

    uv : (n, 2) - places on the even cloth; numbers : (n, 2) int64 as in `Laid`; the others are what
        `find_all` gives there
    """
    for k in prange(uv.shape[0]):
        which = int(sets[k])
        if which != GAP and length[k] > R(0):
            axis = 1 if which == WARP else 0
            uv[k, axis], s[k], angle[k] = move_along(
                R, cloth, yarn, which, threads[k], numbers[k, which], s[k], length[k], uv[k, axis]
            )


@njit(**INLINE)
def move_along(R, cloth, yarn, which, thread, number, s, length, place):
    """(place, s, angle) at which the even thread is as steep as an uneven one is at `s` of a run.

    number : of the thread; length : of the run [m]; place : where s lies along the thread of the
        even cloth [cells], float64
    """
    cells = length / R(yarn.cell[which])
    moved = min(crest(R, yarn, which, thread, number, s, cells, place), cloth.last)
    return (
        place + float((moved - s) * cells),
        moved,
        angle_on(R, cloth, thread, moved),
    )


def lookup(
    cloth: Fabric | CompiledFabric, uv_threads: ArrayLike, yarn: Yarn | None = None
) -> WeaveHit:
    """The thread under each of (n, 2) weave coordinates, in threads.

    A `Fabric` is compiled for float64, its yarn included; with a `CompiledFabric` the result has
    its precision, and its threads are even unless `yarn` says how they are not. The
    coordinates must already include the rotation of the grain: `Binding.weave_coordinates`. Raises
    `FabricError` for coordinates that are not finite or lie beyond 2^52 threads, where float64 has
    no fractional part.
    """
    if isinstance(cloth, Fabric):
        yarn = compile_yarn(cloth, precision=np.float64) if cloth.is_uneven else None
        cloth = compile_fabric(cloth, precision=np.float64)
    uv = np.ascontiguousarray(uv_threads, np.float64)
    if uv.ndim != 2 or uv.shape[1] != 2:
        raise FabricError("uv_threads", f"has shape {uv.shape}; it must be (n, 2)")
    bad = ~(np.abs(uv) <= FARTHEST).all(axis=1)
    if bad.any():
        k = int(np.argmax(bad))
        raise FabricError(
            "uv_threads",
            f"has {int(bad.sum())} of {len(uv)} places that are not finite or too far out, the "
            f"first at {k}: {uv[k].tolist()}; they must be within 2^52 threads",
        )
    real = cloth.curve_start.dtype.type
    n = len(uv)
    sets, threads = np.empty(n, np.uint8), np.empty(n, np.int32)
    s, w, angle, length, height, crown = (np.empty(n, real) for _ in range(6))
    if yarn is None:
        places, numbers = uv, np.floor(uv[:, ::-1]).astype(np.int64)
    else:
        places, numbers, shades = laid(yarn, uv)
    find_all(real, cloth, places, sets, threads, s, w, angle, length)
    strand, shade = w, np.empty(0, real)
    on = np.arange(n), (sets == WARP).astype(np.intp)
    if yarn is not None:
        crests_all(real, cloth, yarn, places, sets, threads, numbers, s, length, angle)
        strand, shade = np.empty(n, real), shades[on].astype(real)
        strands_all(real, yarn, uv, sets, threads, numbers, w, strand)
    heights_all(real, cloth, sets, threads, s, w, length, height, crown)
    return WeaveHit(
        sets, threads, s, w, angle, height, crown, sets == GAP, numbers[on], strand, shade, places
    )


NO_THREAD = -1
"""Thread number of a place where no thread, or not exactly one, is seen."""


def thread_number(which: NDArray[Any], thread: NDArray[Any], types: int) -> NDArray[np.int64]:
    """(n,) number of the visible thread: its type for weft, type + `types` for warp, or NO_THREAD.

    The number distinguishes the sets even if they share a yarn. The map `thread_id` of a bake and
    the layer `thread` of a picture hold it. In a gap it is NO_THREAD.

    which, thread : (n,) set and type, as in `WeaveHit`
    types : number of thread types of the fabric on that side
    """
    number = thread.astype(np.int64) + types * (which == WARP)
    return np.where(which == GAP, NO_THREAD, number)


def back_of(fabric: Fabric) -> Fabric:
    """The other side of the cloth, as a fabric that is looked up at (u, -v).

    This is the fabric's own `back` if it names one. Otherwise it has the same threads on a grid
    that is mirrored in V and complemented, with the picks in reverse order. Its threads are as wide
    as those of the front, so the gap is the same from both sides.
    """
    if fabric.back is not None:
        return fabric.back
    share = coverage(fabric)
    area = band_areas(share.cells[::-1], share.width)
    cells = ~fabric.weave.cells[:, ::-1]
    name = fabric.weave.name
    front_name = name.removesuffix(" (back)")
    # What is not named here, the surface law among it, is that of the front.
    return replace(
        fabric,
        weave=Weave(cells, front_name if front_name != name else f"{name} (back)"),
        warp=replace(fabric.warp, coverage=float(area[WARP])),
        weft=replace(fabric.weft, sequence=fabric.weft.sequence[::-1], coverage=float(area[WEFT])),
    )
