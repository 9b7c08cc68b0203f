"""Where a ray meets a tube, in the thread's frame, and where scattered light leaves it: kernels.

Across the thread the section is an ellipse, half axes B along b and H along n_t. Seen from the
azimuth phi it is 2 sqrt(H^2 sin^2 phi + B^2 cos^2 phi) wide, and a point of it lies at an offset
y in [-1, 1] across that width. In the circle that the ellipse is when squeezed, the azimuth has the
sine and cosine (H sin phi, B cos phi), normalised.
"""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.frame import from_thread
from fabricusd.geometry.mesh import SIDES
from fabricusd.kernels.real import INLINE

EXIT = 1.002
"""How far from its axis light leaves a section, over the ellipse: outside of the tube's corners."""


@njit(**INLINE)
def tube_point(rings, primitive, u, v):
    """(line, x, y, z, psi, bend, alpha, wider) at a hit: axis point [m], tangent angle [rad], its
    change [rad/m], the angle round the section [rad] from b towards n_t, and the section's width
    over that of its line."""
    quad = primitive // 2
    side, ring = quad % SIDES, rings.first[quad // SIDES]
    if primitive % 2 == 0:
        along, around = u + v, u
    else:
        along, around = v, u + v
    back = 1.0 - along
    centre, angle, bend = rings.centre, rings.angle, rings.bend
    return (
        rings.line[ring],
        back * centre[ring, 0] + along * centre[ring + 1, 0],
        back * centre[ring, 1] + along * centre[ring + 1, 1],
        back * centre[ring, 2] + along * centre[ring + 1, 2],
        back * angle[ring] + along * angle[ring + 1],
        back * bend[ring] + along * bend[ring + 1],
        2.0 * math.pi * (side + around) / SIDES,
        back * rings.wider[ring] + along * rings.wider[ring + 1],
    )


@njit(**INLINE)
def squeezed(half_width, half_height, sin_phi, cos_phi):
    """(sin, cos, half the width): the azimuth in the circle, and what the section shows [m]."""
    s, c = half_height * sin_phi, half_width * cos_phi
    half = math.sqrt(s * s + c * c)
    return s / half, c / half, half


@njit(**INLINE)
def offset_across(alpha, sin_c, cos_c):
    """y in [-1, 1] of the section's point at `alpha`, seen from the azimuth (sin_c, cos_c)."""
    return math.cos(alpha) * cos_c - math.sin(alpha) * sin_c


@njit(**INLINE)
def leave(which, cos_psi, sin_psi, x, y, z, half_width, half_height, sin_c, cos_c, offset):
    """(x, y, z, height) [m]: the point on the side that faces the azimuth (sin_c, cos_c) at
    `offset` across, and how far along n_t from the axis it lies."""
    deep = math.sqrt(max(0.0, 1.0 - offset * offset))
    across = half_width * (offset * cos_c + deep * sin_c)
    up = half_height * (-offset * sin_c + deep * cos_c)
    dx, dy, dz = from_thread(float, which, cos_psi, sin_psi, 0.0, EXIT * across, EXIT * up)
    return x + dx, y + dy, z + dz, up
