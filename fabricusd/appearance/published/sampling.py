"""Importance sampling of the surface law: directions above the cloth and their exact density.

A part is uniform over the hemisphere; the rest goes to the lobes of `sampling_lobes`, three for
each of the `stretches` of tangent angle, in shares that `surface_shares` measures once per fabric.

Source: `docs/model.md` section 6. Scalar kernels, for the path tracer and the loops over arrays.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.frame import from_thread, to_thread
from fabricusd.appearance.sampling.across import narrow_direction, narrower
from fabricusd.appearance.sampling.lobes import (
    ISOTROPIC,
    STEEPEST,
    SURFACE,
    VOLUME,
    lobe_densities,
    sample_lobe,
)
from fabricusd.appearance.sampling.stretches import (
    COS,
    PSI0,
    SET,
    SIN,
    SURFACE_WIDTH,
    TAN,
    VOLUME_WIDTH,
    nearest_stretch,
)
from fabricusd.appearance.sampling.views import share_at, uniform_direction, view_corner
from fabricusd.appearance.scattering.columns import GAMMA_SURFACE, GAMMA_VOLUME
from fabricusd.appearance.weave.coverage import WARP
from fabricusd.kernels.real import INLINE, PART, atan2, cos, sin

Reals = NDArray[Any]

UNIFORM = 0.15
"""Share of directions uniform over the hemisphere: it bounds the weight of what no lobe expects."""


class SamplingTables(NamedTuple):
    """What the sampler reads; `real` is the surface tables' precision.

    stretches : (s, 8) real - a tangent angle [rad] of a thread in a set, its cosine, sine, tangent,
        the deviations of its two normal lobes [rad]
    shares : (ELEVATIONS, AZIMUTHS, 3 s) real - at level `far`, of every stretch's three lobes; they
        sum to 1 - UNIFORM at each view
    point_shares : (ELEVATIONS, AZIMUTHS, 3 s) real - at a point of a stretch, of its three lobes,
        which sum to 1 - UNIFORM
    """

    stretches: Reals
    shares: Reals
    point_shares: Reals


@njit(**INLINE)
def even_density(R):
    """Density [1/sr] of the uniform part."""
    return R(1 / (2 * math.pi))


@njit(**INLINE)
def stretch_densities(R, c, s, psi0, tangent, surface_width, volume_width, thread_set,
                      ix, iy, iz, ox, oy, oz):  # fmt: skip
    """Densities [1/sr] of the three lobes at one tangent angle, both directions above the cloth."""
    t, b, n = to_thread(R, thread_set, c, s, ix, iy, iz)
    t_o, b_o, n_o = to_thread(R, thread_set, c, s, ox, oy, oz)
    theta_o = atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    surface, volume, isotropic = lobe_densities(
        R, psi0, tangent, surface_width, volume_width, theta_o, t, b, max(n, R(1e-12))
    )
    # Without a branch: loops over directions are vectorised.
    front = R(1) if n > R(0) else R(0)
    return front * surface, front * volume, front * isotropic


@njit(**INLINE)
def stretch_direction(R, lobe, c, s, psi0, tangent, surface_width, volume_width, thread_set,
                      ox, oy, oz, u1, u2):  # fmt: skip
    """A direction of one of the three lobes."""
    t_o, b_o, n_o = to_thread(R, thread_set, c, s, ox, oy, oz)
    theta_o = atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    width = surface_width if lobe == SURFACE else volume_width
    t, b, n = sample_lobe(R, lobe, psi0, tangent, width, theta_o, u1, u2)
    return from_thread(R, thread_set, c, s, t, b, n)


@njit(**PART)
def far_density(R, sampling, ix, iy, iz, ox, oy, oz):
    """pdf(wi) [1/sr] of `far_direction`; 0 at or below the cloth."""
    if iz <= R(0) or oz <= R(0):
        return R(0)
    if sampling.stretches.shape[0] == 0:
        return R(0.5 / math.pi)
    corner = view_corner(R, ox, oy, oz)
    p = R(UNIFORM / (2 * math.pi))
    for y in range(sampling.stretches.shape[0]):
        row = sampling.stretches[y]
        on_surface, on_volume, isotropic = stretch_densities(
            R, row[COS], row[SIN], row[PSI0], row[TAN], row[SURFACE_WIDTH], row[VOLUME_WIDTH],
            int(row[SET]), ix, iy, iz, ox, oy, oz,
        )  # fmt: skip
        p += share_at(R, sampling.shares, corner, 3 * y + SURFACE) * on_surface
        p += share_at(R, sampling.shares, corner, 3 * y + VOLUME) * on_volume
        p += share_at(R, sampling.shares, corner, 3 * y + ISOTROPIC) * isotropic
    return p


@njit(**PART)
def far_direction(R, sampling, ox, oy, oz, u0, u1, u2):
    """wi (x, y, z) for a viewer above the cloth and three numbers in [0, 1)."""
    left = u0 - R(UNIFORM)
    if left < R(0) or sampling.stretches.shape[0] == 0:
        return uniform_direction(R, u1, u2)
    corner = view_corner(R, ox, oy, oz)
    last = 3 * sampling.stretches.shape[0] - 1
    k = 0
    while k < last:
        left -= share_at(R, sampling.shares, corner, k)
        if left < R(0):
            break
        k += 1
    row = sampling.stretches[k // 3]
    return stretch_direction(
        R, k % 3, row[COS], row[SIN], row[PSI0], row[TAN], row[SURFACE_WIDTH], row[VOLUME_WIDTH],
        int(row[SET]), ox, oy, oz, u1, u2,
    )  # fmt: skip


@njit(**INLINE)
def _point_shares(R, sampling, thread_set, thread, psi0, ox, oy, oz):
    """(surface, volume, isotropic) shares at one tangent angle: those of the stretch it is in."""
    y = 3 * nearest_stretch(R, sampling.stretches, thread_set, thread, psi0)
    corner = view_corner(R, ox, oy, oz)
    return (
        share_at(R, sampling.point_shares, corner, y + SURFACE),
        share_at(R, sampling.point_shares, corner, y + VOLUME),
        share_at(R, sampling.point_shares, corner, y + ISOTROPIC),
    )


@njit(**PART)
def point_density(R, tables, sampling, across_too, thread_set, thread, psi0, w,
                  ix, iy, iz, ox, oy, oz):  # fmt: skip
    """pdf(wi) [1/sr] of `point_direction`; 0 at or below the cloth."""
    if iz <= R(0) or oz <= R(0):
        return R(0)
    if thread_set > WARP or sampling.stretches.shape[0] == 0:
        return R(0.5 / math.pi)
    p = R(UNIFORM / (2 * math.pi))
    psi0 = min(max(psi0, R(-STEEPEST)), R(STEEPEST))
    c, s = cos(R, psi0), sin(R, psi0)
    row = tables.threads[thread]
    surface, volume, isotropic = _point_shares(R, sampling, thread_set, thread, psi0, ox, oy, oz)
    on_surface, on_volume, on_isotropic = stretch_densities(
        R, c, s, psi0, s / c, R(2) * row[GAMMA_SURFACE], R(2) * row[GAMMA_VOLUME], thread_set,
        ix, iy, iz, ox, oy, oz,
    )  # fmt: skip
    if across_too:
        on_surface *= narrower(R, row[GAMMA_SURFACE], c, s, thread_set, w, ix, iy, iz, ox, oy, oz)
    return p + surface * on_surface + volume * on_volume + isotropic * on_isotropic


@njit(**PART)
def point_direction(R, tables, sampling, across_too, thread_set, thread, psi0, w,
                    ox, oy, oz, u0, u1, u2):  # fmt: skip
    """wi (x, y, z) for a viewer above the cloth, at level `weave`, or `thread` if `across_too`.

    A gap, whose value is 0 everywhere, is sampled uniformly.
    """
    left = u0 - R(UNIFORM)
    if left < R(0) or thread_set > WARP or sampling.stretches.shape[0] == 0:
        return uniform_direction(R, u1, u2)
    psi0 = min(max(psi0, R(-STEEPEST)), R(STEEPEST))
    c, s = cos(R, psi0), sin(R, psi0)
    row = tables.threads[thread]
    surface, volume, _ = _point_shares(R, sampling, thread_set, thread, psi0, ox, oy, oz)
    lobe = ISOTROPIC
    if left < surface + volume:
        lobe = SURFACE if left < surface else VOLUME
    if across_too and lobe == SURFACE:
        return narrow_direction(
            R, row[GAMMA_SURFACE], c, s, psi0, thread_set, w, ox, oy, oz, u1, u2
        )
    return stretch_direction(
        R, lobe, c, s, psi0, s / c, R(2) * row[GAMMA_SURFACE], R(2) * row[GAMMA_VOLUME], thread_set,
        ox, oy, oz, u1, u2,
    )  # fmt: skip
