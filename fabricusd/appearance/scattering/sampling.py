"""Importance sampling of one thread: directions over the whole sphere, and their density.

The sampler is a mixture of lobes, each with an exact closed form per steradian:

- surface, with azimuth distributed as cos(phi_d/2)/4 and theta_i normally distributed with the
  width of the model, about twice gs, truncated at +-90 degrees;
- surface, with uniform azimuth, for the rise of Fresnel reflection towards phi_d = 180 degrees,
  which offsets the cosine;
- volume, with a width of its own and uniform azimuth;
- isotropic, uniform on the sphere.

The shares follow the model's estimates of the energies of its terms. The isotropic lobe gets at
least a tenth, which bounds the weight of every direction. Source: MODEL section 6.
"""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.frame import cos_inclination, unit_azimuth
from fabricusd.appearance.scattering.columns import (
    IOR_EXCESS,
    MODEL,
    SURFACE_WIDTH,
    VOLUME_WIDTH,
)
from fabricusd.appearance.scattering.lobes import COS_MINIMUM, fresnel
from fabricusd.appearance.scattering.terms import energies, pair_angles
from fabricusd.kernels.real import INLINE, PART, asin, atan2, cos, erf, erfinv, exp, sin

ISOTROPIC_SHARE = 0.1
"""Least share of the isotropic lobe."""
_HALF_PI = math.pi / 2
_SQRT_2 = math.sqrt(2.0)


@njit(**INLINE)
def inclination_lobe(R, wide, sin_o, cos_o):
    """(mean [rad], deviation [rad], narrowing) of the normal distribution that represents a lobe.

    The lobe has the standard deviation `wide` in theta_i and is multiplied by
    cos^2(theta_i)/cos^2(theta_d). To second order around the mirror direction, the cosines narrow
    the lobe and shift it towards the normal plane. Towards grazing views this expansion fails and
    is faded out. `narrowing` is the deviation over `wide`, and thereby the energy of the lobe.
    """
    narrowing = R(1) / math.sqrt(R(1) + R(1.5) * cos_o * wide * wide)
    deviation = wide * narrowing
    shift = sin_o * cos_o * deviation * deviation
    return shift - atan2(R, sin_o, cos_o), deviation, narrowing


@njit(**INLINE)
def lobe_shares(R, row, cos_o, narrow_s, narrow_v):
    """(surface by cosine, surface uniform, volume): shares of the mixture.

    The isotropic lobe has the rest.

    narrow_s, narrow_v : `narrowing` of `inclination_lobe` for both widths
    """
    # Approximate F cos(phi_d/2) at theta_d = -theta_o by a + b cos(phi_d/2), interpolating it at
    # phi_d = 0 and 120 degrees.
    f_0, transmitted = fresnel(R, row[IOR_EXCESS], cos_o)
    f_1, _ = fresnel(R, row[IOR_EXCESS], R(0.5) * cos_o)
    even = max(f_1 - f_0, R(0))
    by_cosine = max(R(2) * f_0 - f_1, R(0))
    even *= R(2 * math.pi)
    by_cosine *= R(4)
    surface, volume, isotropic = energies(
        R, int(row[MODEL]), row, cos_o, transmitted, even + by_cosine, narrow_s, narrow_v
    )
    even *= surface
    by_cosine *= surface
    # A black, unreflecting thread scatters nothing, so any density is valid.
    total = max(even + by_cosine + volume + isotropic, R(1e-30))
    scale = min(R(1) / total, R(1 - ISOTROPIC_SHARE) / max(total - isotropic, R(1e-30)))
    return by_cosine * scale, even * scale, volume * scale


@njit(**INLINE)
def cut_normal_bounds(R, mean, deviation):
    """erf at both ends of [-pi/2, pi/2] for a normal distribution around `mean` [rad]."""
    scale = R(1) / (deviation * R(_SQRT_2))
    return erf(R, (R(-_HALF_PI) - mean) * scale), erf(R, (R(_HALF_PI) - mean) * scale)


@njit(**INLINE)
def cut_normal(R, theta, mean, deviation):
    """Density [1/rad] of a normal distribution truncated at +-90 degrees."""
    low, high = cut_normal_bounds(R, mean, deviation)
    x = (theta - mean) / deviation
    return exp(R, R(-0.5) * x * x) * R(_SQRT_2 / math.sqrt(math.pi)) / (deviation * (high - low))


@njit(**INLINE)
def sample_cut_normal(R, mean, deviation, u):
    """Inclination [rad] drawn from `cut_normal` by inversion."""
    low, high = cut_normal_bounds(R, mean, deviation)
    theta = mean + deviation * R(_SQRT_2) * erfinv(R, low + u * (high - low))
    return min(max(theta, R(-_HALF_PI)), R(_HALF_PI))


@njit(**PART)
def density(R, row, ix, iy, iz, ox, oy, oz):
    """pdf(wi) [1/sr] of `sample_direction`, over the whole sphere."""
    cos_i, cos_o, cos_half = pair_angles(R, iy, iz, oy, oz)
    theta_i = atan2(R, ix, cos_i)
    mean_s, deviation_s, narrow_s = inclination_lobe(R, row[SURFACE_WIDTH], ox, cos_o)
    mean_v, deviation_v, narrow_v = inclination_lobe(R, row[VOLUME_WIDTH], ox, cos_o)
    by_cosine, even, volume = lobe_shares(R, row, cos_o, narrow_s, narrow_v)
    around = R(0.25) * cos_half * by_cosine + R(0.5 / math.pi) * even
    p = around * cut_normal(R, theta_i, mean_s, deviation_s)
    p += R(0.5 / math.pi) * volume * cut_normal(R, theta_i, mean_v, deviation_v)
    isotropic = R(1) - by_cosine - even - volume
    return p / max(cos_i, R(COS_MINIMUM)) + R(0.25 / math.pi) * isotropic


@njit(**PART)
def sample_direction(R, row, ox, oy, oz, u0, u1, u2):
    """wi in the thread frame for three numbers in [0, 1): lobe, inclination, azimuth."""
    cos_o = cos_inclination(R, oy, oz)
    sin_phi_o, cos_phi_o = unit_azimuth(R, oy, oz, cos_o)
    mean_s, deviation_s, narrow_s = inclination_lobe(R, row[SURFACE_WIDTH], ox, cos_o)
    mean_v, deviation_v, narrow_v = inclination_lobe(R, row[VOLUME_WIDTH], ox, cos_o)
    by_cosine, even, volume = lobe_shares(R, row, cos_o, narrow_s, narrow_v)
    turn = R(2) * u2 - R(1)
    # The cumulative distribution of cos(phi_d/2)/4 is (1 + sin(phi_d/2))/2.
    around = R(2) * asin(R, turn) if u0 < by_cosine else R(math.pi) * turn
    if u0 < by_cosine + even:
        theta = sample_cut_normal(R, mean_s, deviation_s, u1)
    elif u0 < by_cosine + even + volume:
        theta = sample_cut_normal(R, mean_v, deviation_v, u1)
    else:
        theta = asin(R, R(2) * u1 - R(1))
    s, c = sin(R, around), cos(R, around)
    cos_theta = max(cos(R, theta), R(0))
    return (
        sin(R, theta),
        cos_theta * (sin_phi_o * c + cos_phi_o * s),
        cos_theta * (cos_phi_o * c - sin_phi_o * s),
    )
