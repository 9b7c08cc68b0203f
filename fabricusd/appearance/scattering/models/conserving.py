"""The `conserving` model: reciprocal, with the directional albedo E + A (1 - E) for every `A` <= 1.

    surface = min(1, ks F_r(eta, cos theta_d cos(phi_d/2))) cos(phi_d/2)/4
              K(theta_i, theta_o; 2 gs)/max(cos theta_i, cos theta_o)
    volume  = T(theta_i) T(theta_o)/T_max
              ((1-kd) K(theta_i, theta_o; 2 gv)/(2 pi max(cos theta_i, cos theta_o)) + kd/pi^2)
              + x(theta_i) x(theta_o)/(2 pi X)

K is the longitudinal kernel of [dEon2011]. T = 1 - E, where E(theta) is the directional albedo of
the surface term, tabulated per thread. K/max(cos_i, cos_o) integrates to at most 1 against cos^2,
so the first two terms are passive. At A = 1 they scatter E + V and lose 8 to 11 % of the light. The
last term returns it, as [KullaConty2017] does for a surface, here in one dimension:
x = max(0, 1 - E - V), and X is the integral of x cos^2(theta) dtheta over +-90 degrees of the table
as it is interpolated. Source: MODEL sections 2 and 13.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit

from fabricusd.appearance.frame import cos2_difference_inclination
from fabricusd.appearance.scattering import plain_lobes as plain
from fabricusd.appearance.scattering.columns import (
    BRIGHTNESS,
    COLUMNS,
    COMPLETION,
    COMPLETION_SCALE,
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
from fabricusd.cache import kept
from fabricusd.fabric import Thread
from fabricusd.kernels.cache import fingerprint
from fabricusd.kernels.real import INLINE, KERNEL, whole

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
def position(R, cos_theta):
    """Place of an inclination in the tables, from 0 to TRANSMISSION_ENTRIES - 1.

    The entries are uniform in sqrt(cos theta). Both are even in theta and therefore smooth in the
    cosine, and they are steep only within the lobe's width of 90 degrees, where this spacing is
    finest.
    """
    return min(math.sqrt(cos_theta) * R(TRANSMISSION_ENTRIES - 1), R(TRANSMISSION_ENTRIES - 1))


@njit(**INLINE)
def read(R, row, place):
    """(T, x/sqrt(2 pi X)) at a `position`."""
    entry = whole(np.int32(place))
    part = place - R(entry)
    through, lost = row[TRANSMISSION + entry], row[COMPLETION + entry]
    through += part * (row[TRANSMISSION + 1 + entry] - through)
    lost += part * (row[COMPLETION + 1 + entry] - lost)
    return through, lost


@njit(**INLINE)
def tabulated(R, row, cos_theta):
    """(T, x/sqrt(2 pi X)): the transmittance of the surface, and the light that is lost."""
    return read(R, row, position(R, cos_theta))


@njit(**INLINE)
def looked_up(R, row, through_i, lost_i, through_o, lost_o):
    """(T(theta_i) T(theta_o)/T_max, x(theta_i) x(theta_o)/(2 pi X))."""
    return through_i * through_o * row[INVERSE_T_MAX], lost_i * lost_o


@njit(**INLINE)
def energies(R, row, cos_o, transmitted, around, narrow_s, narrow_v):
    """See `ThreadModel.energies`; they follow from E, which is read from the table.

    The last term has no lobe of its own; the isotropic lobe samples it.
    """
    through, lost = tabulated(R, row, cos_o)
    whole = through * through * row[INVERSE_T_MAX] * row[BRIGHTNESS]
    completed = lost * row[COMPLETION_SCALE] * row[BRIGHTNESS]
    kd = row[ISOTROPIC]
    surface = (R(1) - through) / max(around, R(1e-30))
    return surface, (R(1) - kd) * whole, kd * whole + completed


def thread_transmission(thread: Thread, entries: int = TRANSMISSION_ENTRIES) -> Floats:
    """(TRANSMISSION_ENTRIES,) T at uniformly spaced sqrt(cos theta) from 0 to 1."""
    gs = max(thread.gamma_surface, NARROWEST)
    return np.asarray(1.0 - surface_albedo(gs, thread.ior, thread.surface_gain, entries))


@lru_cache(maxsize=256)
def surface_albedo(
    gamma_surface: float, ior: float, surface_gain: float, entries: int = TRANSMISSION_ENTRIES
) -> Floats:
    """(TRANSMISSION_ENTRIES,) directional albedo `E(theta)` of the surface term, at most 1.

    E is `integral f_surface cos(theta_o) dwo`, at uniformly spaced sqrt(cos theta) from 0 to 1.

    entries : number of them that are integrated; a cubic spline gives the others
    """
    row = np.zeros(COLUMNS)
    ior, gamma_surface = min(ior, LARGEST_IOR), max(gamma_surface, NARROWEST)
    row[IOR_EXCESS] = (ior - 1.0) * (ior + 1.0)
    row[SURFACE_GAIN] = surface_gain
    row[GAMMA_SURFACE] = gamma_surface
    row[SURFACE_LOBE : SURFACE_LOBE + 2] = lobe_constants(gamma_surface)
    albedo = _kept(
        "thread-surface", (ior, gamma_surface, surface_gain), entries,
        lambda: _surface_albedo(row, entries),
    )  # fmt: skip
    albedo.flags.writeable = False
    return albedo


def _kept(kind: str, key: tuple[float, ...], entries: int, make: Callable[[], Floats]) -> Floats:
    """What `make` returns, from the cache on disk if all entries are integrated: a fit asks for
    thousands of threads with fewer, each once."""
    if entries < TRANSMISSION_ENTRIES:
        return make()
    return kept(kind, (fingerprint(), *key), make)


def _surface_albedo(row: Floats, entries: int) -> Floats:
    albedo = np.empty(entries)
    x, x_weight = np.polynomial.legendre.leggauss(_NODES)
    y, y_weight = np.polynomial.legendre.leggauss(_AZIMUTHS)
    _integrate_surface(row, x, x_weight, (y + 1) * math.pi / 2, y_weight * math.pi, albedo)
    return np.asarray(np.clip(_filled(albedo), 0.0, 1.0))


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


def _filled(values: Floats) -> Floats:
    """(TRANSMISSION_ENTRIES,) entries, from any number of them at the same ends."""
    if len(values) == TRANSMISSION_ENTRIES:
        return values
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(np.linspace(0.0, 1.0, len(values)), values)
    return np.asarray(spline(np.linspace(0.0, 1.0, TRANSMISSION_ENTRIES)))


def thread_completion(thread: Thread, entries: int = TRANSMISSION_ENTRIES) -> tuple[Floats, float]:
    """((TRANSMISSION_ENTRIES,) x at sqrt(cos theta) uniform from 0 to 1, X)."""
    gs, gv = max(thread.gamma_surface, NARROWEST), max(thread.gamma_volume, NARROWEST)
    return lost_energy(gs, thread.ior, thread.surface_gain, gv, thread.isotropic, entries)


LEAST_NORM = 1e-9
"""Below this X nothing is lost but rounding; the last term is left out."""


@lru_cache(maxsize=256)
def lost_energy(
    gamma_surface: float,
    ior: float,
    surface_gain: float,
    gamma_volume: float,
    isotropic: float,
    entries: int = TRANSMISSION_ENTRIES,
) -> tuple[Floats, float]:
    """(x, X): what the surface and the volume term lose of the light at A = 1, by inclination.

    x : (TRANSMISSION_ENTRIES,) max(0, 1 - E - V) at sqrt(cos theta) uniform from 0 to 1
    X : integral of x cos^2 theta over +-90 degrees, of x interpolated linearly in sqrt(cos theta);
        0, and x with it, where that is below LEAST_NORM
    entries : as in `surface_albedo`
    """
    held = _kept(
        "thread-lost", (gamma_surface, ior, surface_gain, gamma_volume, isotropic), entries,
        lambda: _lost_energy(
            1.0 - surface_albedo(gamma_surface, ior, surface_gain, entries), gamma_volume,
            isotropic, entries,
        ),
    )  # fmt: skip
    held.flags.writeable = False
    return held[:-1], float(held[-1])


def _lost_energy(through: Floats, gamma_volume: float, isotropic: float, entries: int) -> Floats:
    """x, and X behind it."""
    volume = np.zeros(entries)
    largest = float(through.max())
    if largest > 0.0:
        x, x_weight = np.polynomial.legendre.leggauss(_NODES)
        constants = np.array(lobe_constants(gamma_volume))
        reach = 2.0 * _REACH * gamma_volume
        _integrate_volume(through, constants, reach, x, x_weight, volume)
        volume = _filled(volume)
        even = 2.0 / math.pi * cosine_square_integral(through)
        volume = through / largest * ((1.0 - isotropic) * volume + isotropic * even)
    else:
        volume = np.zeros_like(through)
    lost = np.maximum(0.0, through - volume)
    norm = cosine_square_integral(lost)
    if norm < LEAST_NORM:
        lost, norm = np.zeros_like(lost), 0.0
    return np.append(lost, norm)


def cosine_square_integral(entries: Floats) -> float:
    """Integral of f cos^2 theta dtheta over +-90 degrees, f interpolated between `entries`.

    entries : (n,) f at sqrt(cos theta) uniform from 0 to 1, even in theta
    """
    knots = np.linspace(0.0, 1.0, len(entries))
    # In t = sqrt(1 - sqrt(cos theta)) the integrand is smooth up to theta = 0.
    t = np.sqrt(1.0 - knots)
    x, weight = np.polynomial.legendre.leggauss(6)
    half = 0.5 * (t[:-1] - t[1:])
    at = t[1:, None] + half[:, None] * (x + 1.0)
    root = 1.0 - at * at
    f = np.interp(root, knots, entries)
    slope = 4.0 * root / np.sqrt((1.0 + root) * (1.0 + root * root))
    return 2.0 * float((f * root**4 * slope * half[:, None] * weight).sum())


@njit(**INLINE)
def _interpolated(entries, cos_theta):
    """An entry of a table over sqrt(cos theta)."""
    position = math.sqrt(cos_theta) * (entries.size - 1)
    index = min(int(position), entries.size - 2)
    return entries[index] + (position - index) * (entries[index + 1] - entries[index])


@njit(**KERNEL)
def _integrate_volume(through, constants, reach, x, x_weight, out):
    """`out[k]` = integral T K/max(cos, cos) cos^2 over the inclinations, for sqrt(cos) = k/(n-1).

    constants, reach : of the lobe; how far from the mirror inclination it is integrated [rad]
    """
    R = np.float64
    for k in range(out.size):
        cos_theta = (k / (out.size - 1)) ** 2
        sin_theta = math.sqrt(1.0 - cos_theta * cos_theta)
        theta = math.acos(cos_theta)
        high = min(-theta + reach, 0.5 * math.pi)
        # The larger cosine has kinks at -theta and theta.
        bounds = (max(-theta - reach, -0.5 * math.pi), -theta, min(theta, high), high)
        total = 0.0
        for part in range(3):
            step = (bounds[part + 1] - bounds[part]) / _PIECES
            for node in range(_PIECES * x.size):
                piece, a = divmod(node, x.size)
                o = bounds[part] + step * (piece + 0.5 * (x[a] + 1.0))
                sin_o, cos_o = math.sin(o), max(math.cos(o), 0.0)
                lobe = longitudinal(
                    R, constants[0], constants[1], sin_theta, cos_theta, sin_o, cos_o
                )
                widest = max(cos_theta, cos_o, COS_MINIMUM)
                weight = 0.5 * step * x_weight[a] * cos_o * cos_o / widest
                total += weight * lobe * _interpolated(through, cos_o)
        out[k] = total


def plain_surface(thread: Thread, i: plain.Angles, o: plain.Angles) -> Floats:
    """(n,) surface term [1/sr], in plain NumPy."""
    cos_half = plain.half_azimuth(i, o)
    f = plain.fresnel(thread.ior, np.cos(0.5 * (i.theta - o.theta)) * cos_half)
    k = plain.longitudinal(i.theta, o.theta, 2 * thread.gamma_surface)
    widest = np.maximum(np.maximum(np.cos(i.theta), np.cos(o.theta)), 1e-6)
    return np.asarray(np.minimum(1, thread.surface_gain * f) * cos_half / 4 * k / widest)


@lru_cache(maxsize=64)
def plain_albedo(thread: Thread, count: int = 721) -> tuple[Floats, Floats]:
    """(|theta|, E) in plain NumPy: the directional albedo of the surface term, at most 1."""
    # Denser towards 90 degrees, where narrow lobes make E steep.
    theta = math.pi / 2 * np.sin(np.linspace(0, math.pi / 2, count))
    y, y_weight = np.polynomial.legendre.leggauss(24)
    narrow = 2 * thread.gamma_surface
    albedo = np.empty(count)
    for k, t in enumerate(theta):
        nodes, weight = _around_the_mirror(float(t), narrow)
        shape = (len(nodes), len(y))
        still: Any = np.zeros(shape)
        o_phi = np.broadcast_to((y + 1) * math.pi / 2, shape)
        out = np.broadcast_to(nodes[:, None], shape)
        i = plain.Angles(theta=np.full(shape, t), phi=still, psi=still)
        o = plain.Angles(theta=out, phi=o_phi, psi=still)
        value = plain_surface(thread, i, o) * np.cos(out) ** 2
        albedo[k] = (weight[:, None] * value * y_weight).sum() * math.pi
    return theta, np.minimum(albedo, 1.0)


_PLAIN_NODES = np.polynomial.legendre.leggauss(40)


def _around_the_mirror(t: float, narrow: float) -> tuple[Floats, Floats]:
    """Inclinations and weights of a quadrature over a lobe of deviation `narrow` around -t [rad].

    The nodes follow the lobe, because a narrow lobe falls between the points of a fixed grid. They
    are split where the larger of the two cosines has a kink.
    """
    lo, hi = max(-math.pi / 2, -t - 9 * narrow), min(math.pi / 2, -t + 9 * narrow)
    cuts = sorted({lo, hi, *(c for c in (-t, t) if lo < c < hi)})
    x, weight = _PLAIN_NODES
    half = np.diff(cuts)[:, None] / 2
    nodes = np.array(cuts[:-1])[:, None] + half * (x + 1)
    return nodes.ravel(), (half * weight).ravel()


def plain_terms(thread: Thread, i: plain.Angles, o: plain.Angles) -> tuple[Floats, Floats]:
    """See `ThreadModel.plain`."""
    table, albedo = plain_albedo(thread)
    kept = 1 - albedo
    t_i, t_o = np.interp(abs(i.theta), table, kept), np.interp(abs(o.theta), table, kept)
    k = plain.longitudinal(i.theta, o.theta, 2 * thread.gamma_volume)
    widest = np.maximum(np.maximum(np.cos(i.theta), np.cos(o.theta)), 1e-6)
    lobe = (1 - thread.isotropic) * k / (2 * math.pi * widest)
    volume = t_i * t_o / kept.max() * (lobe + thread.isotropic / math.pi**2)
    lost = plain_lost(thread)
    x_i, x_o = np.interp(abs(i.theta), table, lost), np.interp(abs(o.theta), table, lost)
    fine = np.linspace(0, math.pi / 2, 20001)
    norm = 2 * np.trapezoid(np.interp(fine, table, lost) * np.cos(fine) ** 2, fine)
    completed = x_i * x_o / (2 * math.pi * norm) if norm > LEAST_NORM else 0.0
    return plain_surface(thread, i, o), volume + completed


@lru_cache(maxsize=64)
def plain_lost(thread: Thread) -> Floats:
    """x at the inclinations of `plain_albedo`, in plain NumPy."""
    table, albedo = plain_albedo(thread)
    kept = 1 - albedo
    narrow = 2 * thread.gamma_volume
    wide, weight = _around_the_mirror(0.0, math.pi)
    around = weight @ (np.interp(abs(wide), table, kept) * np.cos(wide) ** 2)
    lost = np.empty(len(table))
    for n, t in enumerate(table):
        out, weight = _around_the_mirror(float(t), narrow)
        k = plain.longitudinal(np.full_like(out, t), out, narrow)
        widest = np.maximum(np.maximum(np.cos(out), math.cos(t)), 1e-6)
        through = np.interp(abs(out), table, kept) * np.cos(out) ** 2
        lobe = (weight * through * k / widest).sum()
        diffuse = 2 / math.pi * around
        volume = (1 - thread.isotropic) * lobe + thread.isotropic * diffuse
        lost[n] = max(0, kept[n] * (1 - volume / kept.max()))
    return lost


MODEL = ThreadModel(
    summary="reciprocal, passive, with light through the cloth",
    law=CONSERVING,
    factors=factors,
    lobes=lobes,
    lobe_constants=lobe_constants,
    position=position,
    read=read,
    looked_up=looked_up,
    transmission=thread_transmission,
    completion=thread_completion,
    energies=energies,
    plain=plain_terms,
    most_albedo=1.0,
)
