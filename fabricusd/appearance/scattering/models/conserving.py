"""The `conserving` model: reciprocal, and passive for every albedo `A` up to 1. MODEL section 2.

    surface = min(1, ks F_r(eta, cos theta_d cos(phi_d/2))) cos(phi_d/2)/4
              K(theta_i, theta_o; 2 gs)/max(cos theta_i, cos theta_o)
    volume  = T(theta_i) T(theta_o)/T_max
              ((1-kd) K(theta_i, theta_o; 2 gv)/(2 pi max(cos theta_i, cos theta_o)) + kd/pi^2)

K is the longitudinal kernel of [dEon2011]. T = 1 - E, where E(theta) is the directional albedo of
the surface term, tabulated per thread. K/max(cos_i, cos_o) integrates to at most 1 against cos^2,
so the volume term scatters at most T/T_max <= 1 of the light that the surface transmits.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit

from fabricusd.appearance.frame import cos2_difference_inclination
from fabricusd.appearance.scattering import plain_lobes as plain
from fabricusd.appearance.scattering.columns import (
    BRIGHTNESS,
    COLUMNS,
    GAMMA_SURFACE,
    INVERSE_T_MAX,
    IOR_EXCESS,
    ISOTROPIC,
    SURFACE_GAIN,
    SURFACE_LOBE,
    TRANSMISSION,
    TRANSMISSION_ENTRIES,
    VOLUME_LOBE,
)
from fabricusd.appearance.scattering.lobes import (
    COS_MINIMUM,
    LARGEST_IOR,
    NARROWEST,
    fresnel,
    longitudinal,
    longitudinal_constants,
)
from fabricusd.appearance.scattering.model import CONSERVING, Floats, ThreadModel
from fabricusd.fabric import Thread
from fabricusd.kernels.real import INLINE, KERNEL

_PIECES = 6
"""Subdivisions of each interval of the quadrature, each with _NODES Gauss-Legendre points."""
_NODES = 12
_AZIMUTHS = 24
_REACH = 9.0
"""Half-width of the interval that the quadrature covers, in standard deviations of theta."""


@njit(**INLINE)
def factors(R, row, sin_i, cos_i, sin_o, cos_o, cos_half):
    """See `ThreadModel.factors`."""
    cos2_d = cos2_difference_inclination(R, sin_i, cos_i, sin_o, cos_o)
    reflected, _ = fresnel(R, row[IOR_EXCESS], math.sqrt(cos2_d) * cos_half)
    reflected = min(R(1), row[SURFACE_GAIN] * reflected)
    return R(0.25) * reflected * cos_half / max(max(cos_i, cos_o), R(COS_MINIMUM)), R(1)


@njit(**INLINE)
def lobes(R, row, sin_i, cos_i, sin_o, cos_o):
    """See `ThreadModel.lobes`."""
    k_s = longitudinal(R, row[SURFACE_LOBE], row[SURFACE_LOBE + 1], sin_i, cos_i, sin_o, cos_o)
    k_v = longitudinal(R, row[VOLUME_LOBE], row[VOLUME_LOBE + 1], sin_i, cos_i, sin_o, cos_o)
    kd = row[ISOTROPIC]
    widest = max(max(cos_i, cos_o), R(COS_MINIMUM))
    return k_s, (R(1) - kd) * R(0.5 / math.pi) * k_v / widest + kd * R(1 / (math.pi * math.pi))


def lobe_constants(gamma: float) -> tuple[float, float]:
    """Constants of K; like a Gaussian in theta_h, it is twice as wide in theta_i as `gamma`."""
    return longitudinal_constants(2.0 * gamma)


@njit(**INLINE)
def transmission(R, row, cos_theta):
    """T(theta) = 1 - E(theta), the transmittance of the surface, from the thread's table.

    The entries are uniform in sqrt(cos theta). E is even in theta and therefore smooth in the
    cosine, and it is steep only within the lobe's width of 90 degrees, where this spacing is
    finest.
    """
    position = math.sqrt(cos_theta) * R(TRANSMISSION_ENTRIES - 1)
    index = np.int32(min(position, R(TRANSMISSION_ENTRIES - 1)))
    low = row[TRANSMISSION + index]
    high = row[TRANSMISSION + 1 + index]
    return low + (position - R(index)) * (high - low)


@njit(**INLINE)
def looked_up(R, row, cos_i, cos_o):
    """T(theta_i) T(theta_o)/T_max."""
    return transmission(R, row, cos_i) * transmission(R, row, cos_o) * row[INVERSE_T_MAX]


@njit(**INLINE)
def energies(R, row, cos_o, transmitted, around, narrow_s, narrow_v):
    """See `ThreadModel.energies`; they follow from E, which is read from the table."""
    through = transmission(R, row, cos_o)
    whole = through * through * row[INVERSE_T_MAX] * row[BRIGHTNESS]
    kd = row[ISOTROPIC]
    return (R(1) - through) / max(around, R(1e-30)), (R(1) - kd) * whole, kd * whole


def thread_transmission(thread: Thread) -> Floats:
    """(TRANSMISSION_ENTRIES,) T at uniformly spaced sqrt(cos theta) from 0 to 1."""
    gs = max(thread.gamma_surface, NARROWEST)
    return np.asarray(1.0 - surface_albedo(gs, thread.ior, thread.surface_gain))


@lru_cache(maxsize=256)
def surface_albedo(gamma_surface: float, ior: float, surface_gain: float) -> Floats:
    """(TRANSMISSION_ENTRIES,) directional albedo `E(theta)` of the surface term, at most 1.

    E is `integral f_surface cos(theta_o) dwo`, at uniformly spaced sqrt(cos theta) from 0 to 1.
    """
    row = np.zeros(COLUMNS)
    ior, gamma_surface = min(ior, LARGEST_IOR), max(gamma_surface, NARROWEST)
    row[IOR_EXCESS] = (ior - 1.0) * (ior + 1.0)
    row[SURFACE_GAIN] = surface_gain
    row[GAMMA_SURFACE] = gamma_surface
    row[SURFACE_LOBE : SURFACE_LOBE + 2] = lobe_constants(gamma_surface)
    albedo = np.empty(TRANSMISSION_ENTRIES)
    x, x_weight = np.polynomial.legendre.leggauss(_NODES)
    y, y_weight = np.polynomial.legendre.leggauss(_AZIMUTHS)
    _integrate_surface(row, x, x_weight, (y + 1) * math.pi / 2, y_weight * math.pi, albedo)
    albedo = np.minimum(albedo, 1.0)
    albedo.flags.writeable = False
    return albedo


@njit(**KERNEL)
def _integrate_surface(row, x, x_weight, phi, phi_weight, out):
    """`out[k]` = E at sqrt(cos theta) = k/(n-1), with nodes that follow the lobe however narrow."""
    R = np.float64
    reach = 2.0 * _REACH * row[GAMMA_SURFACE]
    for k in range(out.size):
        cos_theta = (k / (out.size - 1)) ** 2
        sin_theta = math.sqrt(1.0 - cos_theta * cos_theta)
        theta = math.acos(cos_theta)
        high = min(-theta + reach, 0.5 * math.pi)
        # Split the integral where the larger of the two cosines has a kink: where the inclinations
        # are opposite or equal.
        bounds = (
            max(-theta - reach, -0.5 * math.pi), -theta, min(theta, high), high,
        )  # fmt: skip
        total = 0.0
        for part in range(3):
            step = (bounds[part + 1] - bounds[part]) / _PIECES
            for node in range(_PIECES * x.size):
                piece, a = divmod(node, x.size)
                o = bounds[part] + step * (piece + 0.5 * (x[a] + 1.0))
                sin_o, cos_o = math.sin(o), max(math.cos(o), 0.0)
                weight = 0.5 * step * x_weight[a] * cos_o * cos_o
                constants = row[SURFACE_LOBE], row[SURFACE_LOBE + 1]
                lobe = longitudinal(R, *constants, sin_theta, cos_theta, sin_o, cos_o)
                for b in range(phi.size):
                    factor, _ = factors(
                        R, row, sin_theta, cos_theta, sin_o, cos_o, math.cos(0.5 * phi[b])
                    )
                    total += weight * phi_weight[b] * factor * lobe
        out[k] = total


def plain_surface(thread: Thread, i: plain.Angles, o: plain.Angles) -> Floats:
    """(n,) surface term [1/sr], in plain NumPy."""
    cos_half = plain.half_azimuth(i, o)
    f = plain.fresnel(thread.ior, np.cos(0.5 * (i.theta - o.theta)) * cos_half)
    k = plain.longitudinal(i.theta, o.theta, 2 * thread.gamma_surface)
    widest = np.maximum(np.maximum(np.cos(i.theta), np.cos(o.theta)), 1e-6)
    return np.asarray(np.minimum(1, thread.surface_gain * f) * cos_half / 4 * k / widest)


@lru_cache(maxsize=64)
def plain_albedo(thread: Thread, count: int = 181) -> tuple[Floats, Floats]:
    """(|theta|, E) in plain NumPy: the directional albedo of the surface term, at most 1."""
    theta = np.linspace(0, math.pi / 2, count)
    x, x_weight = np.polynomial.legendre.leggauss(200)
    y, y_weight = np.polynomial.legendre.leggauss(64)
    shape = (len(x), len(y))
    still: Any = np.zeros(shape)
    o_phi = np.broadcast_to((y + 1) * math.pi / 2, shape)
    narrow = 2 * thread.gamma_surface
    albedo = np.empty(count)
    for k, t in enumerate(theta):
        # The nodes follow the lobe, because a narrow lobe falls between the points of a fixed grid.
        lo, hi = max(-math.pi / 2, -t - 9 * narrow), min(math.pi / 2, -t + 9 * narrow)
        out = np.broadcast_to((lo + (hi - lo) * (x + 1) / 2)[:, None], shape)
        i = plain.Angles(theta=np.full(shape, t), phi=still, psi=still)
        o = plain.Angles(theta=out, phi=o_phi, psi=still)
        value = plain_surface(thread, i, o) * np.cos(out) ** 2
        albedo[k] = x_weight @ value @ y_weight * math.pi * (hi - lo) / 2
    return theta, np.minimum(albedo, 1.0)


def plain_terms(thread: Thread, i: plain.Angles, o: plain.Angles) -> tuple[Floats, Floats]:
    """See `ThreadModel.plain`."""
    table, albedo = plain_albedo(thread)
    kept = 1 - albedo
    t_i, t_o = np.interp(abs(i.theta), table, kept), np.interp(abs(o.theta), table, kept)
    k = plain.longitudinal(i.theta, o.theta, 2 * thread.gamma_volume)
    widest = np.maximum(np.maximum(np.cos(i.theta), np.cos(o.theta)), 1e-6)
    lobe = (1 - thread.isotropic) * k / (2 * math.pi * widest)
    volume = t_i * t_o / kept.max() * (lobe + thread.isotropic / math.pi**2)
    return plain_surface(thread, i, o), volume


MODEL = ThreadModel(
    summary="reciprocal, passive, with light through the cloth",
    law=CONSERVING,
    factors=factors,
    lobes=lobes,
    lobe_constants=lobe_constants,
    looked_up=looked_up,
    transmission=thread_transmission,
    energies=energies,
    plain=plain_terms,
    most_albedo=1.0,
)
