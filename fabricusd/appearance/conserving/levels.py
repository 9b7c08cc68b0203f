"""Evaluate the conserving law at the levels `weave` and `thread`."""

from __future__ import annotations

from numba import njit

from fabricusd.appearance.conserving.multiple import conserving_point_value, multiple_share
from fabricusd.appearance.conserving.single import facet_terms, visible
from fabricusd.appearance.frame import to_thread
from fabricusd.appearance.scattering.across import across_at
from fabricusd.appearance.scattering.columns import ALBEDO_B, ALBEDO_G, ALBEDO_R, LAW
from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.fabric import PILE_ANGLE
from fabricusd.kernels.real import PART, cos, sin


@njit(**PART)
def conserving_level_value(R, tables, across_too, place, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """`multiple.conserving_point_value`, times the factors across the width if `across_too`."""
    row = tables.threads[place.thread]
    if not across_too or row[LAW] != R(CONSERVING):
        return conserving_point_value(R, tables, place, ix, iy, iz, ox, oy, oz)
    scale = visible(R, tables, ix, iy, iz) * visible(R, tables, ox, oy, oz) * abs(iz)
    if tables.opaque != 0 and (iz > R(0)) != (oz > R(0)):
        scale = R(0)
    angle = min(max(place.psi0, R(-PILE_ANGLE)), R(PILE_ANGLE))
    c, s = cos(R, angle), sin(R, angle)
    surface, volume = facet_terms(R, row, place.thread_set, c, s, ix, iy, iz, ox, oy, oz)
    _, b_i, n_i = to_thread(R, place.thread_set, c, s, ix, iy, iz)
    _, b_o, n_o = to_thread(R, place.thread_set, c, s, ox, oy, oz)
    on_surface, on_volume = across_at(R, row, place.w, b_i, n_i, b_o, n_o)
    scale /= c
    surface, volume = surface * on_surface * scale, volume * on_volume * scale * R(place.shade)
    share = multiple_share(R, tables, ix, iy, iz, ox, oy, oz) / tables.covered
    return (
        surface + volume * row[ALBEDO_R] + share * tables.strength[0],
        surface + volume * row[ALBEDO_G] + share * tables.strength[1],
        surface + volume * row[ALBEDO_B] + share * tables.strength[2],
    )
