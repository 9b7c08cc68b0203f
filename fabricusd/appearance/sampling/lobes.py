"""The lobes of the surface sampler: directions around one thread, cut off at the cloth's horizon.

A lobe represents a stretch of thread around the tangent angle psi0. In the frame of that thread

    p(theta, phi) = p(theta)/cos theta * cos phi/(2 sin phi_m),   |phi| < phi_m
    phi_m(theta) = acos(clamp(tan theta tan psi0, 0, 1))

This density is positive above the cloth and in front of the thread, where the published law is not
0, and nowhere else. `p(theta)` is a normal distribution truncated to the inclinations that are
above the cloth at some azimuth. Its mean is the mirror inclination, moved inside that interval so
that the mass there never vanishes. The isotropic term uses the cosine about the thread's normal
instead, truncated in the same way: projected along the normal, its directions fill half a disk and
half an ellipse of semi-axis cos psi0. Every density is per steradian and exact.

At level `thread` the surface term is a normal distribution in `h = sin phi_h` about the position
`w` across the thread, where `phi_h` is half way between the azimuths of viewer and light. Part of
the lobe (`_share_across`) draws its azimuths from the same distribution, truncated to those above
the cloth:

    p(phi) = p(h) cos(phi_h)/2,   phi_h = (phi + phi_o)/2

Source: `docs/model.md` section 6, which draws the isotropic term uniformly in sin theta. On spun
polyester at level `weave`, the cosine leaves a variance over mean^2 of .14 instead of .19.
"""

from __future__ import annotations

import math

from numba import njit

from fabricusd.kernels.real import INLINE, acos, asin, atan2, cos, erf, erfinv, exp, sin

STEEPEST = math.radians(89.5)
"""Limit on the tangent angle of a lobe: beyond it, hardly any direction is above the cloth."""

SURFACE, VOLUME, ISOTROPIC = 0, 1, 2
"""The lobes of one thread, in the order of every table."""
THREAD_LOBES = 3
"""To add a lobe, add its number above, its density to `lobe_densities`, and its sampling to
`sample_lobe` and `sample_any_lobe`. All other code loops up to THREAD_LOBES."""

_HALF_PI = math.pi / 2
_SQRT_2 = math.sqrt(2.0)


@njit(**INLINE)
def theta_range(R, psi0):
    """Inclinations (low, high) [rad] that are above the cloth for some azimuth."""
    if psi0 >= R(0):
        return R(-_HALF_PI), R(_HALF_PI) - psi0
    return R(-_HALF_PI) - psi0, R(_HALF_PI)


@njit(**INLINE)
def cut_normal(R, x, mean, deviation, low, high):
    """Density [1/rad] at x of a normal distribution truncated to [low, high], which holds
    `mean`."""
    scale = R(1 / _SQRT_2) / deviation
    mass = erf(R, (high - mean) * scale) - erf(R, (low - mean) * scale)
    z = (x - mean) * scale
    return R(2 / math.sqrt(math.pi)) * scale * exp(R, -z * z) / mass


@njit(**INLINE)
def sample_cut_normal(R, u, mean, deviation, low, high):
    """A sample of `cut_normal` [rad] for a number u in [0, 1)."""
    scale = R(1 / _SQRT_2) / deviation
    first, last = erf(R, (low - mean) * scale), erf(R, (high - mean) * scale)
    x = mean + erfinv(R, first + u * (last - first)) / scale
    return min(max(x, low), high)


@njit(**INLINE)
def lobe_densities(R, stretch, theta_o, t, b, n):
    """Densities [1/sr] of a `Stretch`'s lobes at a direction (t, b, n) of the thread frame.

    The direction must be above the cloth, with n > 0.
    """
    tangent = stretch.tan
    cos_theta = math.sqrt(b * b + n * n)
    inverse = R(1) / max(cos_theta, R(1e-9))
    theta = atan2(R, t, cos_theta)
    low, high = theta_range(R, stretch.psi0)
    mean = min(max(-theta_o, low), high)
    edge = min(max(t * tangent * inverse, R(0)), R(1))
    sin_m = math.sqrt(max((R(1) - edge) * (R(1) + edge), R(1e-12)))
    around = R(0.5) * n * inverse / sin_m
    surface = cut_normal(R, theta, mean, stretch.surface_width, low, high) * inverse * around
    volume = cut_normal(R, theta, mean, stretch.volume_width, low, high) * inverse * around
    cosine = R(1) / math.sqrt(R(1) + tangent * tangent)
    return surface, volume, R(2 / math.pi) * n / (R(1) + cosine)


@njit(**INLINE)
def narrowed(densities, by):
    """`densities` with that of the surface lobe multiplied by `by`, a `density_across`."""
    return densities[SURFACE] * by, densities[VOLUME], densities[ISOTROPIC]


_NARROWEST = 2e-3
"""Least half-width [rad] of a range of azimuths, so that densities over the range stay finite."""


@njit(**INLINE)
def _share_across(R, beta, tangent):
    """The share of the surface lobe that follows the position across the thread.

    The rest keeps its cosine in azimuth, which is better for wide highlights and on pile.
    """
    return min(max(R(1.1) - R(2) * beta, R(0.25)), R(0.9)) / math.sqrt(R(1) + tangent * tangent)


@njit(**INLINE)
def _across_range(R, t, cos_theta, tangent, phi_o):
    """Sines (low, high) of phi_h for lights above the cloth."""
    edge = min(max(t * tangent / max(cos_theta, R(1e-9)), R(0)), R(1))
    limit = max(acos(R, edge), R(_NARROWEST))
    return sin(R, R(0.5) * (phi_o - limit)), sin(R, R(0.5) * (phi_o + limit))


@njit(**INLINE)
def azimuth_seen(R, b_o, n_o):
    """Azimuth [rad] of a viewer (b_o, n_o) about its thread, clamped to the front of the thread."""
    return atan2(R, b_o, max(n_o, R(0)))


@njit(**INLINE)
def density_across(R, tangent, phi_o, w, beta, t, b, n):
    """Ratio of the surface lobe's density at level `thread` to the one of `lobe_densities`.

    w : position across the thread in [-1, 1]; beta : deviation of `scattering.across`
    """
    cos_theta = math.sqrt(b * b + n * n)
    inverse = R(1) / max(cos_theta, R(1e-9))
    low, high = _across_range(R, t, cos_theta, tangent, phi_o)
    phi_h = R(0.5) * (atan2(R, b, n) + phi_o)
    p = cut_normal(R, sin(R, phi_h), min(max(w, low), high), beta, low, high)
    edge = min(max(t * tangent * inverse, R(0)), R(1))
    sin_m = math.sqrt(max((R(1) - edge) * (R(1) + edge), R(1e-12)))
    share = _share_across(R, beta, tangent)
    return R(1) - share + share * p * cos(R, phi_h) * sin_m / (n * inverse)


@njit(**INLINE)
def sample_across(R, psi0, tangent, deviation, theta_o, phi_o, w, beta, u1, u2):
    """A direction (t, b, n) of the thread frame, drawn from the surface lobe at level `thread`."""
    low, high = theta_range(R, psi0)
    mean = min(max(-theta_o, low), high)
    theta = sample_cut_normal(R, u1, mean, deviation, low, high)
    t, cos_theta = sin(R, theta), max(cos(R, theta), R(0))
    share = _share_across(R, beta, tangent)
    edge = min(max(t * tangent / max(cos_theta, R(1e-6)), R(0)), R(1))
    u = (u2 - share) / (R(1) - share)
    sin_phi = (R(2) * u - R(1)) * math.sqrt((R(1) - edge) * (R(1) + edge))
    low, high = _across_range(R, t, cos_theta, tangent, phi_o)
    h = sample_cut_normal(R, min(u2 / share, R(1)), min(max(w, low), high), beta, low, high)
    phi = R(2) * asin(R, h) - phi_o
    narrow = u2 < share
    b = sin(R, phi) if narrow else sin_phi
    n = cos(R, phi) if narrow else math.sqrt((R(1) - sin_phi) * (R(1) + sin_phi))
    return t, cos_theta * b, cos_theta * n


@njit(**INLINE)
def sample_lobe(R, lobe, stretch, theta_o, u1, u2):
    """A direction (t, b, n) of the thread frame, drawn from a `Stretch`'s `lobe`."""
    if lobe == ISOTROPIC:
        return _sample_cosine(R, stretch.tan, u1, u2)
    width = stretch.surface_width if lobe == SURFACE else stretch.volume_width
    return _sample_normal(R, stretch.psi0, stretch.tan, width, theta_o, u1, u2)


@njit(**INLINE)
def sample_any_lobe(R, lobe, stretch, theta_o, u1, u2):
    """`sample_lobe` without a branch, for vectorised loops; lobe : a number of type R."""
    width = stretch.surface_width if lobe == R(SURFACE) else stretch.volume_width
    t, b, n = _sample_normal(R, stretch.psi0, stretch.tan, width, theta_o, u1, u2)
    ti, bi, ni = _sample_cosine(R, stretch.tan, u1, u2)
    isotropic = lobe == R(ISOTROPIC)
    return (ti if isotropic else t), (bi if isotropic else b), (ni if isotropic else n)


@njit(**INLINE)
def _sample_normal(R, psi0, tangent, deviation, theta_o, u1, u2):
    low, high = theta_range(R, psi0)
    mean = min(max(-theta_o, low), high)
    theta = sample_cut_normal(R, u1, mean, deviation, low, high)
    t, cos_theta = sin(R, theta), max(cos(R, theta), R(0))
    edge = min(max(t * tangent / max(cos_theta, R(1e-6)), R(0)), R(1))
    sin_phi = (R(2) * u2 - R(1)) * math.sqrt((R(1) - edge) * (R(1) + edge))
    return t, cos_theta * sin_phi, cos_theta * math.sqrt((R(1) - sin_phi) * (R(1) + sin_phi))


@njit(**INLINE)
def _sample_cosine(R, tangent, u1, u2):
    """A direction of the isotropic term: a point on the half disk or on the half ellipse."""
    cosine = R(1) / math.sqrt(R(1) + tangent * tangent)
    v = u1 * (R(1) + cosine)
    on_disk = v < R(1)
    radius = math.sqrt(v if on_disk else min((v - R(1)) / max(cosine, R(1e-6)), R(1)))
    turn = R(math.pi) * (u2 - R(0.5))
    t, b = radius * cos(R, turn), radius * sin(R, turn)
    # The half disk is on the side that the horizon does not cut.
    side = R(-1) if tangent >= R(0) else R(1)
    t *= side if on_disk else -side * cosine
    return t, b, math.sqrt(max(R(1) - t * t - b * b, R(0)))
