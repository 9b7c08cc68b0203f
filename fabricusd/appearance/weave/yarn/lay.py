"""Lay uneven threads: a map of the weave's coordinates to those of the even cloth.

Where a thread is thick, its edges part; where threads touch, the border between them moves; where
there is a gap, threads stray into it. The map
takes a place of the cloth to the place of the even cloth at which the same thread is seen, as far
across it; all that is known of a place of the even cloth is then looked up there. Across a set the
map is linear in pieces: thread to thread, gap to gap. A thread is 1 + e times as wide, with e of
mean 0 and independent of the threads that cross it, so the even cloth's areas are kept on average,
and with them every mean over the repeat.

Places count from the front's corner in true numbers of threads, which no repeat folds.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.weave.coverage import WARP, WEFT
from fabricusd.appearance.weave.yarn.compiled import (
    ASTRAY,
    COUNT,
    CREST,
    MOST,
    OF_WIDTH,
    OWN,
    RATE,
    SHADE,
    SHARED,
    SLUB,
    SLUB_HALF,
    SLUB_MEAN,
    SLUB_RATE,
    SPREAD,
    STRANDS,
    WIDTH,
    WINDING,
    Yarn,
)
from fabricusd.appearance.weave.yarn.noise import (
    VARIANCE,
    along,
    between,
    first,
    hashed,
    second,
    third,
)
from fabricusd.kernels.real import BLOCK, INLINE, KERNEL, PART, index

FARTHEST = 2.0**29
"""Threads, and distances of a noise's lattice, beyond which cloth is even: an int32 counts them."""

_U = np.uint32
_SHADE_ALONG = 1.0 / float(np.sqrt(VARIANCE))
_SHADE_BETWEEN = float(np.sqrt(3.0))


class Lateral(NamedTuple):
    """The thread of a set at a place. number : int32 - true number; place : real - in [0, 1), where
    it lies in the cell of the even cloth; shade : real - factor of its albedo, of mean 1."""

    number: Any
    place: Any
    shade: Any


class Spun(NamedTuple):
    """The columns of `Yarn.rows` that say how a thread varies, as numbers: a loop can keep them."""

    rate: Any
    width: Any
    count: Any
    shade: Any
    slub: Any
    slub_rate: Any
    slub_half: Any
    slub_mean: Any


class Lane(NamedTuple):
    """What holds for all threads of a set: columns of `Yarn.sets`, its seed, and whether any of its
    threads has slubs."""

    width: Any
    own: Any
    shared: Any
    most: Any
    astray: Any
    seed: Any
    slubs: bool


@njit(**INLINE)
def type_of(yarn, which, number):
    """Thread type of a set's thread."""
    length = yarn.sequence_length[which]
    if length == 1:
        return yarn.sequence[which, 0]
    return yarn.sequence[which, np.uintp(number % length)]


@njit(**INLINE)
def spun_of(yarn, which, kind):
    """The `Spun` of a thread type in a set."""
    row = yarn.rows[which, kind]
    return Spun(
        row[RATE], row[WIDTH], row[COUNT], row[SHADE], row[SLUB], row[SLUB_RATE], row[SLUB_HALF],
        row[SLUB_MEAN],
    )  # fmt: skip


@njit(**INLINE)
def lane_of(yarn, which):
    """The `Lane` of a set."""
    row = yarn.sets[which]
    return Lane(
        row[OF_WIDTH], row[OWN], row[SHARED], row[MOST], row[ASTRAY], yarn.seed[which],
        yarn.slubs[which] != 0,
    )  # fmt: skip


@njit(**INLINE)
def thickness(R, spun, seed, slubs, number, metres, blur):
    """(e, aside, shade) of thread `number` (int32) at `metres` (float64) along it.

    e : its width is 1 + e times that of the even thread
    aside : where it lies between its neighbours, in the same units; shade : factor of its albedo
    blur : extent of the footprint along the thread [m], which evens the noise out
    """
    key = hashed(seed, number)
    wide, light, beside = along(R, key, metres * spun.rate)
    count, tone, place = between(R, seed, number)
    f = blur * spun.rate
    sharp = R(1) / (R(1) + f * f)
    e = sharp * spun.width * wide + spun.count * count
    aside = sharp * spun.width * beside + spun.count * place
    if slubs:
        e += _slub(R, spun, key, metres, blur)
    shade = R(1) + spun.shade * (sharp * R(_SHADE_ALONG) * light + R(_SHADE_BETWEEN) * tone)
    return e, aside, shade


@njit(**INLINE)
def _slub(R, spun, key, metres, blur):
    """Change of the width by slubs: one in each cell of the slubs' distance, anywhere inside it."""
    x = metres * spun.slub_rate + float(R(np.int32(key >> _U(16)))) * 2.0**-15
    whole = np.floor(x)
    n = np.int32(whole)
    pair, own = hashed(_U(~key), np.int32(n >> 1)), hashed(_U(key ^ _U(0x5BD1E995)), n)
    tall = R(1) + R(SPREAD) * (R(1) - R(2) * R(np.int32(n & 1))) * first(R, pair)
    half = max(spun.slub_half, R(1e-6))
    d = (R(x - whole) - R(0.5) - (R(0.5) - half) * second(R, own)) / half
    rest = max(R(0), R(1) - d * d)
    g = blur * spun.slub_rate / half
    return (spun.slub * tall * rest * rest - spun.slub_mean) / (R(1) + R(0.25) * g * g)


@njit(**INLINE)
def _moved(R, lane, difference):
    """How far the border of two threads moves [cells]: an odd function, which keeps its mean 0."""
    x = lane.shared * difference
    return x * lane.most / np.sqrt(max(lane.most * lane.most + x * x, R(1e-30)))


@njit(**INLINE)
def apart(R, lane, e, aside, left, right, y):
    """Where y [cells] in the cell of a thread lies in the cell of the even thread, in [0, 1).

    e, aside : of `thickness`; left, right : how far the borders of its cell have moved [cells]
    """
    half, out = R(0.5) * lane.width, R(0.5) * (right - left)
    grown = half * (R(1) + lane.own * e) + out
    astray = lane.astray * aside
    d = y - R(0.5) - R(0.5) * (right + left) - astray
    a = abs(d)
    inside = d * (half / max(grown, R(1e-6)))
    room = R(0.5) + out - grown - (astray if d > R(0) else -astray)
    beyond = half + min(R(1), (a - grown) / max(room, R(1e-6))) * (R(0.5) - half)
    d = inside if a <= grown else (beyond if d > R(0) else -beyond)
    return min(max(d + R(0.5), R(0)), R(0.9999999))


@njit(**INLINE)
def lateral_loose(R, spun, lane, slubs, across, metres, blur):
    """The `Lateral` of a set whose threads all have room, at `across` [threads, float64]."""
    whole = np.floor(across)
    number = np.int32(whole)
    e, aside, shade = thickness(R, spun, lane.seed, slubs, number, metres, blur)
    y = apart(R, lane, e, aside, R(0), R(0), R(across - whole))
    return Lateral(number, y, shade)


@njit(**INLINE)
def lateral_tight(R, spun, lane, slubs, across, metres, blur):
    """The `Lateral` of a set whose threads move their borders."""
    whole = np.floor(across)
    number, y = np.int32(whole), R(across - whole)
    before = y < R(0.5)
    step = np.int32(-1) if before else np.int32(1)
    sign = R(-1) if before else R(1)
    mine = thickness(R, spun, lane.seed, slubs, number, metres, blur)
    near = thickness(R, spun, lane.seed, slubs, np.int32(number + step), metres, blur)
    border = _moved(R, lane, sign * (mine[0] - near[0]))
    beyond = y < border if before else y >= R(1) + border
    # The other border of the thread that is seen, be it this one or its neighbour.
    further = np.int32(number + 2 * step) if beyond else np.int32(number - step)
    rest = thickness(R, spun, lane.seed, slubs, further, metres, blur)
    other = _moved(R, lane, sign * ((near[0] - rest[0]) if beyond else (rest[0] - mine[0])))
    low = before != beyond
    left, right = (border if low else other), (other if low else border)
    e = near[0] if beyond else mine[0]
    aside = near[1] if beyond else mine[1]
    shade = near[2] if beyond else mine[2]
    y = y - sign if beyond else y
    seen = np.int32(number + step) if beyond else number
    return Lateral(seen, apart(R, lane, e, aside, left, right, y), shade)


@njit(**INLINE)
def lateral_mixed(R, yarn, which, lane, across, metres, blur):
    """The `Lateral` of a set with threads of several types."""
    whole = np.floor(across)
    number, y = np.int32(whole), R(across - whole)
    step = np.int32(-1) if y < R(0.5) else np.int32(1)
    mine, near, rest = (R(0), R(0), R(1)), (R(0), R(0), R(1)), (R(0), R(0), R(1))
    mine = _of_number(R, yarn, which, lane, number, metres, blur)
    left, right = R(0), R(0)
    if lane.shared > R(0):
        near = _of_number(R, yarn, which, lane, np.int32(number + step), metres, blur)
        border = _moved(R, lane, R(step) * (mine[0] - near[0]))
        if y < border if step < 0 else y >= R(1) + border:
            number, y, mine, near = np.int32(number + step), y - R(step), near, mine
            step = np.int32(-step)
        rest = _of_number(R, yarn, which, lane, np.int32(number - step), metres, blur)
        other = _moved(R, lane, R(step) * (rest[0] - mine[0]))
        left, right = (border, other) if step < 0 else (other, border)
    return Lateral(number, apart(R, lane, mine[0], mine[1], left, right, y), mine[2])


@njit(**INLINE)
def _of_number(R, yarn, which, lane, number, metres, blur):
    spun = spun_of(yarn, which, type_of(yarn, which, number))
    return thickness(R, spun, lane.seed, lane.slubs, number, metres, blur)


EVENLY = Lateral(np.int32(0), np.float32(0), np.float32(1))
"""In place of a thread where no yarn is read; in float32."""


@njit(**INLINE)
def lay_at(R, yarn, u, v, blur):
    """(warp, weft): the `Lateral` of both sets at one place of the front, which is sound.

    blur : extent of the footprint [m]
    """
    warp = lateral_mixed(R, yarn, WARP, lane_of(yarn, WARP), u, v * yarn.cell[WARP], blur)
    weft = lateral_mixed(R, yarn, WEFT, lane_of(yarn, WEFT), v, u * yarn.cell[WEFT], blur)
    return warp, weft


IN_CELL, TONE = 0, 2 * BLOCK
"""Rows of reals, of either set, weft first: the place in the cell of the even cloth, and the factor
of the albedo. The numbers of the threads are two rows of int32."""
DOUBLE_ROWS, REAL_ROWS, INT_ROWS = 2, 4, 2


@njit(**PART)
def lateral_block(R, yarn, which, size, across, metres, blur, numbers, cells, tones):
    """The `Lateral` of a set at `size` places, whose coordinates are sound, into the last three
    arrays."""
    lane = lane_of(yarn, which)
    spun = spun_of(yarn, which, yarn.sequence[which, 0])
    # The flags are constants of the loops, which LLVM vectorises.
    if yarn.alike[which] == 0:
        for x in range(size):
            k = index(0, x)
            numbers[k], cells[k], tones[k] = lateral_mixed(
                R, yarn, which, lane, across[k], metres[k], blur[k]
            )
    elif lane.shared > R(0):
        if lane.slubs:
            for x in range(size):
                k = index(0, x)
                numbers[k], cells[k], tones[k] = lateral_tight(
                    R, spun, lane, True, across[k], metres[k], blur[k]
                )
        else:
            for x in range(size):
                k = index(0, x)
                numbers[k], cells[k], tones[k] = lateral_tight(
                    R, spun, lane, False, across[k], metres[k], blur[k]
                )
    elif lane.slubs:
        for x in range(size):
            k = index(0, x)
            numbers[k], cells[k], tones[k] = lateral_loose(
                R, spun, lane, True, across[k], metres[k], blur[k]
            )
    else:
        for x in range(size):
            k = index(0, x)
            numbers[k], cells[k], tones[k] = lateral_loose(
                R, spun, lane, False, across[k], metres[k], blur[k]
            )


@njit(**INLINE)
def sound(u, v):
    """Whether weave coordinates are finite, and near enough that an int32 counts the threads."""
    return (abs(u) <= FARTHEST) & (abs(v) <= FARTHEST)


@njit(**PART)
def lay_block(R, yarn, u, v, blur, size, doubles, reals, ints):
    """Both sets at `size` places u, v (b,) float64 of the front, into the rows of `reals`, `ints`.

    blur : (b,) real - extent of the footprint [m]
    """
    across, metres = doubles[:BLOCK], doubles[BLOCK:]
    for which in range(2):
        cell = yarn.cell[which]
        for x in range(size):
            k = index(0, x)
            fine = sound(u[k], v[k])
            length = v[k] if which == WARP else u[k]
            across[k] = (u[k] if which == WARP else v[k]) if fine else 0.0
            metres[k] = length * cell if fine else 0.0
        row = which * BLOCK
        lateral_block(
            R, yarn, which, size, across, metres, blur, ints[row:], reals[IN_CELL + row :],
            reals[TONE + row :],
        )  # fmt: skip


@njit(**INLINE)
def crest(R, yarn, which, thread, number, s, cells, place):
    """Place on the even run at which the curve is as steep as at `s` on this run, both in [0, 1].

    cells : length of the run; place : where s lies along the thread of the even cloth (float64),
        which tells one run of the thread from the next

    The crest of each run is moved by q s (1 - s), of the place on the even run, with q of mean 0:
    every place is as long as on the even run, on average.
    """
    most = yarn.rows[which, thread, CREST]
    begun = np.int32(np.rint(place - float(s) * float(cells)))
    # Neighbouring threads move their crests in opposite ways, where both begin a run.
    key = hashed(_U(yarn.seed[which] ^ _U(0xA511E9B3)), np.int32(number >> 1))
    sign = R(1) - R(2) * R(np.int32(number & 1))
    q = sign * most * third(R, hashed(key, np.int32(begun >> 1)))
    b = R(1) + q
    return R(2) * s / (b + np.sqrt(max(R(0), b * b - R(4) * q * s)))


@njit(**INLINE)
def strand(R, yarn, which, thread, number, w, metres):
    """Place across the strand that is seen at `w` across a thread of plies; `w` itself if single.

    Every position across a strand is seen equally often: the mean over w and the thread is kept.
    """
    row = yarn.rows[which, thread]
    strands = row[STRANDS]
    if strands == R(0):
        return w
    key = hashed(_U(~yarn.seed[which]), np.int32(number))
    turns = metres * float(row[WINDING]) + float(R(np.int32(key & _U(0xFFFF)))) * 2.0**-15
    x = R(turns - 2.0 * np.floor(0.5 * turns)) + strands * w + R(1)
    return x - R(2) * np.floor(R(0.5) * x) - R(1)


class Laid(NamedTuple):
    """Places of an uneven cloth.

    uv : (n, 2) float64 - the places of the even cloth that look as they do [threads]
    numbers : (n, 2) int64, shades : (n, 2) real - true number, and factor of the albedo, of the
        weft and the warp there, whichever is seen
    """

    uv: NDArray[np.float64]
    numbers: NDArray[np.int64]
    shades: NDArray[Any]


def laid(yarn: Yarn, uv: NDArray[np.float64]) -> Laid:
    """The places uv (n, 2) float64 [threads] of a cloth that is woven of `yarn`."""
    real = yarn.rows.dtype.type
    found = Laid(np.empty((len(uv), 2)), np.empty((len(uv), 2), np.int64), np.ones(uv.shape, real))
    _lay_all(real, yarn, uv, *found)
    return found


@njit(parallel=True, **KERNEL)
def _lay_all(R, yarn, uv, out, numbers, shades):
    n = uv.shape[0]
    for chunk in prange((n + BLOCK - 1) // BLOCK):
        begin = chunk * BLOCK
        _lay_chunk(R, yarn, uv, out, numbers, shades, begin, min(BLOCK, n - begin))


@njit(**KERNEL)
def _lay_chunk(R, yarn, uv, out, numbers, shades, begin, size):
    u, v, blur = np.empty(size), np.empty(size), np.zeros(size, R)
    doubles, reals = np.empty(DOUBLE_ROWS * BLOCK), np.empty(REAL_ROWS * BLOCK, R)
    ints = np.empty(INT_ROWS * BLOCK, np.int32)
    for k in range(size):
        u[k], v[k] = uv[begin + k, 0], uv[begin + k, 1]
    lay_block(R, yarn, u, v, blur, size, doubles, reals, ints)
    for k in range(size):
        at = begin + k
        if not sound(u[k], v[k]):
            out[at, 0], out[at, 1], numbers[at, 0], numbers[at, 1] = u[k], v[k], 0, 0
            continue
        for which in range(2):
            number = ints[which * BLOCK + k]
            out[at, 1 - which] = float(number) + float(reals[IN_CELL + which * BLOCK + k])
            numbers[at, which], shades[at, which] = number, reals[TONE + which * BLOCK + k]


@njit(parallel=True, **KERNEL)
def strands_all(R, yarn, uv, sets, threads, numbers, w, out):
    """`strand` at each of uv (n, 2), of the thread that is seen there; `w` in gaps."""
    for k in prange(uv.shape[0]):
        out[k], which = w[k], int(sets[k])
        if which <= WARP:
            out[k] = strand(
                R, yarn, which, threads[k], numbers[k, which], w[k],
                uv[k, 1 if which == WARP else 0] * yarn.cell[which],
            )  # fmt: skip


def edges(
    yarn: Yarn, which: int, numbers: NDArray[np.int64], metres: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n, 3): left and right edge of threads in their cells, and the factor of their albedo.

    numbers, metres : (n,) - true numbers in the set, places along them; edges are [cells], 0 and 1
        being the even cell's borders
    """
    out = np.empty((len(numbers), 3))
    real: Any = np.float64
    _edges(real, yarn, which, numbers.astype(np.int32), metres, out)
    return out


@njit(**KERNEL)
def _edges(R, yarn, which, numbers, metres, out):
    lane = lane_of(yarn, which)
    for k in range(numbers.size):
        at, place = numbers[k], metres[k]
        e, aside, shade = _of_number(R, yarn, which, lane, at, place, R(0))
        left, right = R(0), R(0)
        if lane.shared > R(0):
            before, _, _ = _of_number(R, yarn, which, lane, np.int32(at - 1), place, R(0))
            after, _, _ = _of_number(R, yarn, which, lane, np.int32(at + 1), place, R(0))
            left, right = _moved(R, lane, before - e), _moved(R, lane, e - after)
        half, middle = R(0.5) * lane.width * (R(1) + lane.own * e), R(0.5) + lane.astray * aside
        out[k, 0], out[k, 1], out[k, 2] = middle - half + left, middle + half + right, shade
