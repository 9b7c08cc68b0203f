"""Importance sampling of `conserving` cloth: both sides, and their exact density.

The lobes and stretches are `surface_sampling`'s. Below the cloth a lobe's directions are those
above it, negated, around the mirror inclination of that side; two cosine lobes, up and down, stand
for light scattered more than once, and a tenth is uniform over the sphere, or over the viewer's
side where the cloth is opaque. A viewer below is one above with both directions negated, which the
law does not change under. Source: `docs/model.md` section 6.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.conserving import (
    NODE_COS,
    NODE_SIN,
    NODE_WEIGHT,
    ConservingTables,
    facet_terms,
    visible,
)
from fabricusd.appearance.coverage import WARP, WEFT
from fabricusd.appearance.frame import from_thread, to_thread
from fabricusd.appearance.multiple import multiple_share
from fabricusd.appearance.real import INLINE, KERNEL, LEAN, atan2, cos, sin
from fabricusd.appearance.sampling_lobes import (
    ISOTROPIC,
    STEEPEST,
    SURFACE,
    VOLUME,
    lobe_densities,
    sample_lobe,
)
from fabricusd.appearance.surface_sampling import (
    AZIMUTHS,
    COS,
    ELEVATIONS,
    PSI0,
    SET,
    SIN,
    STRATA,
    SURFACE_WIDTH,
    TAN,
    THREAD,
    VOLUME_WIDTH,
    nearest_stretch,
    owners,
    share_at,
    stretches_of,
    uniform_direction,
    view_corner,
)
from fabricusd.appearance.thread_terms import (
    BRIGHTNESS,
    GAMMA_SURFACE,
    GAMMA_VOLUME,
)
from fabricusd.appearance.thread_terms import ISOTROPIC as KD
from fabricusd.fabric import Fabric

Reals = NDArray[Any]

UNIFORM = 0.1
LEAST_SHARE = 0.05
"""As in `surface_sampling`, and half as much: without `1/Q` there are no narrow bright places that
the lobes miss."""


class ConservingSamplingTables(NamedTuple):
    """What the sampler reads; `real` is the tables' precision.

    stretches : (s, 8) real - see `surface_sampling.SamplingTables`
    shares : (ELEVATIONS, AZIMUTHS, 6 s + 2) real - of every stretch's three lobes above the cloth,
        then below it, then of the cosine lobes above and below; they sum to 1 - UNIFORM
    opaque : int - 1 where no light passes
    """

    stretches: Reals
    shares: Reals
    opaque: int


def conserving_sampling_tables(
    fabric: Fabric, tables: ConservingTables
) -> ConservingSamplingTables:
    """Stretches of `fabric` and the shares of their lobes, measured on `tables`."""
    R = tables.nodes.dtype.type
    rows = stretches_of(fabric)
    sets = np.where(np.arange(len(tables.nodes)) >= tables.warp_start, WARP, WEFT)
    psi0 = np.arctan2(tables.nodes[:, NODE_SIN], tables.nodes[:, NODE_COS])
    owner = owners(rows, psi0, sets, tables.node_thread)
    stretches = rows.astype(R)
    energy = np.zeros((ELEVATIONS, AZIMUTHS, 6 * len(rows) + 2))
    single: Any = np.float32
    _measure(single, _in_single_precision(tables), rows.astype(single), owner, energy)
    total = energy.sum(axis=2, keepdims=True)
    possible = np.ones(energy.shape[2])
    if tables.opaque:
        possible[3 * len(rows) : 6 * len(rows)] = 0.0
        possible[-1] = 0.0
    even = possible / possible.sum()
    measured = np.where(total > 0, energy / np.where(total > 0, total, 1.0), even)
    shares = (1.0 - UNIFORM) * ((1.0 - LEAST_SHARE) * measured + LEAST_SHARE * even)
    return ConservingSamplingTables(stretches, np.ascontiguousarray(shares, dtype=R), tables.opaque)


def _in_single_precision(tables: ConservingTables) -> ConservingTables:
    """Shares need no more, and one kernel serves both precisions."""
    return tables._replace(
        threads=tables.threads.astype(np.float32),
        nodes=tables.nodes.astype(np.float32),
        covered=np.float32(tables.covered),
        lost=tables.lost.astype(np.float32),
        strength=tables.strength.astype(np.float32),
        forward=np.float32(tables.forward),
    )


@njit(**KERNEL, parallel=True)
def _measure(R, tables, stretches, owner, energy):  # type: ignore[no-untyped-def]
    """Energy of every lobe at every view, each by directions drawn from the lobe itself."""
    for view in prange(ELEVATIONS * AZIMUTHS):
        _measure_view(R, tables, stretches, owner, view // AZIMUTHS, view % AZIMUTHS, energy)


@njit(**LEAN)
def _measure_view(R, tables, stretches, owner, e, a, energy):  # type: ignore[no-untyped-def]
    lobes = 3 * stretches.shape[0]
    # Short of 90 degrees, where nothing is seen.
    theta = R(0.5 * math.pi) * min(R(e) / R(ELEVATIONS - 1), R(0.99))
    phi = R(2 * math.pi / AZIMUTHS) * R(a)
    ox, oy = sin(R, theta) * cos(R, phi), sin(R, theta) * sin(R, phi)
    oz = cos(R, theta)
    for side in range(1 if tables.opaque != 0 else 2):
        energy[e, a, 2 * lobes + side] = _multiple_energy(R, tables, side, ox, oy, oz)
        for y in range(stretches.shape[0]):
            surface = _lobe_energy(R, tables, stretches, owner, y, side, SURFACE, ox, oy, oz)
            volume = _lobe_energy(R, tables, stretches, owner, y, side, VOLUME, ox, oy, oz)
            kd = tables.threads[int(stretches[y, THREAD]), KD]
            k = side * lobes + 3 * y
            energy[e, a, k + SURFACE] = surface
            energy[e, a, k + VOLUME] = volume * (R(1) - kd)
            energy[e, a, k + ISOTROPIC] = volume * kd


@njit(**INLINE)
def _multiple_energy(R, tables, side, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Energy of the multiple-scattering term on one side, by cosine-distributed directions."""
    total = R(0)
    for m in range(STRATA[0] * STRATA[1]):
        u1 = (R(m % STRATA[0]) + R(0.5)) / R(STRATA[0])
        u2 = (R(m // STRATA[0]) + R(0.5)) / R(STRATA[1])
        x, y, z = uniform_direction(R, math.sqrt(u1), u2)
        turn = R(1) if side == 0 else R(-1)
        share = multiple_share(R, tables, turn * x, turn * y, turn * z, ox, oy, oz)
        total += share * R(math.pi) / z
    strength = (tables.strength[0] + tables.strength[1] + tables.strength[2]) * R(1.0 / 3.0)
    return total * strength / R(STRATA[0] * STRATA[1])


@njit(**INLINE)
def _lobe_energy(R, tables, stretches, owner, y, side, lobe, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Energy of the surface or volume term of one stretch on one side, by its own lobe."""
    row = stretches[y]
    thread_set = int(row[SET])
    t_o, b_o, n_o = to_thread(R, thread_set, row[COS], row[SIN], ox, oy, oz)
    turn = R(1) if side == 0 else R(-1)
    theta_o = turn * atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    width = row[SURFACE_WIDTH] if lobe == SURFACE else row[VOLUME_WIDTH]
    total = R(0)
    for m in range(STRATA[0] * STRATA[1]):
        u1 = (R(m % STRATA[0]) + R(0.5)) / R(STRATA[0])
        u2 = (R(m // STRATA[0]) + R(0.5)) / R(STRATA[1])
        t, b, n = sample_lobe(R, lobe, row[PSI0], row[TAN], width, theta_o, u1, u2)
        ix, iy, iz = from_thread(R, thread_set, row[COS], row[SIN], t, b, n)
        if iz <= R(1e-6) or n <= R(1e-6):
            continue
        on_surface, on_volume, _ = lobe_densities(
            R, row[PSI0], row[TAN], row[SURFACE_WIDTH], row[VOLUME_WIDTH], theta_o, t, b, n
        )
        density = on_surface if lobe == SURFACE else on_volume
        if density > R(1e-12):
            value = _stretch_term(
                R, tables, owner, y, thread_set, lobe, turn * ix, turn * iy, turn * iz, ox, oy, oz
            )
            total += value / density
    return total / R(STRATA[0] * STRATA[1])


@njit(**INLINE)
def _stretch_term(R, tables, owner, y, thread_set, lobe, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """One term of single scattering by the nodes of a stretch, as a grey."""
    scale = visible(R, tables, ix, iy, iz) * visible(R, tables, ox, oy, oz) * abs(iz)
    total = R(0)
    for k in range(owner.size):
        if owner[k] == y and tables.scatters[k] != 0:
            thread = tables.node_thread[k]
            surface, volume = facet_terms(
                R, tables, thread_set, thread,
                tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN], ix, iy, iz, ox, oy, oz,
            )  # fmt: skip
            term = surface if lobe == SURFACE else volume * tables.threads[thread, BRIGHTNESS]
            total += tables.nodes[k, NODE_WEIGHT] * term
    return total * scale


@njit(**INLINE)
def _even_density(R, opaque, iz):  # type: ignore[no-untyped-def]
    """Density of the uniform part, the viewer being above."""
    if opaque != 0:
        return R(0.5 / math.pi) if iz > R(0) else R(0)
    return R(0.25 / math.pi)


@njit(**INLINE)
def _stretch_density(R, c, s, psi0, tangent, surface_width, volume_width, thread_set,
                     surface, volume, isotropic, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]  # fmt: skip
    """Density of one stretch's three lobes with the shares given, on wi's own side."""
    turn = R(1) if iz > R(0) else R(-1)
    t, b, n = to_thread(R, thread_set, c, s, turn * ix, turn * iy, turn * iz)
    if n <= R(0):
        return R(0)
    t_o, b_o, n_o = to_thread(R, thread_set, c, s, ox, oy, oz)
    theta_o = turn * atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    on_surface, on_volume, on_isotropic = lobe_densities(
        R, psi0, tangent, surface_width, volume_width, theta_o, t, b, n
    )
    return surface * on_surface + volume * on_volume + isotropic * on_isotropic


@njit(**LEAN)
def conserving_density(R, sampling, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """pdf(wi) [1/sr] of `conserving_direction`, over the whole sphere; 0 at the horizon."""
    if iz == R(0) or oz == R(0):
        return R(0)
    if oz < R(0):
        ix, iy, iz, ox, oy, oz = -ix, -iy, -iz, -ox, -oy, -oz
    even = _even_density(R, sampling.opaque, iz)
    if even == R(0):
        return even
    corner = view_corner(R, ox, oy, oz)
    lobes = 3 * sampling.stretches.shape[0]
    side = 0 if iz > R(0) else 1
    p = R(UNIFORM) * even
    p += share_at(R, sampling.shares, corner, 2 * lobes + side) * abs(iz) * R(1 / math.pi)
    for y in range(sampling.stretches.shape[0]):
        row = sampling.stretches[y]
        k = side * lobes + 3 * y
        p += _stretch_density(
            R, row[COS], row[SIN], row[PSI0], row[TAN], row[SURFACE_WIDTH], row[VOLUME_WIDTH],
            int(row[SET]),
            share_at(R, sampling.shares, corner, k + SURFACE),
            share_at(R, sampling.shares, corner, k + VOLUME),
            share_at(R, sampling.shares, corner, k + ISOTROPIC),
            ix, iy, iz, ox, oy, oz,
        )  # fmt: skip
    return p


@njit(**INLINE)
def _even_direction(R, opaque, u0, u1, u2):  # type: ignore[no-untyped-def]
    """Uniform over the sphere, or over the viewer's side of opaque cloth."""
    x, y, z = uniform_direction(R, u1, u2)
    if opaque == 0 and u0 < R(0.5 * UNIFORM):
        return -x, -y, -z
    return x, y, z


@njit(**LEAN)
def conserving_direction(R, sampling, ox, oy, oz, u0, u1, u2):  # type: ignore[no-untyped-def]
    """wi (x, y, z) for any viewer and three numbers in [0, 1)."""
    flip = R(-1) if oz < R(0) else R(1)
    ox, oy, oz = flip * ox, flip * oy, flip * oz
    left = u0 - R(UNIFORM)
    if left < R(0):
        x, y, z = _even_direction(R, sampling.opaque, u0, u1, u2)
        return flip * x, flip * y, flip * z
    corner = view_corner(R, ox, oy, oz)
    lobes = 3 * sampling.stretches.shape[0]
    k, last = 0, 2 * lobes + 1
    while k < last:
        left -= share_at(R, sampling.shares, corner, k)
        if left < R(0):
            break
        k += 1
    if k >= 2 * lobes:
        below = k > 2 * lobes and sampling.opaque == 0
        x, y, z = uniform_direction(R, math.sqrt(u1), u2)
    else:
        below = k >= lobes
        row = sampling.stretches[(k % lobes) // 3]
        lobe = k % 3
        width = row[SURFACE_WIDTH] if lobe == SURFACE else row[VOLUME_WIDTH]
        x, y, z = _lobe_direction(
            R, below, lobe, width, row[COS], row[SIN], row[PSI0], row[TAN], int(row[SET]),
            ox, oy, oz, u1, u2,
        )  # fmt: skip
    turn = -flip if below else flip
    return turn * x, turn * y, turn * z


@njit(**INLINE)
def _lobe_direction(R, below, lobe, width, c, s, psi0, tangent, thread_set, ox, oy, oz, u1, u2):  # type: ignore[no-untyped-def]
    """A direction of a lobe, above the cloth; for the lobe below it is to be negated."""
    t_o, b_o, n_o = to_thread(R, thread_set, c, s, ox, oy, oz)
    theta_o = atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    t, b, n = sample_lobe(R, lobe, psi0, tangent, width, -theta_o if below else theta_o, u1, u2)
    return from_thread(R, thread_set, c, s, t, b, n)


@njit(**INLINE)
def _point_shares(R, sampling, thread_set, thread, psi0, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Eight shares of 1 - UNIFORM at one tangent angle: those of its stretch, and the cosines'."""
    y = nearest_stretch(R, sampling.stretches, thread_set, thread, psi0)
    lobes = 3 * sampling.stretches.shape[0]
    corner = view_corner(R, ox, oy, oz)
    a0 = share_at(R, sampling.shares, corner, 3 * y)
    a1 = share_at(R, sampling.shares, corner, 3 * y + 1)
    a2 = share_at(R, sampling.shares, corner, 3 * y + 2)
    b0 = share_at(R, sampling.shares, corner, lobes + 3 * y)
    b1 = share_at(R, sampling.shares, corner, lobes + 3 * y + 1)
    b2 = share_at(R, sampling.shares, corner, lobes + 3 * y + 2)
    # A stretch is part of the cloth, the multiple-scattering term is all of it.
    part = R(1.0) / R(sampling.stretches.shape[0])
    up = share_at(R, sampling.shares, corner, 2 * lobes) * part
    down = share_at(R, sampling.shares, corner, 2 * lobes + 1) * part
    scale = R(1.0 - UNIFORM) / (a0 + a1 + a2 + b0 + b1 + b2 + up + down)
    return (
        a0 * scale, a1 * scale, a2 * scale, b0 * scale, b1 * scale, b2 * scale,
        up * scale, down * scale,
    )  # fmt: skip


@njit(**LEAN)
def conserving_point_density(R, tables, sampling, thread_set, thread, psi0,
                             ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]  # fmt: skip
    """pdf(wi) [1/sr] of `conserving_point_direction`, over the whole sphere."""
    if iz == R(0) or oz == R(0):
        return R(0)
    if oz < R(0):
        ix, iy, iz, ox, oy, oz = -ix, -iy, -iz, -ox, -oy, -oz
    even = _even_density(R, sampling.opaque, iz)
    if thread_set > WARP or even == R(0):
        return even
    psi0 = min(max(psi0, R(-STEEPEST)), R(STEEPEST))
    c, s = cos(R, psi0), sin(R, psi0)
    w = _point_shares(R, sampling, thread_set, thread, psi0, ox, oy, oz)
    above = iz > R(0)
    row = tables.threads[thread]
    p = R(UNIFORM) * even + (w[6] if above else w[7]) * abs(iz) * R(1 / math.pi)
    return p + _stretch_density(
        R, c, s, psi0, s / c, R(2) * row[GAMMA_SURFACE], R(2) * row[GAMMA_VOLUME], thread_set,
        w[0] if above else w[3], w[1] if above else w[4], w[2] if above else w[5],
        ix, iy, iz, ox, oy, oz,
    )  # fmt: skip


@njit(**LEAN)
def conserving_point_direction(R, tables, sampling, thread_set, thread, psi0,
                               ox, oy, oz, u0, u1, u2):  # type: ignore[no-untyped-def]  # fmt: skip
    """wi (x, y, z) at levels `weave` and `thread`; a gap is sampled uniformly."""
    flip = R(-1) if oz < R(0) else R(1)
    ox, oy, oz = flip * ox, flip * oy, flip * oz
    if thread_set > WARP:
        x, y, z = _even_direction(R, sampling.opaque, u0 * R(UNIFORM), u1, u2)
        return flip * x, flip * y, flip * z
    left = u0 - R(UNIFORM)
    if left < R(0):
        x, y, z = _even_direction(R, sampling.opaque, u0, u1, u2)
        return flip * x, flip * y, flip * z
    psi0 = min(max(psi0, R(-STEEPEST)), R(STEEPEST))
    c, s = cos(R, psi0), sin(R, psi0)
    w = _point_shares(R, sampling, thread_set, thread, psi0, ox, oy, oz)
    k = 0
    while k < 7:
        left -= w[k]
        if left < R(0):
            break
        k += 1
    if sampling.opaque != 0 and (k == 7 or (3 <= k and k < 6)):
        # Rounding alone leads here: below opaque cloth the shares are 0.
        k = 6
    below = k == 7 or (3 <= k and k < 6)
    if k >= 6:
        x, y, z = uniform_direction(R, math.sqrt(u1), u2)
    else:
        row = tables.threads[thread]
        lobe = k % 3
        width = R(2) * (row[GAMMA_SURFACE] if lobe == SURFACE else row[GAMMA_VOLUME])
        x, y, z = _lobe_direction(
            R, below, lobe, width, c, s, psi0, s / c, thread_set, ox, oy, oz, u1, u2
        )
    turn = -flip if below else flip
    return turn * x, turn * y, turn * z
