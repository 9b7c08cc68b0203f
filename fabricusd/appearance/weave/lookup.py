"""The weave under a point: which thread, where on its run, where across it, at which angle.

Weave coordinates count threads: u in ends along +U, v in picks along +V, float64. They are split
into cell and fraction, and the cell reduced modulo the repeat, before anything is float32: at 10^4
repeats a float32 coordinate would miss the place inside the thread. Rules: `docs/model.md`
sections 1 and 3.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.coverage import GAP, coverage
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric, ThreadSet, Weave
from fabricusd.kernels.real import INLINE, KERNEL, PART, index

FARTHEST = 2.0**52
"""Weave coordinates beyond this have no fraction left in float64."""


BLOCK = 512
"""Places that a worker looks up at a time: what it notes about them stays in its nearest cache."""


class WeaveHit(NamedTuple):
    """What lies under each point. GAP and non-finite places hold zeros and NaN respectively.

    set : (n,) uint8 - WEFT, WARP or GAP
    thread : (n,) int32 - index into `Fabric.threads`
    position : (n,) float - s on the visible run, from 0 to below 1, growing with +U or +V
    across : (n,) float - w on the visible width, from -1 to 1, growing along `b = n_t x t`: along
        +V on the weft and along -U on the warp
    angle : (n,) float - tangent angle psi0 [rad]
    height : (n,) float - of the thread's axis over its ends [m]
    crown : (n,) float - what the thread's round adds to it at `across` [m]
    gap : (n,) bool - where no thread is seen
    """

    set: NDArray[np.uint8]
    thread: NDArray[np.int32]
    position: NDArray[Any]
    across: NDArray[Any]
    angle: NDArray[Any]
    height: NDArray[Any]
    crown: NDArray[Any]
    gap: NDArray[np.bool_]


@njit(**INLINE)
def wrap(x, period):
    """Whole number `x` (float64) modulo `period`, non-negative, as an integer."""
    p = float(period)
    r = x - p * np.floor(x / p)
    # The quotient is rounded: one period off either way where x is a multiple of it.
    r = r + p if r < 0.0 else r
    r = r - p if r >= p else r
    return np.int32(r)


@njit(**INLINE)
def whole_threads(u, v):
    """(end, pick, sound): whole parts of weave coordinates, float64; 0 where they are not sound."""
    sound = (abs(u) <= FARTHEST) & (abs(v) <= FARTHEST)
    return np.floor(u if sound else 0.0), np.floor(v if sound else 0.0), sound


@njit(**INLINE)
def cell_of(R, cloth, u, v):
    """(i, j, x, y): the cell of the grid and the place in it, as `split` gives them."""
    end, pick, sound = whole_threads(u, v)
    return (
        wrap(end, cloth.grid.shape[0]),
        wrap(pick, cloth.grid.shape[1]),
        R(u - end) if sound else R(np.nan),
        R(v - pick),
    )


@njit(**INLINE)
def split(R, cloth, u, v):
    """Weave coordinates, float64, as what `thread_at` asks for: (i, j, end, pick, x, y).

    i, j : cell of the grid; end, pick : places in the sequences of threads; x, y : in the cell, of
    precision R, NaN where the coordinates are not finite or have no fraction.
    """
    i, j, x, y = cell_of(R, cloth, u, v)
    end, pick, _ = whole_threads(u, v)
    return (
        i, j, wrap(end, cloth.sequence_length[WARP]), wrap(pick, cloth.sequence_length[WEFT]), x, y
    )  # fmt: skip


@njit(**INLINE)
def piece_of(R, cloth, thread, s):
    """Index of the linear piece of the thread's curve at `s`, the later one at a jump.

    Counting every start up to `s` beats a search on curves of a few pieces: it has no branches to
    mispredict. The table is padded to a power of two by starts beyond 1.
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
    k = piece_of(R, cloth, thread, s)
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
def height_on(R, cloth, thread, s, length):
    """Height [m] of the thread's axis at `s` on a visible run of `length` [m]; 0 on pile."""
    if cloth.pile[thread] != 0:
        return R(0)
    return length * rise_on(R, cloth, thread, piece_of(R, cloth, thread, s), s)


@njit(**INLINE)
def crown_on(R, cloth, thread_set, thread, w):
    """Height [m] that the round of the thread adds at `w`: half the thickness, sqrt(1 - w^2)."""
    return cloth.half_thickness[thread_set, thread] * math.sqrt(max(R(0), R(1) - w * w))


@njit(**INLINE)
def place_on(R, cloth, top, width, upper_place, upper_cells, lower_place, lower_cells, x, y):
    """(set or GAP, s, w, length in cells) of the thread seen at (x, y) in a cell with `top` above.

    width : visible width of the set on top; place and cells of the run above and of that below

    Selections instead of branches: which thread a point meets cannot be predicted.
    """
    warp = top == WARP
    over, along = (x, y) if warp else (y, x)
    offset = over - R(0.5)
    on_top = abs(offset) <= R(0.5) * width and width > R(0)
    beside = cloth.under == 1 - top and abs(along - R(0.5)) <= R(0.5) * cloth.under_width
    hit = top if on_top else 1 - top
    # Beside the thread on top, the visible stretches put together carry the whole curve.
    share = R(1) if on_top else R(1) - width
    seen = along if on_top else (over if offset < R(0) else over - width) / max(share, cloth.tiny)
    w = R(2) * (offset if on_top else along - R(0.5)) / (width if on_top else cloth.under_width)
    place, cells = (upper_place, upper_cells) if on_top else (lower_place, lower_cells)
    s = max(R(0), min((place + seen) / cells, cloth.last))
    # b, and with it w, runs along -U on the warp.
    w = max(R(-1), min(-w if hit == WARP else w, R(1)))
    return hit if on_top or beside else GAP, s, w, cells * share


@njit(**INLINE)
def thread_at(R, cloth, i, j, end, pick, x, y):
    """The thread at a place that `split` has found; the answer is `find`'s."""
    none = R(0)
    if not x >= none:
        nan = R(np.nan)
        return WEFT, 0, nan, nan, nan, nan
    top = int(cloth.grid[i, j])
    lower = cloth.runs.shape[2] - 1
    which, s, w, cells = place_on(
        R, cloth, top, cloth.width[top],
        R(cloth.runs[i, j, 0, 0]), R(cloth.runs[i, j, 0, 1]),
        R(cloth.runs[i, j, lower, 0]), R(cloth.runs[i, j, lower, 1]), x, y,
    )  # fmt: skip
    if which == GAP:
        return GAP, 0, none, none, none, none
    thread = int(cloth.sequence[which, end if which == WARP else pick])
    return which, thread, s, w, angle_on(R, cloth, thread, s), cells * cloth.pitch[1 - which]


@njit(**INLINE)
def find(R, cloth, u, v):
    """Thread under weave coordinates (u, v), float64.

    Returns (set, thread, s, w, angle, length): `length` is the visible run's own length [m], which
    `height_on` asks for. In a gap the set is GAP and the rest 0. Coordinates that are not finite,
    or that have no fraction, come back as set WEFT with NaN everywhere, so that nothing hides them.
    """
    i, j, end, pick, x, y = split(R, cloth, u, v)
    return thread_at(R, cloth, i, j, end, pick, x, y)


@njit(**PART)
def split_block(R, cloth, uv, begin, cells, x, y):
    """`split` of as many places from `begin` on as cells (4, b) int32, x and y (b,) hold.

    A loop of its own, which LLVM vectorises; the lookup behind it is all gathers.
    """
    for k in range(x.size):
        p = index(begin, k)
        cells[0, k], cells[1, k], cells[2, k], cells[3, k], x[k], y[k] = split(
            R, cloth, uv[p, 0], uv[p, 1]
        )


@njit(parallel=True, **KERNEL)
def find_all(R, cloth, uv, sets, threads, s, w, angle, length):
    """`find` at each of uv (n, 2) float64, into the arrays behind it."""
    n = uv.shape[0]
    for b in prange((n + BLOCK - 1) // BLOCK):
        begin, size = b * BLOCK, min(BLOCK, n - b * BLOCK)
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
    """`height_on` and `crown_on` at each hit, 0 in gaps, into `height` and `crown`."""
    for k in prange(sets.shape[0]):
        if sets[k] == GAP:
            height[k] = R(0)
            crown[k] = R(0)
        else:
            height[k] = height_on(R, cloth, threads[k], s[k], length[k])
            crown[k] = crown_on(R, cloth, sets[k], threads[k], w[k])


def lookup(cloth: Fabric | CompiledFabric, uv_threads: ArrayLike) -> WeaveHit:
    """The thread under each of (n, 2) weave coordinates, in threads.

    A `Fabric` is compiled for float64; a `CompiledFabric` answers in its own precision. The grain's
    rotation comes before: `Binding.weave_coordinates`. Raises `FabricError` for coordinates that
    are not finite or lie farther than 2^52 threads out, where float64 has no fraction left.
    """
    if isinstance(cloth, Fabric):
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
    find_all(real, cloth, uv, sets, threads, s, w, angle, length)
    heights_all(real, cloth, sets, threads, s, w, length, height, crown)
    return WeaveHit(sets, threads, s, w, angle, height, crown, sets == GAP)


NO_THREAD = -1
"""Number of a place where no thread is seen, or none alone."""


def thread_number(which: NDArray[Any], thread: NDArray[Any], types: int) -> NDArray[np.int64]:
    """(n,) number of the thread that is seen: the index of its type for weft, that plus `types` for
    warp, NO_THREAD for a gap. It tells the sets apart where they share a yarn.

    which, thread : (n,) set and type, as `WeaveHit` has them
    types : how many threads the fabric on that side has

    Map `thread_id` of a bake and layer `thread` of a picture hold this number.
    """
    number = thread.astype(np.int64) + types * (which == WARP)
    return np.where(which == GAP, NO_THREAD, number)


def back_of(fabric: Fabric) -> Fabric:
    """The other side of the cloth, as a fabric that is looked up at (u, -v).

    The fabric's own `back` where it names one. Otherwise the same threads on a grid mirrored in V
    and complemented, with the picks counted the other way. What the two sets cover is exchanged
    with the cells that they show, so that the gap is the same from both sides: a hole is a hole.
    """
    if fabric.back is not None:
        return fabric.back
    share = coverage(fabric)
    cells = ~fabric.weave.cells[:, ::-1]
    name = fabric.weave.name
    front_name = name.removesuffix(" (back)")
    return Fabric(
        name=fabric.name,
        threads=fabric.threads,
        weave=Weave(cells, front_name if front_name != name else f"{name} (back)"),
        warp=ThreadSet(
            sequence=fabric.warp.sequence,
            density=fabric.warp.density,
            coverage=float(share.area[WEFT]),
        ),
        weft=ThreadSet(
            sequence=fabric.weft.sequence[::-1],
            density=fabric.weft.density,
            coverage=float(share.area[WARP]),
        ),
        model=fabric.model,
        opaque=fabric.opaque,
        masking_width=fabric.masking_width,
        documentation=fabric.documentation,
    )
