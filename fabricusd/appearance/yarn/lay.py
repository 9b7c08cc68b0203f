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
from fabricusd.appearance.yarn.compiled import (
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
from fabricusd.appearance.yarn.noise import (
    VARIANCE,
    along,
    between,
    first,
    hashed,
    key_of,
    second,
    third,
)
from fabricusd.kernels.real import INLINE, KERNEL

FARTHEST = 2.0**52
"""Threads beyond which float64 has no fractional part."""

_U = np.uint32
_SHADE_ALONG = 1.0 / float(np.sqrt(VARIANCE))
_SHADE_BETWEEN = float(np.sqrt(3.0))


class Lateral(NamedTuple):
    """The thread of a set at a place. number : int64 - true number; place : real - in [0, 1), where
    it lies in the cell of the even cloth; shade : real - factor of its albedo, of mean 1."""

    number: Any
    place: Any
    shade: Any


NOT_LAID = Lateral(np.int64(0), np.float32(0), np.float32(1))
"""In place of a thread at coordinates that are not sound; in float32."""


@njit(**INLINE)
def type_of(yarn, which, number):
    """Thread type of a set's thread."""
    length = yarn.sequence_length[which]
    if length == 1:
        return yarn.sequence[which, 0]
    return yarn.sequence[which, np.uintp(number % length)]


@njit(**INLINE)
def thickness(R, yarn, which, number, metres, blur):
    """(e, aside, shade) of thread `number` (int64) of a set at `metres` (float64) along it.

    e : its width is 1 + e times that of the even thread
    aside : where it lies between its neighbours, in the same units; shade : factor of its albedo
    blur : extent of the footprint along the thread [m], which evens the noise out
    """
    row = yarn.rows[which, type_of(yarn, which, number)]
    key = key_of(yarn.seed, which, number)
    wide, light, beside = along(R, key, metres * row[RATE])
    count, tone, place = between(R, yarn.seed, which, number)
    f = blur * row[RATE]
    sharp = R(1) / (R(1) + f * f)
    e = sharp * row[WIDTH] * wide + row[COUNT] * count
    aside = sharp * row[WIDTH] * beside + row[COUNT] * place
    if row[SLUB] > R(0):
        g = blur * row[SLUB_RATE] / row[SLUB_HALF]
        e += _slub(R, row, key, metres) / (R(1) + R(0.25) * g * g)
    shade = R(1) + row[SHADE] * (sharp * R(_SHADE_ALONG) * light + R(_SHADE_BETWEEN) * tone)
    return e, aside, shade


@njit(**INLINE)
def _slub(R, row, key, metres):
    """Change of the width by slubs: one in each cell of the slubs' distance, anywhere inside it."""
    x = metres * row[SLUB_RATE] + R(np.int32(key >> _U(16))) * 2.0**-15
    whole = np.floor(x)
    n = np.int64(whole)
    pair, own = hashed(_U(~key), n >> 1), hashed(_U(key ^ _U(0x5BD1E995)), n)
    tall = R(1) + (R(-SPREAD) if n & 1 else R(SPREAD)) * first(R, pair)
    room = R(0.5) - row[SLUB_HALF]
    d = (R(x - whole) - R(0.5) - room * second(R, own)) / row[SLUB_HALF]
    rest = max(R(0), R(1) - d * d)
    return row[SLUB] * tall * rest * rest - row[SLUB_MEAN]


@njit(**INLINE)
def _moved(shared, most, difference):
    """How far the border of two threads moves [cells]: an odd function, which keeps its mean 0."""
    x = shared * difference
    return x * most / np.sqrt(most * most + x * x)


@njit(**INLINE)
def lateral(R, yarn, which, across, metres, blur):
    """The `Lateral` of a set at `across` [threads, float64] and `metres` along the thread."""
    columns = yarn.sets[which]
    width, own, shared, most = columns[OF_WIDTH], columns[OWN], columns[SHARED], columns[MOST]
    whole = np.floor(across)
    number, y = np.int64(whole), R(across - whole)
    e, aside, shade = thickness(R, yarn, which, number, metres, blur)
    left, right = R(0), R(0)
    if shared > R(0):
        step = -1 if y < R(0.5) else 1
        near, near_aside, near_shade = thickness(R, yarn, which, number + step, metres, blur)
        border = _moved(shared, most, (near - e) if step < 0 else (e - near))
        beyond = y < border if step < 0 else y >= R(1) + border
        # The other border of the thread that is seen.
        if beyond:
            number += step
            y -= R(step)
            further, _, _ = thickness(R, yarn, which, number + step, metres, blur)
            other = _moved(shared, most, (further - near) if step < 0 else (near - further))
            e, aside, shade = near, near_aside, near_shade
            left, right = (other, border) if step < 0 else (border, other)
        else:
            further, _, _ = thickness(R, yarn, which, number - step, metres, blur)
            other = _moved(shared, most, (e - further) if step < 0 else (further - e))
            left, right = (border, other) if step < 0 else (other, border)
    half = R(0.5) * width
    grown = half * (R(1) + own * e) + R(0.5) * (right - left)
    astray = columns[ASTRAY] * aside
    d = y - R(0.5) - R(0.5) * (right + left) - astray
    a = abs(d)
    if a <= grown:
        d *= half / grown
    else:
        room = R(0.5) + R(0.5) * (right - left) - grown - (astray if d > R(0) else -astray)
        a = half + min(R(1), (a - grown) / max(room, R(1e-6))) * (R(0.5) - half)
        d = a if d > R(0) else -a
    return Lateral(number, min(max(d + R(0.5), R(0)), R(0.9999999)), shade)


@njit(**INLINE)
def lay(R, yarn, u, v, blur):
    """(warp, weft): the `Lateral` of either set at weave coordinates (float64) of the front.

    blur : extent of the footprint [m]
    """
    warp = lateral(R, yarn, WARP, u, v * yarn.cell[WARP], blur)
    weft = lateral(R, yarn, WEFT, v, u * yarn.cell[WEFT], blur)
    return warp, weft


@njit(**INLINE)
def crest(R, yarn, which, thread, number, s, cells, place):
    """Place on the even run at which the curve is as steep as at `s` on this run, both in [0, 1].

    cells : length of the run; place : where s lies along the thread of the even cloth (float64),
        which tells one run of the thread from the next

    The crest of each run is moved by q s (1 - s), of the place on the even run, with q of mean 0:
    every place is as long as on the even run, on average.
    """
    most = yarn.rows[which, thread, CREST]
    begun = np.int64(np.rint(place - float(s) * float(cells)))
    key = _U(key_of(yarn.seed, which, number) ^ _U(0xA511E9B3))
    q = most * third(R, hashed(key, begun))
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
    key = hashed(key_of(yarn.seed, which, number), -1)
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


@njit(**INLINE)
def sound(u, v):
    """Whether weave coordinates are finite, and near enough that threads can be counted."""
    return (abs(u) <= FARTHEST) & (abs(v) <= FARTHEST)


@njit(parallel=True, **KERNEL)
def _lay_all(R, yarn, uv, out, numbers, shades):
    for k in prange(uv.shape[0]):
        if not sound(uv[k, 0], uv[k, 1]):
            out[k, 0], out[k, 1] = uv[k, 0], uv[k, 1]
            numbers[k, 0] = numbers[k, 1] = 0
            continue
        warp, weft = lay(R, yarn, uv[k, 0], uv[k, 1], R(0))
        out[k, 0] = float(warp.number) + float(warp.place)
        out[k, 1] = float(weft.number) + float(weft.place)
        numbers[k, WEFT], numbers[k, WARP] = weft.number, warp.number
        shades[k, WEFT], shades[k, WARP] = weft.shade, warp.shade


@njit(parallel=True, **KERNEL)
def strands_all(R, yarn, uv, sets, threads, numbers, w, out):
    """`strand` at each of uv (n, 2), of the thread that is seen there; `w` in gaps."""
    for k in prange(uv.shape[0]):
        out[k] = w[k]
        which = sets[k]
        if which == WARP:
            out[k] = strand(
                R, yarn, WARP, threads[k], numbers[k, WARP], w[k], uv[k, 1] * yarn.cell[WARP]
            )
        elif which == WEFT:
            out[k] = strand(
                R, yarn, WEFT, threads[k], numbers[k, WEFT], w[k], uv[k, 0] * yarn.cell[WEFT]
            )


def widths(
    yarn: Yarn, which: int, numbers: NDArray[np.int64], metres: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n, 3): left and right edge of threads in their cells, and the factor of their albedo.

    numbers, metres : (n,) - true numbers in the set, places along them; edges are [cells], 0 and 1
        being the cell's borders
    """
    out = np.empty((len(numbers), 3))
    real: Any = np.float64
    _widths(real, yarn, which, numbers, metres, out)
    return out


@njit(**KERNEL)
def _widths(R, yarn, which, numbers, metres, out):
    columns = yarn.sets[which]
    for k in range(numbers.size):
        at, place = numbers[k], metres[k]
        e, aside, shade = thickness(R, yarn, which, at, place, R(0))
        left, right = R(0), R(0)
        if columns[SHARED] > R(0):
            before, _, _ = thickness(R, yarn, which, at - 1, place, R(0))
            after, _, _ = thickness(R, yarn, which, at + 1, place, R(0))
            left = _moved(columns[SHARED], columns[MOST], before - e)
            right = _moved(columns[SHARED], columns[MOST], e - after)
        half = R(0.5) * columns[OF_WIDTH] * (R(1) + columns[OWN] * e)
        middle = R(0.5) + columns[ASTRAY] * aside
        out[k, 0], out[k, 1], out[k, 2] = middle - half + left, middle + half + right, shade
