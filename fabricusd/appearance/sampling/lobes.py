"""The lobes that the surface sampler mixes: directions of one thread, cut at the cloth's horizon.

A lobe stands for a stretch of thread around one tangent angle psi0. In that thread's frame

    p(theta, phi) = p(theta)/cos theta * cos phi/(2 sin phi_m),   |phi| < phi_m
    phi_m(theta) = acos(clamp(tan theta tan psi0, 0, 1))

which is above the cloth and in front of the thread, where the published law is not 0, and nowhere
else. `p(theta)` is a normal distribution cut at the inclinations that are above the cloth at all;
its mean is the mirror inclination moved inside the cut, so that its mass there never vanishes. The
isotropic term has the cosine about the thread's normal instead, cut in the same way: seen along the
normal that is half a disk and half an ellipse, of semi-axis cos psi0. Every density is per
steradian and exact.

At level `thread` the surface term is a normal distribution in `h = sin phi_h` about the place `w`
across the thread, `phi_h` half way between the azimuths of viewer and light; so is part of the
lobe's azimuths there (`_share_across`), cut to those above the cloth:

    p(phi) = p(h) cos(phi_h)/2,   phi_h = (phi + phi_o)/2

Source: `docs/model.md` section 6, which has uniform in sin theta for the isotropic term; the cosine
leaves .14 instead of .19 of the variance over mean^2 on spun polyester at level `weave`.
"""

from __future__ import annotations

import math

from numba import njit

from fabricusd.kernels.real import INLINE, acos, asin, atan2, cos, erf, erfinv, exp, sin

STEEPEST = math.radians(89.5)
"""Tangent angles of lobes stop here: beyond, hardly a direction is above the cloth."""

SURFACE, VOLUME, ISOTROPIC = 0, 1, 2
"""The lobes of one thread, in the order of every table."""
THREAD_LOBES = 3
"""To add a lobe: its number above, its density in `lobe_densities`, and how it is drawn in
`sample_lobe` and `sample_any_lobe`; all else counts to THREAD_LOBES."""

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
    """Density [1/rad] at x of a normal distribution cut to [low, high]; `mean` is inside."""
    scale = R(1 / _SQRT_2) / deviation
    mass = erf(R, (high - mean) * scale) - erf(R, (low - mean) * scale)
    z = (x - mean) * scale
    return R(2 / math.sqrt(math.pi)) * scale * exp(R, -z * z) / mass


@njit(**INLINE)
def sample_cut_normal(R, u, mean, deviation, low, high):
    """Its value for a number u in [0, 1)."""
    scale = R(1 / _SQRT_2) / deviation
    first, last = erf(R, (low - mean) * scale), erf(R, (high - mean) * scale)
    x = mean + erfinv(R, first + u * (last - first)) / scale
    return min(max(x, low), high)


@njit(**INLINE)
def lobe_densities(R, psi0, tangent, surface, volume, theta_o, t, b, n):
    """Densities [1/sr] of the lobes at a direction (t, b, n) of the thread frame.

    The direction is above the cloth and n > 0; tangent : tan psi0; surface, volume : the normals'
    deviations [rad].
    """
    cos_theta = math.sqrt(b * b + n * n)
    inverse = R(1) / max(cos_theta, R(1e-9))
    theta = atan2(R, t, cos_theta)
    low, high = theta_range(R, psi0)
    mean = min(max(-theta_o, low), high)
    edge = min(max(t * tangent * inverse, R(0)), R(1))
    sin_m = math.sqrt(max((R(1) - edge) * (R(1) + edge), R(1e-12)))
    around = R(0.5) * n * inverse / sin_m
    on_surface = cut_normal(R, theta, mean, surface, low, high) * inverse * around
    on_volume = cut_normal(R, theta, mean, volume, low, high) * inverse * around
    cosine = R(1) / math.sqrt(R(1) + tangent * tangent)
    return on_surface, on_volume, R(2 / math.pi) * n / (R(1) + cosine)


@njit(**INLINE)
def narrowed(densities, by):
    """`lobe_densities` with the surface lobe's multiplied by `density_across`."""
    return densities[SURFACE] * by, densities[VOLUME], densities[ISOTROPIC]


_NARROWEST = 2e-3
"""Half the range of azimuths [rad] at the least, so that densities over it are numbers."""


@njit(**INLINE)
def _share_across(R, beta, tangent):
    """How much of the surface lobe goes by the place across; the rest keeps its cosine, which is
    the better of the two where the highlight is wide, and on pile."""
    return min(max(R(1.1) - R(2) * beta, R(0.25)), R(0.9)) / math.sqrt(R(1) + tangent * tangent)


@njit(**INLINE)
def _across_range(R, t, cos_theta, tangent, phi_o):
    """Sines (low, high) of the azimuths half way between the viewer and light above the cloth."""
    edge = min(max(t * tangent / max(cos_theta, R(1e-9)), R(0)), R(1))
    limit = max(acos(R, edge), R(_NARROWEST))
    return sin(R, R(0.5) * (phi_o - limit)), sin(R, R(0.5) * (phi_o + limit))


@njit(**INLINE)
def azimuth_seen(R, b_o, n_o):
    """Azimuth [rad] of a viewer (b_o, n_o) about its thread, held in front of it."""
    return atan2(R, b_o, max(n_o, R(0)))


@njit(**INLINE)
def density_across(R, tangent, phi_o, w, beta, t, b, n):
    """The surface lobe's density at level `thread` over that of `lobe_densities`.

    w : place across the thread in [-1, 1]; beta : deviation of `segment.across`
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
    """(t, b, n) of the thread frame from the surface lobe at level `thread`."""
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
def sample_lobe(R, lobe, psi0, tangent, surface, volume, theta_o, u1, u2):
    """(t, b, n) of the thread frame from `lobe`; surface, volume : the deviations [rad]."""
    if lobe == ISOTROPIC:
        return _sample_cosine(R, tangent, u1, u2)
    width = surface if lobe == SURFACE else volume
    return _sample_normal(R, psi0, tangent, width, theta_o, u1, u2)


@njit(**INLINE)
def sample_any_lobe(R, lobe, psi0, tangent, surface, volume, theta_o, u1, u2):
    """`sample_lobe` without a branch, for loops to be vectorised; lobe : a number of type R."""
    width = surface if lobe == R(SURFACE) else volume
    t, b, n = _sample_normal(R, psi0, tangent, width, theta_o, u1, u2)
    ti, bi, ni = _sample_cosine(R, tangent, u1, u2)
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
    """The isotropic term's direction: a place on the half disk or on the half ellipse."""
    cosine = R(1) / math.sqrt(R(1) + tangent * tangent)
    v = u1 * (R(1) + cosine)
    on_disk = v < R(1)
    radius = math.sqrt(v if on_disk else min((v - R(1)) / max(cosine, R(1e-6)), R(1)))
    turn = R(math.pi) * (u2 - R(0.5))
    t, b = radius * cos(R, turn), radius * sin(R, turn)
    # The disk's side is the one that the horizon leaves whole.
    side = R(-1) if tangent >= R(0) else R(1)
    t *= side if on_disk else -side * cosine
    return t, b, math.sqrt(max(R(1) - t * t - b * b, R(0)))
