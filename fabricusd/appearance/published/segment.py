"""Evaluate a segment of thread in the cloth by a surface law, before the division by its total.

These scalar kernels, with the precision `R` first, serve both the vectorised loops and the path
tracer. Both directions are above the cloth. Source: `docs/model.md` section 4, [Sadeghi2013].
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import njit

from fabricusd.appearance import laws
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
from fabricusd.kernels.real import INLINE


class SetPair(NamedTuple):
    """A pair of directions in the frame of a thread set: what all threads of the set share.

    along, across : real - components along the axis of the set and across it
    up : real - N.w
    scale : real - 1/|w without across|, so that cos psi = n_t.w scale at any tangent angle
    shared : real - the law's `shared`
    seen_0, seen_1, seen_2, seen_4 : real - the law's `visible_shares`
    """

    along_i: Any
    across_i: Any
    up_i: Any
    scale_i: Any
    along_o: Any
    across_o: Any
    up_o: Any
    scale_o: Any
    shared: Any
    seen_0: Any
    seen_1: Any
    seen_2: Any
    seen_4: Any


@njit(**INLINE)
def along_set(R, tables, thread_set, ix, iy, iz, ox, oy, oz):
    """The `SetPair` of two directions in the surface frame."""
    warp = thread_set == WARP
    a_i, b_i = (iy, -ix) if warp else (ix, iy)
    a_o, b_o = (oy, -ox) if warp else (ox, oy)
    scale_i = R(1) / math.sqrt(a_i * a_i + iz * iz)
    scale_o = R(1) / math.sqrt(a_o * a_o + oz * oz)
    cos_half = cos_half_difference(R, a_i * scale_i, iz * scale_i, a_o * scale_o, oz * scale_o)
    u = laws.shared(R, tables, thread_set, b_o, cos_half)
    entry, c, r = laws.view_place(R, tables, ox, oy, oz)
    v0, v1, v2, v4 = laws.visible_shares(R, tables, thread_set, entry, c, r)
    return SetPair(a_i, b_i, iz, scale_i, a_o, b_o, oz, scale_o, u, v0, v1, v2, v4)


@njit(**INLINE)
def segment(R, tables, model, row, c, s, pair):
    """`f_s mask cos theta_i` as (surface, volume without `A`).

    model : the number of the row's model, which must be a published one

    Multiplied by the law's weight, this is the integrand of level `far`.
    """
    t_i, cos_i, _, t_o, cos_o, _, surface, volume = _factors(R, tables, model, row, c, s, pair)
    on_surface, on_volume = published_lobes(R, model, row, t_i, cos_i, t_o, cos_o)
    return surface * on_surface, volume * on_volume


@njit(**INLINE)
def mean_segment(R, tables, model, row, half, c, s, pair):
    """`segment` with its lobes averaged over tangent angles `half` [rad] to each side."""
    t_i, cos_i, cos_phi_i, t_o, cos_o, cos_phi_o, surface, volume = _factors(
        R, tables, model, row, c, s, pair
    )
    on_surface, on_volume = cell_lobes(
        R, model, row, half, t_i, cos_i, cos_phi_i, t_o, cos_o, cos_phi_o
    )
    return surface * on_surface, volume * on_volume


@njit(**INLINE)
def _factors(R, tables, model, row, c, s, pair):
    """(t_i, cos_i, cos_phi_i, t_o, cos_o, cos_phi_o, surface, volume).

    The first six are the sine and cosine of the inclination and the cosine of the azimuth of wi and
    of wo; the last two are the factors of the model times `mask cos theta_i`.
    """
    a_i, b_i, iz = pair.along_i, pair.across_i, pair.up_i
    a_o, b_o, oz = pair.along_o, pair.across_o, pair.up_o
    t_i, n_i = c * a_i - s * iz, s * a_i + c * iz
    t_o, n_o = c * a_o - s * oz, s * a_o + c * oz
    cos_i, cos_o = cos_inclination(R, b_i, n_i), cos_inclination(R, b_o, n_o)
    sin_phi_i, cos_phi_i = unit_azimuth(R, b_i, n_i, cos_i)
    sin_phi_o, cos_phi_o = unit_azimuth(R, b_o, n_o, cos_o)
    cos_half = cos_half_difference(R, sin_phi_i, cos_phi_i, sin_phi_o, cos_phi_o)
    m = laws.mask(R, tables, cos_phi_i, cos_phi_o, cos_half) * cos_i
    surface, volume = published_factors(R, model, row, t_i, cos_i, t_o, cos_o, cos_half)
    return t_i, cos_i, cos_phi_i, t_o, cos_o, cos_phi_o, surface * m, volume * m
