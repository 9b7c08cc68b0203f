"""Importance sampling of one thread: directions over the whole sphere, and their density.

A mixture of three lobes, each exact in closed form per steradian:

- surface: theta_i normal around -theta_o with deviation 2 gs, cut at +-90 degrees; azimuth by
  cos(phi_d/2)/4;
- volume: the same with 2 gv; azimuth uniform;
- isotropic: uniform in theta for the published models, whose 1/cos^2(theta_d) lifts grazing
  directions, uniform on the sphere for `conserving`; azimuth uniform.

The shares follow estimates of the terms' energies; the isotropic lobe keeps at least a tenth, which
bounds the weight of every direction. Source: MODEL section 6.
"""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.frame import cos_inclination, unit_azimuth
from fabricusd.appearance.lobes import fresnel
from fabricusd.appearance.real import INLINE, KERNEL, asin, atan2, cos, erf, erfinv, exp, sin
from fabricusd.appearance.thread_terms import (
    BRIGHTNESS,
    CONSERVING,
    COS_MINIMUM,
    GAMMA_SURFACE,
    GAMMA_VOLUME,
    INVERSE_T_MAX,
    IOR_EXCESS,
    ISOTROPIC,
    MODEL,
    pair_angles,
    transmission,
)

ISOTROPIC_SHARE = 0.1
"""Least share of the isotropic lobe."""
_HALF_PI = math.pi / 2
_SQRT_2 = math.sqrt(2.0)


@njit(**INLINE)
def lobe_shares(R, row, cos_o):
    """(surface, volume): shares of the mixture for the viewer's inclination; isotropic the rest."""
    kd = row[ISOTROPIC]
    if row[MODEL] == R(CONSERVING):
        through = transmission(R, row, cos_o)
        surface = R(1) - through
        whole = through * through * row[INVERSE_T_MAX] * row[BRIGHTNESS]
        volume = (R(1) - kd) * whole
        isotropic = kd * whole
    else:
        # Along the mirror cone, at an azimuth where half of the reflection lies.
        reflected, transmitted = fresnel(R, row[IOR_EXCESS], R(0.8) * cos_o)
        surface = R(8) * reflected
        whole = R(2 * math.pi) * transmitted * transmitted * row[BRIGHTNESS]
        whole = whole / max(cos_o, row[GAMMA_VOLUME])
        volume = (R(1) - kd) * whole
        isotropic = kd * whole
    total = surface + volume + isotropic
    scale = R(1 - ISOTROPIC_SHARE) / max(total, R(1e-30))
    # A black, unreflecting thread scatters nothing; any density will do.
    return surface * scale, volume * scale


@njit(**INLINE)
def cut_normal_bounds(R, mean, deviation):
    """erf at both ends of [-pi/2, pi/2] for a normal distribution around `mean` [rad]."""
    scale = R(1) / (deviation * R(_SQRT_2))
    return erf(R, (R(-_HALF_PI) - mean) * scale), erf(R, (R(_HALF_PI) - mean) * scale)


@njit(**INLINE)
def cut_normal(R, theta, mean, deviation):
    """Density [1/rad] of a normal distribution cut at +-90 degrees."""
    low, high = cut_normal_bounds(R, mean, deviation)
    x = (theta - mean) / deviation
    return exp(R, R(-0.5) * x * x) * R(_SQRT_2 / math.sqrt(math.pi)) / (deviation * (high - low))


@njit(**INLINE)
def sample_cut_normal(R, mean, deviation, u):
    """Inclination [rad] by inversion of `cut_normal`."""
    low, high = cut_normal_bounds(R, mean, deviation)
    theta = mean + deviation * R(_SQRT_2) * erfinv(R, low + u * (high - low))
    return min(max(theta, R(-_HALF_PI)), R(_HALF_PI))


@njit(**KERNEL)
def density(R, row, ix, iy, iz, ox, oy, oz):
    """pdf(wi) [1/sr] of `sample_direction`, over the whole sphere."""
    cos_i, cos_o, cos_half = pair_angles(R, iy, iz, oy, oz)
    theta_i, theta_o = atan2(R, ix, cos_i), atan2(R, ox, cos_o)
    surface, volume = lobe_shares(R, row, cos_o)
    inverse_cos = R(1) / max(cos_i, R(COS_MINIMUM))
    p = surface * cut_normal(R, theta_i, -theta_o, R(2) * row[GAMMA_SURFACE]) * R(0.25) * cos_half
    p += volume * cut_normal(R, theta_i, -theta_o, R(2) * row[GAMMA_VOLUME]) * R(0.5 / math.pi)
    p *= inverse_cos
    sphere = R(0.25 / math.pi)
    even = R(0.5 / (math.pi * math.pi)) * inverse_cos
    return p + (R(1) - surface - volume) * (sphere if row[MODEL] == R(CONSERVING) else even)


@njit(**KERNEL)
def sample_direction(R, row, ox, oy, oz, u0, u1, u2):
    """wi in the thread frame for three numbers in [0, 1): lobe, inclination, azimuth."""
    cos_o = cos_inclination(R, oy, oz)
    theta_o = atan2(R, ox, cos_o)
    sin_phi_o, cos_phi_o = unit_azimuth(R, oy, oz, cos_o)
    surface, volume = lobe_shares(R, row, cos_o)
    around = R(math.pi) * (R(2) * u2 - R(1))
    if u0 < surface:
        theta = sample_cut_normal(R, -theta_o, R(2) * row[GAMMA_SURFACE], u1)
        # The integral of cos(phi_d/2)/4 is (1 + sin(phi_d/2))/2.
        around = R(2) * asin(R, R(2) * u2 - R(1))
    elif u0 < surface + volume:
        theta = sample_cut_normal(R, -theta_o, R(2) * row[GAMMA_VOLUME], u1)
    elif row[MODEL] == R(CONSERVING):
        theta = asin(R, R(2) * u1 - R(1))
    else:
        theta = R(math.pi) * (u1 - R(0.5))
    s, c = sin(R, around), cos(R, around)
    cos_theta = max(cos(R, theta), R(0))
    return (
        sin(R, theta),
        cos_theta * (sin_phi_o * c + cos_phi_o * s),
        cos_theta * (cos_phi_o * c - sin_phi_o * s),
    )
