"""A bit of thread in the cloth: what it scatters, masked and shadowed, before the division by `Q`.

Scalar kernels, precision `R` first, written once for the vectorised loops and for the path tracer.
Both directions are above the cloth. Source: `docs/model.md` section 4, [Sadeghi2013].
"""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.frame import (
    WARP,
    cos_half_difference,
    cos_inclination,
    half_inclination,
    unit_azimuth,
)
from fabricusd.appearance.scattering.lobes import gaussian
from fabricusd.appearance.scattering.terms import (
    GAMMA_SURFACE,
    GAMMA_VOLUME,
    ISOTROPIC,
    SURFACE_GAUSSIAN,
    VOLUME_GAUSSIAN,
    published_terms,
)
from fabricusd.kernels.real import INLINE, acos, erf, exp


@njit(**INLINE)
def masked(R, x, y, u):
    """`(1-u) x y + u min(x, y)` of two clamped cosines: `M` or `P`."""
    return x * y + u * (min(x, y) - x * y)


@njit(**INLINE)
def overlap(R, cos_half, precision):
    """`u` = exp(-d^2/(2 width^2)) of the azimuths' difference d, from cos(d/2); its height is 1.

    precision : 2/width^2
    """
    half = acos(R, cos_half)
    return exp(R, -precision * half * half)


@njit(**INLINE)
def along_set(R, thread_set, precision, ix, iy, iz, ox, oy, oz):
    """What all threads of a set share: (a_i, b_i, scale_i, a_o, b_o, scale_o, u of psi).

    a, b : components along the set's axis and across it; scale : 1/|w without b|, so that
    n_t.w scale = cos psi whatever the tangent angle is, which only turns psi.
    """
    warp = thread_set == WARP
    a_i, b_i = (iy, -ix) if warp else (ix, iy)
    a_o, b_o = (oy, -ox) if warp else (ox, oy)
    scale_i = R(1) / math.sqrt(a_i * a_i + iz * iz)
    scale_o = R(1) / math.sqrt(a_o * a_o + oz * oz)
    cos_half = cos_half_difference(R, a_i * scale_i, iz * scale_i, a_o * scale_o, oz * scale_o)
    return a_i, b_i, scale_i, a_o, b_o, scale_o, overlap(R, cos_half, precision)


@njit(**INLINE)
def seen_along(R, c, s, a_i, iz, scale_i, a_o, oz, scale_o, u):
    """`P` of a tangent angle given by its cosine and sine."""
    x = max(s * a_i + c * iz, R(0)) * scale_i
    y = max(s * a_o + c * oz, R(0)) * scale_o
    return masked(R, x, y, u)


@njit(**INLINE)
def segment(R, thesis, row, precision, c, s, a_i, b_i, iz, a_o, b_o, oz):
    """`f_s M cos theta_i` as (surface, volume without `A`).

    Times `seen_along` it is the integrand of level `far`; 0 where `M` is.
    """
    t_i, n_i = c * a_i - s * iz, s * a_i + c * iz
    t_o, n_o = c * a_o - s * oz, s * a_o + c * oz
    cos_i, cos_o = cos_inclination(R, b_i, n_i), cos_inclination(R, b_o, n_o)
    sin_phi_i, cos_phi_i = unit_azimuth(R, b_i, n_i, cos_i)
    sin_phi_o, cos_phi_o = unit_azimuth(R, b_o, n_o, cos_o)
    cos_half = cos_half_difference(R, sin_phi_i, cos_phi_i, sin_phi_o, cos_phi_o)
    u = overlap(R, cos_half, precision)
    m = masked(R, max(cos_phi_i, R(0)), max(cos_phi_o, R(0)), u) * cos_i
    surface, volume = published_terms(R, thesis, row, t_i, cos_i, t_o, cos_o, cos_half)
    return surface * m, volume * m


@njit(**INLINE)
def cell_lobes(R, row, half, c, s, a_i, b_i, iz, a_o, b_o, oz):
    """Surface and volume lobe averaged over a stretch of tangent angle, `half` [rad] to each side.

    Across it theta_h is taken as linear in the tangent angle, with slope
    -(cos phi_i + cos phi_o)/2: exact in the plane of the thread, an approximation out of it.
    """
    t_i, n_i = c * a_i - s * iz, s * a_i + c * iz
    t_o, n_o = c * a_o - s * oz, s * a_o + c * oz
    cos_i, cos_o = cos_inclination(R, b_i, n_i), cos_inclination(R, b_o, n_o)
    _, cos_phi_i = unit_azimuth(R, b_i, n_i, cos_i)
    _, cos_phi_o = unit_azimuth(R, b_o, n_o, cos_o)
    theta_h = half_inclination(R, t_i, cos_i, t_o, cos_o)
    reach = R(0.5) * abs(cos_phi_i + cos_phi_o) * half
    surface = mean_gaussian(
        R, row[GAMMA_SURFACE], row[SURFACE_GAUSSIAN], row[SURFACE_GAUSSIAN + 1], theta_h, reach
    )
    volume = mean_gaussian(
        R, row[GAMMA_VOLUME], row[VOLUME_GAUSSIAN], row[VOLUME_GAUSSIAN + 1], theta_h, reach
    )
    kd = row[ISOTROPIC]
    return surface, (R(1) - kd) * volume + kd


@njit(**INLINE)
def mean_gaussian(R, width, half_precision, norm, x, reach):
    """Mean of the Gaussian over [x - reach, x + reach]."""
    ratio = reach / width
    if ratio < R(0.05):
        # The difference of error functions would cancel; two terms of its series do not.
        z = x / width
        g = gaussian(R, half_precision, norm, x)
        return g * (R(1) + (z * z - R(1)) * ratio * ratio * R(1.0 / 6.0))
    scale = R(math.sqrt(0.5)) / width
    high, low = erf(R, (x + reach) * scale), erf(R, (x - reach) * scale)
    return R(0.25) * (high - low) / reach
