"""Sample directions that follow the highlight across the width of a thread."""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.frame import from_thread, to_thread
from fabricusd.appearance.sampling.lobes import azimuth_seen, density_across, sample_across
from fabricusd.appearance.scattering.across import across_deviation
from fabricusd.kernels.real import INLINE, atan2


@njit(**INLINE)
def narrower(R, gamma, stretch, w, ix, iy, iz, ox, oy, oz):
    """Ratio of the surface lobe's density at w across the thread to its density at level
    `weave`."""
    t, b, n = to_thread(R, stretch.thread_set, stretch.cos, stretch.sin, ix, iy, iz)
    _, b_o, n_o = to_thread(R, stretch.thread_set, stretch.cos, stretch.sin, ox, oy, oz)
    phi_o, beta = azimuth_seen(R, b_o, n_o), across_deviation(R, gamma)
    return density_across(R, stretch.tan, phi_o, w, beta, t, b, max(n, R(1e-12)))


@njit(**INLINE)
def narrow_direction(R, gamma, stretch, w, ox, oy, oz, u1, u2):
    """A direction of a stretch's surface lobe at the position w across the thread."""
    c, s = stretch.cos, stretch.sin
    t_o, b_o, n_o = to_thread(R, stretch.thread_set, c, s, ox, oy, oz)
    theta_o = atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    phi_o, beta = azimuth_seen(R, b_o, n_o), across_deviation(R, gamma)
    t, b, n = sample_across(
        R, stretch.psi0, stretch.tan, stretch.surface_width, theta_o, phi_o, w, beta, u1, u2
    )
    return from_thread(R, stretch.thread_set, c, s, t, b, n)
