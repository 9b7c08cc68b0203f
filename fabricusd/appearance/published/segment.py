"""Evaluate a segment of thread in the cloth, masked and shadowed, before the division by `Q`.

These scalar kernels, with the precision `R` first, serve both the vectorised loops and the path
tracer. Both directions are above the cloth. Source: `docs/model.md` section 4, [Sadeghi2013].
"""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.frame import (
    WARP,
    cos_half_difference,
    cos_inclination,
    unit_azimuth,
)
from fabricusd.appearance.scattering.terms import (
    cell_lobes,
    published_factors,
    published_lobes,
)
from fabricusd.kernels.real import INLINE, acos, exp


@njit(**INLINE)
def masked(R, x, y, u):
    """`(1-u) x y + u min(x, y)` of two clamped cosines: `M` or `P`."""
    return x * y + u * (min(x, y) - x * y)


@njit(**INLINE)
def overlap(R, cos_half, precision):
    """`u` = exp(-d^2/(2 width^2)), in [0, 1], for azimuths that differ by d; from cos(d/2).

    precision : 2/width^2 [1/rad^2]
    """
    half = acos(R, cos_half)
    return exp(R, -precision * half * half)


@njit(**INLINE)
def along_set(R, thread_set, precision, ix, iy, iz, ox, oy, oz):
    """The quantities that all threads of a set share: (a_i, b_i, scale_i, a_o, b_o, scale_o, u).

    a, b : components along the axis of the set and across it
    scale : 1/|w without b|, so that cos psi = n_t.w scale at any tangent angle
    u : `overlap` of the longitudes psi, which a tangent angle shifts by the same amount
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
    """`P` at the tangent angle with cosine c and sine s."""
    x = max(s * a_i + c * iz, R(0)) * scale_i
    y = max(s * a_o + c * oz, R(0)) * scale_o
    return masked(R, x, y, u)


@njit(**INLINE)
def segment(R, model, row, precision, c, s, a_i, b_i, iz, a_o, b_o, oz):
    """`f_s M cos theta_i` as (surface, volume without `A`); 0 where `M` is 0.

    model : the number of the row's model, which must be a published one

    Multiplied by `seen_along`, this is the integrand of level `far`.
    """
    t_i, cos_i, _, t_o, cos_o, _, surface, volume = _masked_factors(
        R, model, row, precision, c, s, a_i, b_i, iz, a_o, b_o, oz
    )
    on_surface, on_volume = published_lobes(R, model, row, t_i, cos_i, t_o, cos_o)
    return surface * on_surface, volume * on_volume


@njit(**INLINE)
def mean_segment(R, model, row, half, precision, c, s, a_i, b_i, iz, a_o, b_o, oz):
    """`segment` with its lobes averaged over tangent angles `half` [rad] to each side."""
    t_i, cos_i, cos_phi_i, t_o, cos_o, cos_phi_o, surface, volume = _masked_factors(
        R, model, row, precision, c, s, a_i, b_i, iz, a_o, b_o, oz
    )
    on_surface, on_volume = cell_lobes(
        R, model, row, half, t_i, cos_i, cos_phi_i, t_o, cos_o, cos_phi_o
    )
    return surface * on_surface, volume * on_volume


@njit(**INLINE)
def _masked_factors(R, model, row, precision, c, s, a_i, b_i, iz, a_o, b_o, oz):
    """(t_i, cos_i, cos_phi_i, t_o, cos_o, cos_phi_o, surface, volume).

    The first six are the sine and cosine of the inclination and the cosine of the azimuth of wi and
    of wo; the last two are the factors of the model times `M cos theta_i`.
    """
    t_i, n_i = c * a_i - s * iz, s * a_i + c * iz
    t_o, n_o = c * a_o - s * oz, s * a_o + c * oz
    cos_i, cos_o = cos_inclination(R, b_i, n_i), cos_inclination(R, b_o, n_o)
    sin_phi_i, cos_phi_i = unit_azimuth(R, b_i, n_i, cos_i)
    sin_phi_o, cos_phi_o = unit_azimuth(R, b_o, n_o, cos_o)
    cos_half = cos_half_difference(R, sin_phi_i, cos_phi_i, sin_phi_o, cos_phi_o)
    u = overlap(R, cos_half, precision)
    m = masked(R, max(cos_phi_i, R(0)), max(cos_phi_o, R(0)), u) * cos_i
    surface, volume = published_factors(R, model, row, t_i, cos_i, t_o, cos_o, cos_half)
    return t_i, cos_i, cos_phi_i, t_o, cos_o, cos_phi_o, surface * m, volume * m
