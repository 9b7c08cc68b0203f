"""The vectorised form of `mixture`: sample many hits at a time, on one side of the cloth.

The shares of each hit are read once for one drawn direction and two densities, and the loops run
over hits so that LLVM vectorises them. They are tested against the scalar functions of `mixture`.
The mixtures must have one side and no cosine lobes, like those of published cloth. All rows of a
block are in a single array at distances known to the compiler, which then need not check them for
overlap.
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

_EVEN = THREAD_LOBES
"""Stands in place of a lobe's number for directions that are uniform over the hemisphere."""

# Rows of a block: the viewer, the light, and the drawn direction; the stretch of thread that it is
# drawn from, with the surface lobe of its thread; two uniform numbers; both densities; the place of
# the view on the grid of shares; the position across the thread and its factor on both surface
# densities; the shares of one stretch's lobes, followed by the shares of all lobes.
(_OX, _OY, _OZ, _IX, _IY, _IZ, _GX, _GY, _GZ, _WARP, _PSI0, _COS, _SIN, _TAN, _ON_SURFACE,
 _ON_VOLUME, _GAMMA, _LOBE, _U1, _U2, _P_LIGHT, _P_GO, _ELEVATION, _AZIMUTH, _UP, _ROUND, _W,
 _NARROW_LIGHT, _NARROW_GO, _OURS) = (
    row * BLOCK for row in range(30)
)  # fmt: skip
_SHARES = _OURS + THREAD_LOBES * BLOCK

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
def _load(wo, wi, start, size, block):
    for row in range(3):
        to_viewer, to_light = wo[row][start:], wi[row][start:]
        for x in range(size):
            block[_OX + row * BLOCK + x] = to_viewer[x]
        for x in range(size):
            block[_IX + row * BLOCK + x] = to_light[x]


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
def _draw(R, size, block):
    """Draw directions from the chosen lobes, in the surface frame."""
    for x in range(size):
        stretch, lobe = _stretch_at(block, x), block[_LOBE + x]
        u1, u2 = block[_U1 + x], block[_U2 + x]
        theta_o, _, _ = _viewer(R, stretch, block, x)
        t, b, n = sample_any_lobe(R, lobe, stretch, theta_o, u1, u2)
        gx, gy, z = _outwards(R, stretch, t, b, n)
        flat = math.sqrt(max(R(0), (R(1) - u1) * (R(1) + u1)))
        phi = R(2 * math.pi) * u2
        even = lobe == R(_EVEN)
        block[_GX + x] = flat * cos(R, phi) if even else gx
        block[_GY + x] = flat * sin(R, phi) if even else gy
        block[_GZ + x] = u1 if even else z


@njit(**INLINE)
def _store(R, start, size, block, drawn, first):
    """Write the directions and densities of a block; the densities are 0 at or below the cloth."""
    for row in range(3):
        go = drawn.go[row][start:]
        for x in range(size):
            go[x] = block[_GX + row * BLOCK + x]
    to_light, onwards = drawn.p_light[first + start :], drawn.p_go[first + start :]
    for x in range(size):
        lit = block[_IZ + x] > R(0) and block[_OZ + x] > R(0)
        to_light[x] = block[_P_LIGHT + x] if lit else R(0)
        seen = block[_GZ + x] > R(0) and block[_OZ + x] > R(0)
        onwards[x] = block[_P_GO + x] if seen else R(0)


@njit(**KERNEL)
def sample_far(R, sampling, wo, wi, numbers, drawn, first, n):
    """`mixture.direction` for `n` viewers, and `mixture.density` of it and of the light's
    direction.

    wo, wi : (3, n) real - directions to the viewer and to the light
    numbers : three rows of uniform reals, read from `first` to `first + n - 1`
    drawn : a `Drawn`; the densities are written from `first` to `first + n - 1`
    """
    u0, u1, u2 = numbers
    stretches = sampling.stretches
    lobes = THREAD_LOBES * stretches.shape[0]
    block = np.empty(_SHARES + lobes * BLOCK, wo.dtype)
    mixed = np.empty(lobes * BLOCK, wo.dtype)
    for start in range(0, n, BLOCK):
        size = min(BLOCK, n - start)
        _load(wo, wi, start, size, block)
        _find_views(R, size, block)
        _read_shares(R, sampling.shares, size, block, mixed)
        for x in range(size):
            h = first + start + x
            k = _choose(R, sampling.even, _SHARES, lobes, u0[h], block, x)
            block[_U1 + x], block[_U2 + x] = u1[h], u2[h]
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
        _draw(R, size, block)
        for x in range(size):
            block[_P_LIGHT + x] = block[_P_GO + x] = sampling.even * R(1 / (2 * math.pi))
        for y in range(stretches.shape[0]):
            _add_stretch(R, stretches[y], _SHARES + THREAD_LOBES * y * BLOCK, size, block)
        _store(R, start, size, block, drawn, first)


@njit(**PART)
def _add_stretch(R, row, shares, size, block):
    """Add a stretch's part of both densities."""
    stretch = Stretch(
        R(1) if int(row[OF_SET]) == WARP else R(0), row[PSI0], row[COS], row[SIN], row[TAN],
        row[SURFACE_WIDTH], row[VOLUME_WIDTH],
    )  # fmt: skip
    # Copy the shares to a fixed offset: with an offset unknown to the compiler, the loop below
    # would stay scalar.
    for x in range(THREAD_LOBES * BLOCK):
        block[_OURS + x] = block[shares + x]
    for x in range(size):
        theta_o, _, _ = _viewer(R, stretch, block, x)
        ours = _shares_of(block, _OURS + x)
        block[_P_LIGHT + x] += _lobes_at(
            R, stretch, theta_o, block[_IX + x], block[_IY + x], block[_IZ + x], ours, R(1)
        )
        block[_P_GO + x] += _lobes_at(
            R, stretch, theta_o, block[_GX + x], block[_GY + x], block[_GZ + x], ours, R(1)
        )


@njit(**KERNEL)
def sample_points(R, table, sampling, across_too, places, wo, wi, numbers, drawn, first, n):
    """`sample_far` with `point_direction` and `point_density`, at the threads under the hits.

    table : rows of `pack_threads`
    places : `Places` of n hits; a gap is sampled uniformly
    """
    u0, u1, u2 = numbers
    block = np.empty(_SHARES, wo.dtype)
    for start in range(0, n, BLOCK):
        size = min(BLOCK, n - start)
        _load(wo, wi, start, size, block)
        _find_views(R, size, block)
        _find_threads(R, table, sampling, places, start, size, block)
        for x in range(size):
            h = first + start + x
            block[_U1 + x], block[_U2 + x] = u1[h], u2[h]
            on_thread = places.sets[start + x] <= WARP and sampling.stretches.shape[0] > 0
            count = THREAD_LOBES if on_thread else 0
            k = _choose(R, sampling.even, _OURS, count, u0[h], block, x)
            block[_LOBE + x] = R(_EVEN) if k < 0 else R(k)
        _turn(R, size, block)
        _draw(R, size, block)
        if across_too:
            _draw_across(R, size, block)
        for x in range(size):
            block[_NARROW_LIGHT + x] = block[_NARROW_GO + x] = R(1)
        if across_too:
            _narrow(R, size, block)
        _add_points(R, sampling.even, size, block)
        _store(R, start, size, block, drawn, first)


@njit(**PART)
def _find_threads(R, table, sampling, places, start, size, block):
    """Read the thread under each hit and the shares of its lobes, which are 0 in a gap."""
    sets, threads, psi0, w = places.sets, places.threads, places.psi0, places.w
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
        for lobe in range(THREAD_LOBES):
            share = R(0)
            if on_thread:
                share = share_at(R, sampling.point_shares, corner, THREAD_LOBES * k + lobe)
            block[_OURS + lobe * BLOCK + x] = share


@njit(**PART)
def _turn(R, size, block):
    """Compute the cosine, sine and tangent of each hit's tangent angle."""
    for x in range(size):
        c, s = cos(R, block[_PSI0 + x]), sin(R, block[_PSI0 + x])
        block[_COS + x], block[_SIN + x], block[_TAN + x] = c, s, s / c


@njit(**PART)
def _draw_across(R, size, block):
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
        block[_GX + x] = gx if ours else block[_GX + x]
        block[_GY + x] = gy if ours else block[_GY + x]
        block[_GZ + x] = z if ours else block[_GZ + x]


@njit(**PART)
def _narrow(R, size, block):
    """Compute the factors of the position across the thread on both surface densities."""
    for x in range(size):
        stretch = _stretch_at(block, x)
        _, b_o, n_o = _into(R, stretch, block[_OX + x], block[_OY + x], block[_OZ + x])
        phi_o, w = azimuth_seen(R, b_o, n_o), block[_W + x]
        beta, tangent = across_deviation(R, block[_GAMMA + x]), stretch.tan
        t, b, n = _into(R, stretch, block[_IX + x], block[_IY + x], block[_IZ + x])
        block[_NARROW_LIGHT + x] = density_across(
            R, tangent, phi_o, w, beta, t, b, max(n, R(1e-12))
        )
        t, b, n = _into(R, stretch, block[_GX + x], block[_GY + x], block[_GZ + x])
        block[_NARROW_GO + x] = density_across(R, tangent, phi_o, w, beta, t, b, max(n, R(1e-12)))


@njit(**PART)
def _add_points(R, uniform, size, block):
    """Compute both densities from the lobes of each hit's own thread."""
    for x in range(size):
        stretch = _stretch_at(block, x)
        theta_o, _, _ = _viewer(R, stretch, block, x)
        ours = _shares_of(block, _OURS + x)
        # In a gap all shares are 0 and every direction is drawn uniformly.
        even = R(1 / (2 * math.pi))
        even = uniform * even if mixed(ours, ours) > R(0) else even
        block[_P_LIGHT + x] = even + _lobes_at(
            R, stretch, theta_o, block[_IX + x], block[_IY + x], block[_IZ + x], ours,
            block[_NARROW_LIGHT + x],
        )  # fmt: skip
        block[_P_GO + x] = even + _lobes_at(
            R, stretch, theta_o, block[_GX + x], block[_GY + x], block[_GZ + x], ours,
            block[_NARROW_GO + x],
        )  # fmt: skip
