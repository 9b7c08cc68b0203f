"""What happens at a hit: light that arrives from a given direction, and a direction drawn to go on.

Surface light leaves at the mirror of where it came in, across the thread as its azimuth asks;
volume light leaves anywhere on the side that faces the light. In the mean over the width both are
equal.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.appearance.frame import from_thread, to_thread
from fabricusd.appearance.scattering.columns import (
    ALBEDO_B,
    ALBEDO_G,
    ALBEDO_R,
    GAMMA_SURFACE,
    ISOTROPIC,
    LAW,
    SURFACE_WIDTH,
    VOLUME_WIDTH,
)
from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.appearance.scattering.models.conserving import tabulated
from fabricusd.appearance.scattering.terms import terms
from fabricusd.geometry.mesh import SIDES
from fabricusd.geometry.section import leave, offset_across, squeezed, tube_point
from fabricusd.kernels.real import INLINE, KERNEL

NARROWEST_ACROSS = 0.1
"""Least deviation of a highlight across a thread, as level `thread` has it."""

RANDOMS = 8
"""Numbers in [0, 1) that `go_on` takes for each path."""


@njit(**INLINE)
def _unit_azimuth(b, n):
    """(sin phi, cos phi) of a direction's components across the thread."""
    length = math.sqrt(b * b + n * n)
    if length < 1e-30:
        return 0.0, 1.0
    return b / length, n / length


@njit(**INLINE)
def _highlight(y, h, beta):
    """The highlight at `y` across a thread when its middle is at `h`: averages to 1 over y."""
    root = beta * math.sqrt(2.0)
    z = 0.25 * beta * math.sqrt(2.0 * math.pi)
    z *= math.erf((1.0 - h) / root) + math.erf((1.0 + h) / root)
    return math.exp(-0.5 * ((y - h) / beta) ** 2) / z


@njit(**INLINE)
def _mirror(sin_i, cos_i, sin_o, cos_o):
    """h = sin(phi_d/2), phi_d = phi_i - phi_o wrapped to (-pi, pi]."""
    return math.sin(0.5 * math.atan2(sin_i * cos_o - cos_i * sin_o, cos_i * cos_o + sin_i * sin_o))


@njit(**KERNEL)
def arrive(
    rings, lines, threads, reciprocal, correlated, primitive, u, v, direction, light, random,
    origin, value,
):  # fmt: skip
    """The light from one direction that each path picks up at its hit if nothing is in the way.

    direction, light : (n, 3) - of the path, and to its light; random : (n,)
    reciprocal : whether a thread's light goes by the width it shows there, and by its bend
    correlated : whether surface light leaves at the mirror of where it came in
    origin : (2 n, 3) [m] - where shadow rays begin, of the surface's light and then of the volume's
    value : (2, n) - what they carry, per unit `L_i dwi`; the volume's without `A`
    """
    n = primitive.size
    for k in range(n):
        line, x, y, z, psi, bend, alpha, wider = tube_point(rings, primitive[k], u[k], v[k])
        which, row = lines.which[line], threads[lines.kind[line]]
        wide, tall = wider * lines.half_width[line], lines.half_height[line]
        c, s = math.cos(psi), math.sin(psi)
        ix, iy, iz = to_thread(float, which, c, s, light[k, 0], light[k, 1], light[k, 2])
        ox, oy, oz = to_thread(
            float, which, c, s, -direction[k, 0], -direction[k, 1], -direction[k, 2]
        )
        surface, volume = terms(np.float64, row, ix, iy, iz, ox, oy, oz)
        sin_i, cos_i = _unit_azimuth(iy, iz)
        sin_o, cos_o = _unit_azimuth(oy, oz)
        i_sin, i_cos, half = squeezed(wide, tall, sin_i, cos_i)
        o_sin, o_cos, _ = squeezed(wide, tall, sin_o, cos_o)
        came = offset_across(alpha, o_sin, o_cos)
        even = 2.0 * random[k] - 1.0
        went = even
        if correlated:
            beta = max(row[GAMMA_SURFACE], NARROWEST_ACROSS)
            surface *= _highlight(came, _mirror(sin_i, cos_i, sin_o, cos_o), beta)
            went = -came
        inclined = math.sqrt(iy * iy + iz * iz)
        weight = inclined * (2.0 * half / lines.mean_width[line] if reciprocal else 1.0)
        for part in range(2):
            at = part * n + k
            px, py, pz, up = leave(
                which, c, s, x, y, z, wide, tall, i_sin, i_cos, went if part == 0 else even
            )
            origin[at, 0], origin[at, 1], origin[at, 2] = px, py, pz
            longer = 1.0 + up * bend if reciprocal else 1.0
            value[part, k] = weight * longer * (surface if part == 0 else volume)


@njit(**INLINE)
def shade_at(rings, primitive):
    """Factor of the albedo at a hit."""
    return rings.shade[rings.first[primitive // 2 // SIDES]]


@njit(**KERNEL)
def pick_up(lines, rings, threads, primitive, value, shadowed, throughput, group, out):
    """Add what arrives to the groups of paths: out (g, 3)."""
    n = primitive.size
    for k in range(n):
        ring = rings.first[primitive[k] // 2 // SIDES]
        row = threads[lines.kind[rings.line[ring]]]
        surface = 0.0 if shadowed[k] else value[0, k]
        volume = 0.0 if shadowed[n + k] else rings.shade[ring] * value[1, k]
        g = group[k]
        out[g, 0] += throughput[k, 0] * (surface + row[ALBEDO_R] * volume)
        out[g, 1] += throughput[k, 1] * (surface + row[ALBEDO_G] * volume)
        out[g, 2] += throughput[k, 2] * (surface + row[ALBEDO_B] * volume)


@njit(**INLINE)
def _inclination(theta_o, deviation, even, u0, u1, u2):
    """(theta, density over theta [1/rad]): a normal about the mirror inclination, cut at 90
    degrees; what is cut, and a share `even`, by the cosine."""
    theta = -theta_o + deviation * math.sqrt(-2.0 * math.log(1.0 - u1)) * math.cos(
        2.0 * math.pi * u2
    )
    quarter = 0.5 * math.pi
    root = deviation * math.sqrt(2.0)
    inside = 0.5 * (math.erf((quarter + theta_o) / root) + math.erf((quarter - theta_o) / root))
    if u0 < even or abs(theta) > quarter:
        # u0 is even over what led here: over [0, even), or over [even, 1) where the draw was cut.
        rest = u0 / even if u0 < even else (u0 - even) / (1.0 - even)
        theta = math.asin(2.0 * rest - 1.0)
    normal = math.exp(-0.5 * ((theta + theta_o) / deviation) ** 2) / (
        deviation * math.sqrt(2.0 * math.pi)
    )
    by_cosine = 0.5 * math.cos(theta)
    return theta, (1.0 - even) * (normal + (1.0 - inside) * by_cosine) + even * by_cosine


@njit(**KERNEL)
def go_on(
    rings, lines, threads, reciprocal, correlated, primitive, u, v, direction, random,
    throughput, origin, onward,
):  # fmt: skip
    """Draw where each path goes next: `origin` and `onward` (n, 3) are written, `throughput` times
    the weight.

    random : (n, RANDOMS); the others as for `arrive`
    """
    for k in range(primitive.size):
        line, x, y, z, psi, bend, alpha, wider = tube_point(rings, primitive[k], u[k], v[k])
        which, row = lines.which[line], threads[lines.kind[line]]
        wide, tall = wider * lines.half_width[line], lines.half_height[line]
        c, s = math.cos(psi), math.sin(psi)
        ox, oy, oz = to_thread(
            float, which, c, s, -direction[k, 0], -direction[k, 1], -direction[k, 2]
        )
        theta_o = math.asin(max(-1.0, min(1.0, ox)))
        sin_o, cos_o = _unit_azimuth(oy, oz)
        o_sin, o_cos, _ = squeezed(wide, tall, sin_o, cos_o)
        came = offset_across(alpha, o_sin, o_cos)
        by_surface = _surface_share(row, math.sqrt(oy * oy + oz * oz))
        on_surface = random[k, 0] < by_surface
        even = 2.0 * random[k, 1] - 1.0
        beta = max(row[GAMMA_SURFACE], NARROWEST_ACROSS)
        if on_surface:
            theta, density = _inclination(
                theta_o, row[SURFACE_WIDTH], 0.05, random[k, 2], random[k, 3], random[k, 4]
            )
            h, h_density = _across(came, beta, random[k, 5], random[k, 6], even, correlated)
            turn = 2.0 * math.asin(h)
            # Solid angle is cos(theta) dtheta dphi, and dphi = 2 dh/cos(phi_d/2).
            density *= by_surface * h_density * 0.5 * math.sqrt(max(1.0 - h * h, 1e-12))
            went = -came if correlated else 2.0 * random[k, 7] - 1.0
        else:
            theta, density = _inclination(
                theta_o, row[VOLUME_WIDTH], max(row[ISOTROPIC], 0.15),
                random[k, 2], random[k, 3], random[k, 4],
            )  # fmt: skip
            turn = 2.0 * math.pi * random[k, 5]
            density *= (1.0 - by_surface) / (2.0 * math.pi)
            h, went = 0.0, even
        cos_i = math.cos(theta)
        sin_t, cos_t = math.sin(turn), math.cos(turn)
        sin_i, cos_a = sin_o * cos_t + cos_o * sin_t, cos_o * cos_t - sin_o * sin_t
        ix, iy, iz = math.sin(theta), cos_i * sin_i, cos_i * cos_a
        surface, volume = terms(np.float64, row, ix, iy, iz, ox, oy, oz)
        i_sin, i_cos, half = squeezed(wide, tall, sin_i, cos_a)
        px, py, pz, up = leave(which, c, s, x, y, z, wide, tall, i_sin, i_cos, went)
        weight = cos_i * cos_i / density
        if reciprocal:
            weight *= 2.0 * half / lines.mean_width[line] * (1.0 + up * bend)
        if on_surface:
            if correlated:
                surface *= _highlight(came, h, beta)
            weight *= surface
            for channel in range(3):
                throughput[k, channel] *= weight
        else:
            weight *= volume * shade_at(rings, primitive[k])
            throughput[k, 0] *= weight * row[ALBEDO_R]
            throughput[k, 1] *= weight * row[ALBEDO_G]
            throughput[k, 2] *= weight * row[ALBEDO_B]
        origin[k, 0], origin[k, 1], origin[k, 2] = px, py, pz
        dx, dy, dz = from_thread(float, which, c, s, ix, iy, iz)
        onward[k, 0], onward[k, 1], onward[k, 2] = dx, dy, dz


@njit(**INLINE)
def _surface_share(row, cos_o):
    """With what probability a path takes the surface's light."""
    if row[LAW] != CONSERVING:
        return 0.5
    through, _ = tabulated(np.float64, row, cos_o)
    reflected = 1.0 - through
    albedo = max(row[ALBEDO_R], row[ALBEDO_G], row[ALBEDO_B])
    whole = reflected + albedo * (1.0 - reflected)
    return min(0.95, max(0.05, reflected / max(whole, 1e-9)))


@njit(**INLINE)
def _across(came, beta, u0, u1, even, correlated):
    """(h, density over h): about where the path came in, cut at the rims; what is cut, evenly."""
    if not correlated:
        return even, 0.5
    h = came + beta * math.sqrt(-2.0 * math.log(1.0 - u0)) * math.cos(2.0 * math.pi * u1)
    root = beta * math.sqrt(2.0)
    inside = 0.5 * (math.erf((1.0 - came) / root) + math.erf((1.0 + came) / root))
    if abs(h) > 1.0:
        h = even
    normal = math.exp(-0.5 * ((h - came) / beta) ** 2) / (beta * math.sqrt(2.0 * math.pi))
    return h, normal + 0.5 * (1.0 - inside)
