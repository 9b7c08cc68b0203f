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

UNIFORM = 0.1
"""As in `surface_sampling`, and less: without `1/Q` there are no narrow bright places that the
lobes miss."""

POINT_LOBES = 8
"""Lobes at a point: surface, volume, isotropic above the cloth, the same below, cosine above and
below."""


class ConservingSamplingTables(NamedTuple):
    """What the sampler reads; `real` is the tables' precision.

    stretches : (s, 8) real - see `surface_sampling.SamplingTables`
    shares : (ELEVATIONS, AZIMUTHS, 6 s + 2) real - at level `far`, of every stretch's three lobes
        above the cloth, then below it, then of the cosine lobes above and below; they sum to
        1 - UNIFORM
    point_shares : (ELEVATIONS, AZIMUTHS, 8 s) real - at a point of a stretch, in the same order and
        with the same sum: three lobes above, three below, two cosine lobes
    opaque : int - 1 where no light passes
    """

    stretches: Reals
    shares: Reals
    point_shares: Reals
    opaque: int


@njit(**INLINE)
def even_density(R, opaque, iz):  # type: ignore[no-untyped-def]
    """Density of the uniform part, the viewer being above."""
    if opaque != 0:
        return R(0.5 / math.pi) if iz > R(0) else R(0)
    return R(0.25 / math.pi)


@njit(**INLINE)
def stretch_densities(R, c, s, psi0, tangent, surface_width, volume_width, thread_set,
                      ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]  # fmt: skip
    """Densities [1/sr] of one stretch's three lobes on wi's own side, the viewer being above."""
    none = R(0)
    turn = R(1) if iz > none else R(-1)
    t, b, n = to_thread(R, thread_set, c, s, turn * ix, turn * iy, turn * iz)
    if n <= none:
        return none, none, none
    t_o, b_o, n_o = to_thread(R, thread_set, c, s, ox, oy, oz)
    theta_o = turn * atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    return lobe_densities(R, psi0, tangent, surface_width, volume_width, theta_o, t, b, n)


@njit(**INLINE)
def _mixed(densities, surface, volume, isotropic):  # type: ignore[no-untyped-def]
    return surface * densities[0] + volume * densities[1] + isotropic * densities[2]


@njit(**PART)
def conserving_density(R, sampling, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """pdf(wi) [1/sr] of `conserving_direction`, over the whole sphere; 0 at the horizon."""
    if iz == R(0) or oz == R(0):
        return R(0)
    if oz < R(0):
        ix, iy, iz, ox, oy, oz = -ix, -iy, -iz, -ox, -oy, -oz
    even = even_density(R, sampling.opaque, iz)
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
        found = stretch_densities(
            R, row[COS], row[SIN], row[PSI0], row[TAN], row[SURFACE_WIDTH], row[VOLUME_WIDTH],
            int(row[SET]), ix, iy, iz, ox, oy, oz,
        )  # fmt: skip
        p += _mixed(
            found,
            share_at(R, sampling.shares, corner, k + SURFACE),
            share_at(R, sampling.shares, corner, k + VOLUME),
            share_at(R, sampling.shares, corner, k + ISOTROPIC),
        )
    return p


@njit(**INLINE)
def _even_direction(R, opaque, u0, u1, u2):  # type: ignore[no-untyped-def]
    """Uniform over the sphere, or over the viewer's side of opaque cloth."""
    x, y, z = uniform_direction(R, u1, u2)
    if opaque == 0 and u0 < R(0.5 * UNIFORM):
        return -x, -y, -z
    return x, y, z


@njit(**PART)
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
    if sampling.opaque != 0 and k == last:
        # Rounding alone leads here: below opaque cloth the shares are 0.
        k = 2 * lobes
    x, y, z = far_lobe_direction(R, sampling.stretches, k, ox, oy, oz, u1, u2)
    return flip * x, flip * y, flip * z


@njit(**INLINE)
def far_lobe_direction(R, stretches, k, ox, oy, oz, u1, u2):  # type: ignore[no-untyped-def]
    """A direction of lobe k in the order of `shares`, for a viewer above the cloth."""
    lobes = 3 * stretches.shape[0]
    if k >= 2 * lobes:
        below = k > 2 * lobes
        x, y, z = uniform_direction(R, math.sqrt(u1), u2)
    else:
        below = k >= lobes
        row = stretches[(k % lobes) // 3]
        lobe = k % 3
        width = row[SURFACE_WIDTH] if lobe == SURFACE else row[VOLUME_WIDTH]
        x, y, z = _lobe_direction(
            R, below, lobe, width, row[COS], row[SIN], row[PSI0], row[TAN], int(row[SET]),
            ox, oy, oz, u1, u2,
        )  # fmt: skip
    turn = R(-1) if below else R(1)
    return turn * x, turn * y, turn * z


@njit(**INLINE)
def _lobe_direction(R, below, lobe, width, c, s, psi0, tangent, thread_set, ox, oy, oz, u1, u2):  # type: ignore[no-untyped-def]
    """A direction of a lobe, above the cloth; for the lobe below it is to be negated."""
    t_o, b_o, n_o = to_thread(R, thread_set, c, s, ox, oy, oz)
    theta_o = atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    t, b, n = sample_lobe(R, lobe, psi0, tangent, width, -theta_o if below else theta_o, u1, u2)
    return from_thread(R, thread_set, c, s, t, b, n)


@njit(**PART)
def conserving_point_density(R, tables, sampling, across_too, thread_set, thread, psi0, w,
                             ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]  # fmt: skip
    """pdf(wi) [1/sr] of `conserving_point_direction`, over the whole sphere."""
    if iz == R(0) or oz == R(0):
        return R(0)
    narrow = across_too and oz > R(0) and iz > R(0)
    if oz < R(0):
        ix, iy, iz, ox, oy, oz = -ix, -iy, -iz, -ox, -oy, -oz
    even = even_density(R, sampling.opaque, iz)
    if thread_set > WARP or even == R(0):
        return even
    psi0 = min(max(psi0, R(-STEEPEST)), R(STEEPEST))
    c, s = cos(R, psi0), sin(R, psi0)
    corner = view_corner(R, ox, oy, oz)
    k = POINT_LOBES * nearest_stretch(R, sampling.stretches, thread_set, thread, psi0)
    side = 0 if iz > R(0) else 1
    row = tables.threads[thread]
    p = R(UNIFORM) * even
    p += share_at(R, sampling.point_shares, corner, k + 6 + side) * abs(iz) * R(1 / math.pi)
    k += 3 * side
    on_surface, on_volume, isotropic = stretch_densities(
        R, c, s, psi0, s / c, R(2) * row[GAMMA_SURFACE], R(2) * row[GAMMA_VOLUME], thread_set,
        ix, iy, iz, ox, oy, oz,
    )  # fmt: skip
    if narrow:
        on_surface *= narrower(R, row[GAMMA_SURFACE], c, s, thread_set, w, ix, iy, iz, ox, oy, oz)
    return p + _mixed(
        (on_surface, on_volume, isotropic),
        share_at(R, sampling.point_shares, corner, k + SURFACE),
        share_at(R, sampling.point_shares, corner, k + VOLUME),
        share_at(R, sampling.point_shares, corner, k + ISOTROPIC),
    )


@njit(**PART)
def conserving_point_direction(R, tables, sampling, across_too, thread_set, thread, psi0, w,
                               ox, oy, oz, u0, u1, u2):  # type: ignore[no-untyped-def]  # fmt: skip
    """wi (x, y, z) at level `weave`, or `thread` if `across_too`; a gap is sampled uniformly.

    The place across the thread narrows the lobe of viewers and light on the front.
    """
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
    corner = view_corner(R, ox, oy, oz)
    y = POINT_LOBES * nearest_stretch(R, sampling.stretches, thread_set, thread, psi0)
    k = 0
    while k < POINT_LOBES - 1:
        left -= share_at(R, sampling.point_shares, corner, y + k)
        if left < R(0):
            break
        k += 1
    if sampling.opaque != 0 and k == POINT_LOBES - 1:
        # Rounding alone leads here: below opaque cloth the shares are 0.
        k = 6
    if across_too and flip > R(0) and k == SURFACE:
        return narrow_direction(
            R, tables.threads[thread, GAMMA_SURFACE], c, s, psi0, thread_set, w,
            ox, oy, oz, u1, u2,
        )  # fmt: skip
    x, y, z = point_lobe_direction(
        R, tables.threads[thread], k, c, s, psi0, thread_set, ox, oy, oz, u1, u2
    )
    return flip * x, flip * y, flip * z


@njit(**INLINE)
def point_lobe_direction(R, row, k, c, s, psi0, thread_set, ox, oy, oz, u1, u2):  # type: ignore[no-untyped-def]
    """A direction of lobe k in the order of `point_shares`, for a viewer above the cloth.

    row : the thread's of `ConservingTables.threads`
    """
    below = k == 7 or (3 <= k and k < 6)
    if k >= 6:
        x, y, z = uniform_direction(R, math.sqrt(u1), u2)
    else:
        lobe = k % 3
        width = R(2) * (row[GAMMA_SURFACE] if lobe == SURFACE else row[GAMMA_VOLUME])
        x, y, z = _lobe_direction(
            R, below, lobe, width, c, s, psi0, s / c, thread_set, ox, oy, oz, u1, u2
        )
    turn = R(-1) if below else R(1)
    return turn * x, turn * y, turn * z
