"""The vectorised form of `mixture`: sample many hits at a time.

The shares of each hit are read once for one drawn direction and two densities, and the loops run
over hits so that LLVM vectorises them. They are tested against the scalar functions of `mixture`.
All rows of a block are in a single array at distances known to the compiler, which then need not
check them for overlap.

A mixture of one side without cosine lobes, like those of published cloth, and one of two sides with
them, like those of `conserving` cloth, are compiled apart: `both` is a constant in each.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.sampling.lobes import (
    STEEPEST,
    SURFACE,
    THREAD_LOBES,
    azimuth_seen,
    density_across,
    lobe_densities,
    narrowed,
    sample_across,
    sample_any_lobe,
)
from fabricusd.appearance.sampling.mixture import mixed
from fabricusd.appearance.sampling.share_fit import AZIMUTHS
from fabricusd.appearance.sampling.stretches import (
    COS,
    OF_SET,
    PSI0,
    SIN,
    SURFACE_WIDTH,
    TAN,
    VOLUME_WIDTH,
    Stretch,
    nearest_stretch,
)
from fabricusd.appearance.sampling.views import share_at, view_corner
from fabricusd.appearance.scattering import columns
from fabricusd.appearance.scattering.across import across_deviation
from fabricusd.appearance.weave.coverage import WARP
from fabricusd.kernels.real import BLOCK, INLINE, KERNEL, PART, atan2, cos, sin
from fabricusd.kernels.unrolled import tuple_reader

_EVEN, _COSINE = THREAD_LOBES, THREAD_LOBES + 1
"""Stand in place of a lobe's number for directions that are uniform over the hemisphere, and for
those of a cosine lobe."""

# Rows of a block: the viewer, the light, and the drawn direction; the stretch of thread that it is
# drawn from, with the surface lobe of its thread; two uniform numbers; both densities; the place of
# the view on the grid of shares; the position across the thread and its factor on both surface
# densities; of two sides, -1 where the drawn direction is opposite the viewer, and where the viewer
# is below the cloth; the shares of one stretch's lobes, of two sides those for the light and those
# for the drawn direction, followed by the shares of all lobes.
(_OX, _OY, _OZ, _IX, _IY, _IZ, _GX, _GY, _GZ, _WARP, _PSI0, _COS, _SIN, _TAN, _ON_SURFACE,
 _ON_VOLUME, _GAMMA, _LOBE, _U1, _U2, _P_LIGHT, _P_GO, _ELEVATION, _AZIMUTH, _UP, _ROUND, _W,
 _NARROW_LIGHT, _NARROW_GO, _TURN, _FLIP, _OURS) = (
    row * BLOCK for row in range(32)
)  # fmt: skip
_OTHERS = _OURS + THREAD_LOBES * BLOCK
_SHARES = _OTHERS + THREAD_LOBES * BLOCK
POINT_SHARES = 2 * (THREAD_LOBES + 1)
"""Lobes at a point of a mixture of two sides with cosine lobes."""

_shares_of = tuple_reader(THREAD_LOBES, BLOCK)
"""Called with (block, _OURS + x): the shares of the lobes of the current stretch."""


class Drawn(NamedTuple):
    """The arrays that the samplers write; `real` is their precision.

    go : (3, n) real - the drawn directions
    p_light, p_go : real - the densities [1/sr] of the direction to the light and of `go`
    """

    go: NDArray[Any]
    p_light: NDArray[Any]
    p_go: NDArray[Any]


@njit(**INLINE)
def _stretch_at(block, x):
    """The `Stretch` of entry x, whose set is a number of type R."""
    return Stretch(
        block[_WARP + x], block[_PSI0 + x], block[_COS + x], block[_SIN + x], block[_TAN + x],
        block[_ON_SURFACE + x], block[_ON_VOLUME + x],
    )  # fmt: skip


@njit(**INLINE)
def _into(R, stretch, x, y, z):
    """`frame.to_thread` without a branch: (w.t, w.b, w.n_t)."""
    warp, c, s = stretch.thread_set, stretch.cos, stretch.sin
    along = warp * y + (R(1) - warp) * x
    across = (R(1) - warp) * y - warp * x
    return c * along - s * z, across, s * along + c * z


@njit(**INLINE)
def _viewer(R, stretch, block, x):
    """(theta_o [rad], w.b, w.n_t) of entry x's viewer in the frame of a stretch."""
    t_o, b_o, n_o = _into(R, stretch, block[_OX + x], block[_OY + x], block[_OZ + x])
    return atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o)), b_o, n_o


@njit(**INLINE)
def _outwards(R, stretch, t, b, n):
    """`frame.from_thread` without a branch."""
    warp, c, s = stretch.thread_set, stretch.cos, stretch.sin
    along, z = c * t + s * n, c * n - s * t
    return warp * -b + (R(1) - warp) * along, warp * along + (R(1) - warp) * b, z


@njit(**INLINE)
def _lobes_at(R, stretch, theta_o, x, y, z, shares, narrow):
    """The sum of the lobes' densities at a direction times their shares; 0 behind the thread."""
    t, across, n = _into(R, stretch, x, y, z)
    found = lobe_densities(R, stretch, theta_o, t, across, max(n, R(1e-12)))
    p = mixed(shares, narrowed(found, narrow))
    return p if n > R(0) else R(0)


@njit(**INLINE)
def _lobes_on(R, both, stretch, theta_o, x, y, z, shares, narrow):
    """`_lobes_at`, of the side that the direction is on."""
    if both:
        # A product with 1 or -1: LLVM does not vectorise a loop that selects between more.
        turn = R(1) if z > R(0) else R(-1)
        theta_o, x, y, z = turn * theta_o, turn * x, turn * y, turn * z
    return _lobes_at(R, stretch, theta_o, x, y, z, shares, narrow)


@njit(**INLINE)
def _load(R, both, wo, wi, start, size, block):
    """Copy the directions; of two sides, negated where the viewer is below the cloth."""
    for row in range(3):
        to_viewer, to_light = wo[row][start:], wi[row][start:]
        for x in range(size):
            block[_OX + row * BLOCK + x] = to_viewer[x]
        for x in range(size):
            block[_IX + row * BLOCK + x] = to_light[x]
    if both:
        for x in range(size):
            flip = R(-1) if block[_OZ + x] < R(0) else R(1)
            block[_FLIP + x], block[_TURN + x] = flip, R(1)
            for row in range(3):
                block[_OX + row * BLOCK + x] *= flip
                block[_IX + row * BLOCK + x] *= flip


@njit(**INLINE)
def _find_views(R, size, block):
    """Compute `view_corner` for all viewers."""
    for x in range(size):
        row, column, _, up, round_ = view_corner(R, block[_OX + x], block[_OY + x], block[_OZ + x])
        block[_ELEVATION + x], block[_AZIMUTH + x] = R(row), R(column)
        block[_UP + x], block[_ROUND + x] = up, round_


@njit(**INLINE)
def _corner(block, x):
    """The result of `view_corner` for entry x."""
    column = int(block[_AZIMUTH + x])
    following = column + 1 if column + 1 < AZIMUTHS else 0
    return int(block[_ELEVATION + x]), column, following, block[_UP + x], block[_ROUND + x]


@njit(**PART)
def _read_shares(R, shares, size, block, mixed):
    """Compute `share_at` for all lobes.

    The shares are read hit by hit, where those of the lobes are contiguous, and then transposed
    into rows over hits.
    """
    lobes = shares.shape[2]
    for x in range(size):
        row, column, following, up, round_ = _corner(block, x)
        a, b = shares[row][column], shares[row][following]
        c, d = shares[row + 1][column], shares[row + 1][following]
        into = mixed[x * lobes :]
        for k in range(lobes):
            low, high = a[k] + round_ * (b[k] - a[k]), c[k] + round_ * (d[k] - c[k])
            into[k] = low + up * (high - low)
    for k in range(lobes):
        into = block[_SHARES + k * BLOCK :]
        for x in range(size):
            into[x] = mixed[x * lobes + k]


@njit(**INLINE)
def _choose(R, even, shares, count, u0, block, x):
    """The lobe out of `count` that u0 selects; -1 stands for the uniform part."""
    left = u0 - even
    if left < R(0) or count == 0:
        return -1
    k = 0
    while k < count - 1:
        left -= block[shares + k * BLOCK + x]
        if left < R(0):
            break
        k += 1
    return k


@njit(**PART)
def _choose_all(R, even, count, size, block):
    """`_choose` out of all lobes for the numbers in the row _U1, into the row _LOBE.

    A loop over hits for each lobe: shares are at least 0, so a lobe that is passed stays passed.
    """
    for x in range(size):
        left = block[_U1 + x] - even
        block[_U2 + x] = left
        block[_LOBE + x] = R(-1) if left < R(0) or count == 0 else R(0)
    for k in range(count - 1):
        shares = block[_SHARES + k * BLOCK :]
        for x in range(size):
            left = block[_U2 + x] - shares[x]
            block[_U2 + x] = left
            block[_LOBE + x] += R(1) if left >= R(0) else R(0)


@njit(**INLINE)
def _choose_side(R, mixture, lobe, lobes, u0, block, x):
    """Write the number and the side of lobe `lobe` out of `lobes` of each side and the cosine
    lobes; returns which of the lobes of one side it is."""
    block[_LOBE + x], block[_TURN + x] = R(_EVEN), R(1)
    if lobe < 0:
        opposite = mixture.opaque == 0 and u0 < R(0.5) * mixture.even
        block[_TURN + x] = R(-1) if opposite else R(1)
        return 0
    if lobe >= 2 * lobes:
        # Rounding may select the lower cosine lobe of opaque cloth, whose share is 0.
        opposite = lobe > 2 * lobes and mixture.opaque == 0
        block[_LOBE + x], block[_TURN + x] = R(_COSINE), R(-1) if opposite else R(1)
        return 0
    block[_LOBE + x] = R(lobe % THREAD_LOBES)
    block[_TURN + x] = R(-1) if lobe >= lobes else R(1)
    return lobe % lobes


@njit(**PART)
def _draw(R, both, size, block):
    """Draw directions from the chosen lobes, in the surface frame."""
    for x in range(size):
        stretch, lobe = _stretch_at(block, x), block[_LOBE + x]
        u1, u2 = block[_U1 + x], block[_U2 + x]
        theta_o, _, _ = _viewer(R, stretch, block, x)
        turn = block[_TURN + x] if both else R(1)
        t, b, n = sample_any_lobe(R, lobe, stretch, turn * theta_o, u1, u2)
        gx, gy, z = _outwards(R, stretch, t, b, n)
        up = math.sqrt(u1) if both and lobe == R(_COSINE) else u1
        flat = math.sqrt(max(R(0), (R(1) - up) * (R(1) + up)))
        phi = R(2 * math.pi) * u2
        even = lobe >= R(_EVEN)
        block[_GX + x] = turn * (flat * cos(R, phi) if even else gx)
        block[_GY + x] = turn * (flat * sin(R, phi) if even else gy)
        block[_GZ + x] = turn * (up if even else z)


@njit(**INLINE)
def _drawn_from(R, both, opaque, z):
    """Whether a direction with this N.w is ever drawn, for a viewer above the cloth."""
    if both and not opaque:
        return z != R(0)
    return z > R(0)


@njit(**INLINE)
def _store(R, both, opaque, start, size, block, drawn, first):
    """Write the directions and densities of a block; the densities of what is not drawn are 0."""
    for row in range(3):
        go = drawn.go[row][start:]
        for x in range(size):
            turn = block[_FLIP + x] if both else R(1)
            go[x] = turn * block[_GX + row * BLOCK + x]
    to_light, onwards = drawn.p_light[first + start :], drawn.p_go[first + start :]
    for x in range(size):
        lit = _drawn_from(R, both, opaque, block[_IZ + x]) and block[_OZ + x] > R(0)
        to_light[x] = block[_P_LIGHT + x] if lit else R(0)
        seen = _drawn_from(R, both, opaque, block[_GZ + x]) and block[_OZ + x] > R(0)
        onwards[x] = block[_P_GO + x] if seen else R(0)


@njit(**INLINE)
def _start_densities(R, both, sampling, size, block):
    """Set both densities to that of the uniform part."""
    even = sampling.even * R(1 / (2 * math.pi))
    if both and sampling.opaque == 0:
        even *= R(0.5)
    for x in range(size):
        block[_P_LIGHT + x] = block[_P_GO + x] = even


@njit(**INLINE)
def _add_cosines(R, upper, size, block):
    """Add the cosine lobes, whose shares are in the row `upper` and in the next."""
    for x in range(size):
        own, other = block[upper + x], block[upper + BLOCK + x]
        z = block[_IZ + x]
        block[_P_LIGHT + x] += (own if z > R(0) else other) * abs(z) * R(1 / math.pi)
        z = block[_GZ + x]
        block[_P_GO + x] += (own if z > R(0) else other) * abs(z) * R(1 / math.pi)


@njit(**KERNEL)
def sample_far(R, sampling, wo, wi, numbers, drawn, first, n):
    """`mixture.direction` for `n` viewers, and `mixture.density` of it and of the light's
    direction.

    wo, wi : (3, n) real - directions to the viewer and to the light
    numbers : three rows of uniform reals, read from `first` to `first + n - 1`
    drawn : a `Drawn`; the densities are written from `first` to `first + n - 1`
    """
    count = THREAD_LOBES * sampling.stretches.shape[0]
    block = np.empty(_SHARES + count * BLOCK, wo.dtype)
    mixed = np.empty(count * BLOCK, wo.dtype)
    _sample_far(R, False, sampling, wo, wi, numbers, drawn, first, n, block, mixed)


@njit(**KERNEL)
def sample_far_both(R, sampling, wo, wi, numbers, drawn, first, n):
    """`sample_far` of a mixture of two sides with cosine lobes."""
    count = 2 * THREAD_LOBES * sampling.stretches.shape[0] + 2
    block = np.empty(_SHARES + count * BLOCK, wo.dtype)
    mixed = np.empty(count * BLOCK, wo.dtype)
    _sample_far(R, True, sampling, wo, wi, numbers, drawn, first, n, block, mixed)


@njit(**INLINE)
def _sample_far(R, both, sampling, wo, wi, numbers, drawn, first, n, block, mixed):
    """block, mixed : room for the rows of a block, and for its shares hit by hit."""
    u0, u1, u2 = numbers
    stretches = sampling.stretches
    lobes = THREAD_LOBES * stretches.shape[0]
    count = 2 * lobes + 2 if both else lobes
    for start in range(0, n, BLOCK):
        size = min(BLOCK, n - start)
        _load(R, both, wo, wi, start, size, block)
        _find_views(R, size, block)
        _read_shares(R, sampling.shares, size, block, mixed)
        for x in range(size):
            block[_U1 + x] = u0[first + start + x]
        _choose_all(R, sampling.even, count, size, block)
        for x in range(size):
            h = first + start + x
            k = int(block[_LOBE + x])
            block[_U1 + x], block[_U2 + x] = u1[h], u2[h]
            if both:
                k = _choose_side(R, sampling, k, lobes, u0[h], block, x)
            else:
                block[_LOBE + x] = R(_EVEN) if k < 0 else R(k % THREAD_LOBES)
            if lobes == 0:
                block[_WARP + x] = block[_PSI0 + x] = block[_SIN + x] = block[_TAN + x] = R(0)
                block[_COS + x] = block[_ON_SURFACE + x] = block[_ON_VOLUME + x] = R(1)
                continue
            row = stretches[max(k, 0) // THREAD_LOBES]
            block[_WARP + x] = R(1) if int(row[OF_SET]) == WARP else R(0)
            block[_PSI0 + x], block[_COS + x] = row[PSI0], row[COS]
            block[_SIN + x], block[_TAN + x] = row[SIN], row[TAN]
            block[_ON_SURFACE + x], block[_ON_VOLUME + x] = row[SURFACE_WIDTH], row[VOLUME_WIDTH]
        _draw(R, both, size, block)
        _start_densities(R, both, sampling, size, block)
        for y in range(stretches.shape[0]):
            at = _SHARES + THREAD_LOBES * y * BLOCK
            _add_stretch(R, both, stretches[y], at, at + lobes * BLOCK, size, block)
        if both:
            _add_cosines(R, _SHARES + 2 * lobes * BLOCK, size, block)
        _store(R, both, sampling.opaque != 0, start, size, block, drawn, first)


@njit(**PART)
def _add_stretch(R, both, row, shares, others, size, block):
    """Add a stretch's part of both densities; shares, others : rows of its shares by side."""
    stretch = Stretch(
        R(1) if int(row[OF_SET]) == WARP else R(0), row[PSI0], row[COS], row[SIN], row[TAN],
        row[SURFACE_WIDTH], row[VOLUME_WIDTH],
    )  # fmt: skip
    # Copy the shares to fixed offsets: with an offset unknown to the compiler, the loop below would
    # stay scalar.
    if both:
        _choose_shares(R, shares, others, _IZ, _OURS, size, block)
        _choose_shares(R, shares, others, _GZ, _OTHERS, size, block)
    else:
        ours, chosen = block[shares:], block[_OURS:]
        for x in range(THREAD_LOBES * BLOCK):
            chosen[x] = ours[x]
    of_go = _OTHERS if both else _OURS
    for x in range(size):
        theta_o, _, _ = _viewer(R, stretch, block, x)
        block[_P_LIGHT + x] += _lobes_on(
            R, both, stretch, theta_o, block[_IX + x], block[_IY + x], block[_IZ + x],
            _shares_of(block, _OURS + x), R(1),
        )  # fmt: skip
        block[_P_GO + x] += _lobes_on(
            R, both, stretch, theta_o, block[_GX + x], block[_GY + x], block[_GZ + x],
            _shares_of(block, of_go + x), R(1),
        )  # fmt: skip


@njit(**INLINE)
def _choose_shares(R, shares, others, z, into, size, block):
    """Copy a stretch's shares on the side of the direction whose N.w is in row z."""
    up = block[z:]
    for lobe in range(THREAD_LOBES):
        at = lobe * BLOCK
        own, other, chosen = block[shares + at :], block[others + at :], block[into + at :]
        for x in range(size):
            ours, its = own[x], other[x]
            chosen[x] = ours if up[x] > R(0) else its


@njit(**KERNEL)
def sample_points(R, table, sampling, across_too, places, wo, wi, numbers, drawn, first, n):
    """`sample_far` with `point_direction` and `point_density`, at the threads under the hits.

    table : rows of `pack_threads`
    places : `Places` of n hits; a gap is sampled uniformly
    """
    block = np.empty(_SHARES, wo.dtype)
    _sample_points(R, False, table, sampling, across_too, places, wo, wi, numbers, drawn, first, n,
                   block)  # fmt: skip


@njit(**KERNEL)
def sample_points_both(R, table, sampling, across_too, places, wo, wi, numbers, drawn, first, n):
    """`sample_points` of a mixture of two sides with cosine lobes."""
    block = np.empty(_SHARES + POINT_SHARES * BLOCK, wo.dtype)
    _sample_points(R, True, table, sampling, across_too, places, wo, wi, numbers, drawn, first, n,
                   block)  # fmt: skip


@njit(**INLINE)
def _sample_points(
    R, both, table, sampling, across_too, places, wo, wi, numbers, drawn, first, n, block
):
    """block : room for the rows of a block."""
    u0, u1, u2 = numbers
    of_go = _OTHERS if both else _OURS
    for start in range(0, n, BLOCK):
        size = min(BLOCK, n - start)
        _load(R, both, wo, wi, start, size, block)
        _find_views(R, size, block)
        _find_threads(R, both, table, sampling, places, start, size, block)
        for x in range(size):
            h = first + start + x
            block[_U1 + x], block[_U2 + x] = u1[h], u2[h]
            on_thread = places.sets[start + x] <= WARP and sampling.stretches.shape[0] > 0
            if both:
                count = POINT_SHARES if on_thread else 0
                k = _choose(R, sampling.even, _SHARES, count, u0[h], block, x)
                _choose_side(R, sampling, k, THREAD_LOBES, u0[h], block, x)
            else:
                count = THREAD_LOBES if on_thread else 0
                k = _choose(R, sampling.even, _OURS, count, u0[h], block, x)
                block[_LOBE + x] = R(_EVEN) if k < 0 else R(k)
        _turn(R, size, block)
        _draw(R, both, size, block)
        if across_too:
            _draw_across(R, both, size, block)
        for x in range(size):
            block[_NARROW_LIGHT + x] = block[_NARROW_GO + x] = R(1)
        if across_too:
            _narrow(R, both, size, block)
        if both:
            others = _SHARES + THREAD_LOBES * BLOCK
            _choose_shares(R, _SHARES, others, _IZ, _OURS, size, block)
            _choose_shares(R, _SHARES, others, _GZ, _OTHERS, size, block)
        if both:
            _start_densities(R, both, sampling, size, block)
        _add_points(R, both, of_go, sampling.even, size, block)
        if both:
            _add_cosines(R, _SHARES + 2 * THREAD_LOBES * BLOCK, size, block)
        _store(R, both, sampling.opaque != 0, start, size, block, drawn, first)


@njit(**PART)
def _find_threads(R, both, table, sampling, places, start, size, block):
    """Read the thread under each hit and the shares of its lobes, which are 0 in a gap."""
    sets, threads, psi0, w = places.sets, places.threads, places.psi0, places.w
    into, count = (_SHARES, POINT_SHARES) if both else (_OURS, THREAD_LOBES)
    for x in range(size):
        on_thread = sets[start + x] <= WARP and sampling.stretches.shape[0] > 0
        thread_set, thread, angle = 0, 0, R(0)
        if on_thread:
            thread_set, thread = sets[start + x], threads[start + x]
            angle = min(max(psi0[start + x], R(-STEEPEST)), R(STEEPEST))
        row = table[thread]
        block[_WARP + x] = R(1) if thread_set == WARP else R(0)
        block[_PSI0 + x], block[_W + x] = angle, w[start + x]
        block[_ON_SURFACE + x] = row[columns.SURFACE_WIDTH]
        block[_ON_VOLUME + x] = row[columns.VOLUME_WIDTH]
        block[_GAMMA + x] = row[columns.GAMMA_SURFACE]
        k = 0
        if on_thread:
            k = nearest_stretch(R, sampling.stretches, thread_set, thread, psi0[start + x])
        corner = _corner(block, x)
        for lobe in range(count):
            share = R(0)
            if on_thread:
                share = share_at(R, sampling.point_shares, corner, count * k + lobe)
            block[into + lobe * BLOCK + x] = share


@njit(**PART)
def _turn(R, size, block):
    """Compute the cosine, sine and tangent of each hit's tangent angle."""
    for x in range(size):
        c, s = cos(R, block[_PSI0 + x]), sin(R, block[_PSI0 + x])
        block[_COS + x], block[_SIN + x], block[_TAN + x] = c, s, s / c


@njit(**PART)
def _draw_across(R, both, size, block):
    """Draw from the surface lobe at level `thread`, in place of the directions of `_draw`."""
    for x in range(size):
        stretch = _stretch_at(block, x)
        theta_o, b_o, n_o = _viewer(R, stretch, block, x)
        t, b, n = sample_across(
            R, stretch.psi0, stretch.tan, stretch.surface_width, theta_o,
            azimuth_seen(R, b_o, n_o), block[_W + x], across_deviation(R, block[_GAMMA + x]),
            block[_U1 + x], block[_U2 + x],
        )  # fmt: skip
        gx, gy, z = _outwards(R, stretch, t, b, n)
        ours = block[_LOBE + x] == R(SURFACE)
        if both:
            ours = ours and min(block[_TURN + x], block[_FLIP + x]) > R(0)
        block[_GX + x] = gx if ours else block[_GX + x]
        block[_GY + x] = gy if ours else block[_GY + x]
        block[_GZ + x] = z if ours else block[_GZ + x]


@njit(**PART)
def _narrow(R, both, size, block):
    """Compute the factors of the position across the thread on both surface densities."""
    for x in range(size):
        stretch = _stretch_at(block, x)
        _, b_o, n_o = _into(R, stretch, block[_OX + x], block[_OY + x], block[_OZ + x])
        phi_o, w = azimuth_seen(R, b_o, n_o), block[_W + x]
        beta, tangent = across_deviation(R, block[_GAMMA + x]), stretch.tan
        t, b, n = _into(R, stretch, block[_IX + x], block[_IY + x], block[_IZ + x])
        to_light = density_across(R, tangent, phi_o, w, beta, t, b, max(n, R(1e-12)))
        t, b, n = _into(R, stretch, block[_GX + x], block[_GY + x], block[_GZ + x])
        onwards = density_across(R, tangent, phi_o, w, beta, t, b, max(n, R(1e-12)))
        if both:
            # Only where viewer and direction are both on the front.
            front = block[_FLIP + x]
            to_light = to_light if min(front, block[_IZ + x]) > R(0) else R(1)
            onwards = onwards if min(front, block[_GZ + x]) > R(0) else R(1)
        block[_NARROW_LIGHT + x], block[_NARROW_GO + x] = to_light, onwards


@njit(**PART)
def _add_points(R, both, of_go, uniform, size, block):
    """Add the lobes of each hit's own thread to both densities.

    of_go : row of the shares of the drawn direction's side; uniform : share of the uniform part
    """
    for x in range(size):
        stretch = _stretch_at(block, x)
        theta_o, _, _ = _viewer(R, stretch, block, x)
        ours, its = _shares_of(block, _OURS + x), _shares_of(block, of_go + x)
        # In a gap all shares are 0 and every direction is drawn uniformly.
        if not both:
            even = R(1 / (2 * math.pi))
            even = uniform * even if mixed(ours, ours) > R(0) else even
            block[_P_LIGHT + x] = block[_P_GO + x] = even
        block[_P_LIGHT + x] += _lobes_on(
            R, both, stretch, theta_o, block[_IX + x], block[_IY + x], block[_IZ + x], ours,
            block[_NARROW_LIGHT + x],
        )  # fmt: skip
        block[_P_GO + x] += _lobes_on(
            R, both, stretch, theta_o, block[_GX + x], block[_GY + x], block[_GZ + x], its,
            block[_NARROW_GO + x],
        )  # fmt: skip
