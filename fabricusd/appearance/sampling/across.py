"""Sample directions that follow the highlight across the width of a thread."""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.frame import from_thread, to_thread
from fabricusd.appearance.sampling.lobes import azimuth_seen, density_across, sample_across
from fabricusd.appearance.scattering.across import across_deviation
from fabricusd.kernels.real import INLINE, atan2


@njit(**INLINE)
def narrower(R, gamma, c, s, thread_set, w, ix, iy, iz, ox, oy, oz):
    """Ratio of the surface lobe's density at w across the thread to its density at level
    `weave`."""
    t, b, n = to_thread(R, thread_set, c, s, ix, iy, iz)
    _, b_o, n_o = to_thread(R, thread_set, c, s, ox, oy, oz)
    phi_o, beta = azimuth_seen(R, b_o, n_o), across_deviation(R, gamma)
    return density_across(R, s / c, phi_o, w, beta, t, b, max(n, R(1e-12)))


@njit(**INLINE)
def narrow_direction(R, gamma, width, c, s, psi0, thread_set, w, ox, oy, oz, u1, u2):
    """A direction of the surface lobe, `width` [rad] wide, at the position w across the thread."""
    t_o, b_o, n_o = to_thread(R, thread_set, c, s, ox, oy, oz)
    theta_o = atan2(R, t_o, math.sqrt(b_o * b_o + n_o * n_o))
    phi_o, beta = azimuth_seen(R, b_o, n_o), across_deviation(R, gamma)
    t, b, n = sample_across(R, psi0, s / c, width, theta_o, phi_o, w, beta, u1, u2)
    return from_thread(R, thread_set, c, s, t, b, n)
