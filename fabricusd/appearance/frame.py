"""Definitions of the directions, frames and angles that the whole package uses.

In the surface frame x = U (along the weft), y = V (along the warp), z = N, which points to the
viewer's side. `wo` points to the viewer and is given; `wi` points to the light and is sampled.

The thread frame is right-handed: x = t along the thread, y = b across it, z = n_t, its normal. A
thread along the axis `a` (V for warp, U for weft) with the tangent angle `psi0` has

    t = cos psi0 a - sin psi0 N,    n_t = sin psi0 a + cos psi0 N,    b = n_t x t

so a positive angle leans the normal forward along the axis.

Angles of a direction w in the thread frame:

- inclination `theta = asin(w.t)`, measured from the thread's normal plane and *not* from a pole,
  with the same sign convention for both directions: the mirror cone is `theta_o = -theta_i`;
- azimuth `phi = atan2(w.b, w.n_t)` and longitude `psi = atan2(w.t, w.n_t)`; both are 0 along n_t
  and where they are undefined;
- `theta_h = (theta_i + theta_o)/2` and `theta_d = (theta_i - theta_o)/2`. In this project `theta_h`
  is 0 in the mirror direction and measures the distance of a pair from the mirror cone. Microfacet
  models use the same name for a different angle, the polar angle of the half vector.

The kernels take and return numbers, with the precision `R` first. Source: MODEL section 1,
[Bisker2011].
"""

from __future__ import annotations

import math

from numba import njit

from fabricusd.kernels.real import INLINE, atan2

WEFT, WARP = 0, 1
"""Indices of the thread sets; also the values of a grid cell in which that set is on top."""


@njit(**INLINE)
def to_thread(R, thread_set, cos_psi0, sin_psi0, x, y, z):
    """Surface frame to thread frame: (w.t, w.b, w.n_t)."""
    warp = thread_set == WARP
    along = y if warp else x
    across = -x if warp else y
    return cos_psi0 * along - sin_psi0 * z, across, sin_psi0 * along + cos_psi0 * z


@njit(**INLINE)
def from_thread(R, thread_set, cos_psi0, sin_psi0, t, b, n):
    """Thread frame to surface frame, the inverse of `to_thread`."""
    along = cos_psi0 * t + sin_psi0 * n
    z = cos_psi0 * n - sin_psi0 * t
    if thread_set == WARP:
        return -b, along, z
    return along, b, z


@njit(**INLINE)
def cos_inclination(R, y, z):
    """cos(theta) from the components across the thread, which keep it precise near 90 degrees."""
    return math.sqrt(y * y + z * z)


@njit(**INLINE)
def unit_azimuth(R, y, z, cos_theta):
    """(sin phi, cos phi) of a direction; (0, 1) for directions along the thread."""
    along = cos_theta <= R(1e-30)
    scale = R(1) / max(cos_theta, R(1e-30))
    return R(0) if along else y * scale, R(1) if along else z * scale


@njit(**INLINE)
def half_inclination_legs(R, sin_i, cos_i, sin_o, cos_o):
    """(y, x) with theta_h = atan2(y, x) and x >= 0; the length of (y, x) is above 1.

    The sum of the unit vectors at the angles theta_i and theta_o points along theta_h. For nearly
    opposite directions along the thread the sum vanishes. There the difference of the two vectors,
    which is perpendicular to the sum, gives the same angle without cancellation.
    """
    d = sin_i - sin_o
    s = sin_i + sin_o
    c = cos_i + cos_o
    opposite = abs(d) > c
    turned = cos_o - cos_i if d > R(0) else cos_i - cos_o
    return turned if opposite else s, abs(d) if opposite else c


@njit(**INLINE)
def half_inclination(R, sin_i, cos_i, sin_o, cos_o):
    """theta_h [rad] in [-pi/2, pi/2] of two inclinations; 0 for opposite directions."""
    y, x = half_inclination_legs(R, sin_i, cos_i, sin_o, cos_o)
    return atan2(R, y, x)


@njit(**INLINE)
def cos2_half_inclination(R, sin_i, cos_i, sin_o, cos_o):
    """cos^2(theta_h)."""
    y, x = half_inclination_legs(R, sin_i, cos_i, sin_o, cos_o)
    return x * x / (x * x + y * y)


@njit(**INLINE)
def cos2_difference_inclination(R, sin_i, cos_i, sin_o, cos_o):
    """cos^2(theta_d): a quarter of the squared length of the two unit vectors' sum."""
    s = sin_i + sin_o
    c = cos_i + cos_o
    return R(0.25) * (s * s + c * c)


@njit(**INLINE)
def cos_half_difference(R, sin_i, cos_i, sin_o, cos_o):
    """cos(d/2) >= 0 for the difference d of two angles wrapped to (-pi, pi]."""
    s = sin_i + sin_o
    c = cos_i + cos_o
    return R(0.5) * math.sqrt(s * s + c * c)


@njit(**INLINE)
def half_difference(R, sin_i, cos_i, sin_o, cos_o):
    """|d|/2 in [0, pi/2] for the difference d of two angles wrapped to (-pi, pi]."""
    s, c = sin_i + sin_o, cos_i + cos_o
    ds, dc = sin_i - sin_o, cos_i - cos_o
    return atan2(R, math.sqrt(ds * ds + dc * dc), math.sqrt(s * s + c * c))


@njit(**INLINE)
def diamond(R, x, y):
    """Diamond angle of (x, y), from 0 to 4: 1 per quadrant, linear in y/(|x| + |y|) inside it."""
    part = x / max(abs(x) + abs(y), R(1e-30))
    return R(1) - part if y >= R(0) else R(3) + part
