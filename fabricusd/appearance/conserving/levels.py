"""Evaluate the conserving law at the levels `weave` and `thread`, and say what passes a place.

The gap of the cloth as a whole depends on the direction; the places where a point of the weave lies
in a gap do not. Light from w therefore passes a place in a gap with the probability gap(w)/gap, and
a place on a thread with (gap(w) - gap)/(1 - gap), whichever is between 0 and 1. What does not pass
in a gap meets the side of some thread: it is scattered as by the whole repeat. Of the light that
the repeat scatters, the share

    G(w) = (gap - gap(w))/(1 - gap(w)), at least 0,

is then scattered in gaps, and threads scatter the rest of it; for a pair of directions the share
is min(G(wi), G(wo)), so that every place is reciprocal. In the mean over the repeat, gap(w) passes,
and the value is that of level `far`.
"""

from __future__ import annotations

from numba import njit

from fabricusd.appearance.conserving.grid import share_at
from fabricusd.appearance.conserving.multiple import (
    between_sides,
    conserving_point_value,
    conserving_value,
)
from fabricusd.appearance.conserving.single import facet_terms, visible
from fabricusd.appearance.frame import to_thread
from fabricusd.appearance.scattering.across import across_at
from fabricusd.appearance.scattering.columns import ALBEDO_B, ALBEDO_G, ALBEDO_R, LAW
from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.appearance.weave.coverage import WARP
from fabricusd.fabric import PILE_ANGLE
from fabricusd.kernels.real import INLINE, PART, cos, sin


@njit(**PART)
def gap_towards(R, tables, x, y, z):  # type: ignore[no-untyped-def]
    """gap(w): the share of the light from w that no thread of the repeat meets."""
    if tables.gap.shape[0] == 0:
        return R(1) - tables.covered
    return min(R(1), share_at(R, tables.gap, x, y, z))


@njit(**PART)
def passing(R, tables, in_gap, x, y, z):  # type: ignore[no-untyped-def]
    """Probability with which light from w passes a place that lies in a gap, or on a thread."""
    bare, open_to_it = R(1) - tables.covered, gap_towards(R, tables, x, y, z)
    if in_gap:
        return R(1) if open_to_it >= bare else open_to_it / bare
    return max(R(0), open_to_it - bare) / tables.covered


@njit(**PART)
def share_of_gaps(R, tables, x, y, z):  # type: ignore[no-untyped-def]
    """G(w): the share of the scattered light that places in gaps scatter."""
    return share_of_closed(R, tables, gap_towards(R, tables, x, y, z))


@njit(**INLINE)
def share_of_closed(R, tables, open_to_it):  # type: ignore[no-untyped-def]
    """G(w) where gap(w) is `open_to_it`."""
    closed = max(R(0), R(1) - tables.covered - open_to_it)
    return closed / (R(1) - open_to_it) if closed > R(0) else R(0)


@njit(**PART)
def conserving_level_value(R, tables, across_too, place, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """(r, g, b) at a `Place`, in a gap too, with the factors across the width if `across_too`."""
    in_gaps = R(0)
    if tables.covered < R(1):
        in_gaps = min(share_of_gaps(R, tables, ix, iy, iz), share_of_gaps(R, tables, ox, oy, oz))
    if place.thread_set > WARP:
        if in_gaps == R(0):
            return R(0), R(0), R(0)
        share = in_gaps / (R(1) - tables.covered)
        red, green, blue = conserving_value(R, tables, ix, iy, iz, ox, oy, oz)
        return share * red, share * green, share * blue
    share = R(1) - in_gaps
    row = tables.threads[place.thread]
    if across_too and row[LAW] == R(CONSERVING):
        red, green, blue = _across_value(R, tables, place, ix, iy, iz, ox, oy, oz)
    else:
        red, green, blue = conserving_point_value(R, tables, place, ix, iy, iz, ox, oy, oz)
    return share * red, share * green, share * blue


@njit(**PART)
def _across_value(R, tables, place, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """`multiple.conserving_point_value`, times the factors across the width."""
    row = tables.threads[place.thread]
    scale = visible(R, tables, ix, iy, iz) * visible(R, tables, ox, oy, oz) * abs(iz)
    if tables.opaque != 0 and (iz > R(0)) != (oz > R(0)):
        scale = R(0)
    angle = min(max(place.psi0, R(-PILE_ANGLE)), R(PILE_ANGLE))
    c, s = cos(R, angle), sin(R, angle)
    surface, volume = facet_terms(R, row, place.thread_set, c, s, ix, iy, iz, ox, oy, oz)
    _, b_i, n_i = to_thread(R, place.thread_set, c, s, ix, iy, iz)
    _, b_o, n_o = to_thread(R, place.thread_set, c, s, ox, oy, oz)
    across_surface, across_volume = across_at(R, row, place.w, b_i, n_i, b_o, n_o)
    on_surface, on_volume, lost = between_sides(R, tables, ix, iy, iz, ox, oy, oz)
    scale /= c
    surface *= across_surface * on_surface * scale
    volume *= across_volume * on_volume * scale * R(place.shade)
    lost /= tables.covered
    side = 0 if (iz > R(0)) == (oz > R(0)) else 1
    return (
        surface + volume * row[ALBEDO_R] + lost * tables.strength[side, 0],
        surface + volume * row[ALBEDO_G] + lost * tables.strength[side, 1],
        surface + volume * row[ALBEDO_B] + lost * tables.strength[side, 2],
    )
