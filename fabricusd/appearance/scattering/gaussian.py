"""The Gaussian lobes in theta_h and the bounded factors that the published models share."""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.frame import half_inclination
from fabricusd.appearance.scattering.columns import (
    BRIGHTNESS,
    GAMMA_SURFACE,
    GAMMA_VOLUME,
    ISOTROPIC,
    SURFACE_LOBE,
    VOLUME_LOBE,
)
from fabricusd.appearance.scattering.lobes import gaussian
from fabricusd.kernels.real import INLINE, erf

COS2_D_MINIMUM = 1e-6
COS_SUM_MINIMUM = 1e-3


@njit(**INLINE)
def compressed(R, cos2_d):
    """1/cos^2(theta_d), bounded by 1/COS2_D_MINIMUM."""
    return R(1) / max(cos2_d, R(COS2_D_MINIMUM))


@njit(**INLINE)
def spread(R, cos_i, cos_o):
    """1/(cos theta_i + cos theta_o), bounded by 1/COS_SUM_MINIMUM: a factor of the volume term."""
    return R(1) / max(cos_i + cos_o, R(COS_SUM_MINIMUM))


@njit(**INLINE)
def gaussian_lobes(R, row, sin_i, cos_i, sin_o, cos_o):
    """(g(gs, theta_h), (1 - kd) g(gv, theta_h) + kd)."""
    theta_h = half_inclination(R, sin_i, cos_i, sin_o, cos_o)
    kd = row[ISOTROPIC]
    g_s = gaussian(R, row[SURFACE_LOBE], row[SURFACE_LOBE + 1], theta_h)
    g_v = gaussian(R, row[VOLUME_LOBE], row[VOLUME_LOBE + 1], theta_h)
    return g_s, (R(1) - kd) * g_v + kd


@njit(**INLINE)
def gaussian_cell_lobes(R, row, half, sin_i, cos_i, cos_phi_i, sin_o, cos_o, cos_phi_o):
    """`gaussian_lobes` averaged over tangent angles up to `half` [rad] to each side.

    Over this range theta_h is approximated as linear in the tangent angle, with the slope
    -(cos phi_i + cos phi_o)/2. This is exact in the plane of the thread.
    """
    theta_h = half_inclination(R, sin_i, cos_i, sin_o, cos_o)
    reach = R(0.5) * abs(cos_phi_i + cos_phi_o) * half
    surface = mean_gaussian(
        R, row[GAMMA_SURFACE], row[SURFACE_LOBE], row[SURFACE_LOBE + 1], theta_h, reach
    )
    volume = mean_gaussian(
        R, row[GAMMA_VOLUME], row[VOLUME_LOBE], row[VOLUME_LOBE + 1], theta_h, reach
    )
    kd = row[ISOTROPIC]
    return surface, (R(1) - kd) * volume + kd


@njit(**INLINE)
def mean_gaussian(R, width, half_precision, norm, x, reach):
    """Mean of the Gaussian over [x - reach, x + reach]."""
    ratio = reach / width
    if ratio < R(0.05):
        # The difference of error functions would cancel; the first two terms of its series do not.
        z = x / width
        g = gaussian(R, half_precision, norm, x)
        return g * (R(1) + (z * z - R(1)) * ratio * ratio * R(1.0 / 6.0))
    scale = R(math.sqrt(0.5)) / width
    high, low = erf(R, (x + reach) * scale), erf(R, (x - reach) * scale)
    return R(0.25) * (high - low) / reach


@njit(**INLINE)
def gaussian_energies(R, row, cos_o, transmitted, around, narrow_s, narrow_v):
    """See `ThreadModel.energies`; up to a common factor, the volume's is that of a wide lobe."""
    kd = row[ISOTROPIC]
    whole = R(2 * math.pi) * transmitted * transmitted * row[BRIGHTNESS]
    volume = (R(1) - kd) * whole * narrow_v / max(cos_o, row[GAMMA_VOLUME])
    return R(2) * narrow_s, volume, kd * whole / max(cos_o, R(0.2))
