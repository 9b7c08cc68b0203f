"""Modulate a thread's scattering across its width, at level `thread`."""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.frame import cos_inclination, unit_azimuth
from fabricusd.appearance.scattering.columns import GAMMA_SURFACE
from fabricusd.kernels.real import INLINE, erf, exp

ACROSS_MINIMUM = 0.1
"""Least `beta` of level `thread`, in half-widths of the thread: narrower highlights would alias."""


@njit(**INLINE)
def across_deviation(R, gamma_surface):
    """Standard deviation `beta` of the surface term across the thread, in half-widths."""
    return max(gamma_surface, R(ACROSS_MINIMUM))


@njit(**INLINE)
def across(R, row, w, sin_phi_i, cos_phi_i, sin_phi_o, cos_phi_o):
    """Factors of the surface and the volume term at `w` in [-1, 1] across the thread.

    The mean of each over w is 1, so the mean of level `thread` over the width is level `weave`.
    """
    # h is the sine of the bisector of the azimuths; beyond 90 degrees it is clamped to the edge.
    y, x = sin_phi_i + sin_phi_o, cos_phi_i + cos_phi_o
    edge = R(1) if y > R(0) else (R(-1) if y < R(0) else R(0))
    h = edge if x < R(0) else y / max(math.sqrt(x * x + y * y), R(1e-6))
    beta = across_deviation(R, row[GAMMA_SURFACE])
    scale = R(math.sqrt(0.5)) / beta
    ends = erf(R, (R(1) - h) * scale) + erf(R, (R(1) + h) * scale)
    z = beta * R(math.sqrt(2.0 * math.pi) / 4.0) * ends
    d = (w - h) * scale
    return exp(R, -d * d) / z, R(1) + R(0.5) * w * (sin_phi_i + sin_phi_o)


@njit(**INLINE)
def across_at(R, row, w, b_i, n_i, b_o, n_o):
    """`across` for two directions given by their components b and n in the thread frame."""
    sin_i, cos_i = unit_azimuth(R, b_i, n_i, cos_inclination(R, b_i, n_i))
    sin_o, cos_o = unit_azimuth(R, b_o, n_o, cos_inclination(R, b_o, n_o))
    return across(R, row, w, sin_i, cos_i, sin_o, cos_o)
