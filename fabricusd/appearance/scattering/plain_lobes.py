"""Angles and lobes in plain float64 NumPy, for the reference formulas that test the kernels.

Every function broadcasts over directions. Source: MODEL sections 1 and 2 (`docs/model.md`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Thread

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Angles:
    """Directions in a thread's frame (t, b, n_t): inclination, azimuth and longitude [rad].

    theta : (n,) - asin(w.t); phi : (n,) - atan2(w.b, w.n_t); psi : (n,) - atan2(w.t, w.n_t)
    """

    theta: Array
    phi: Array
    psi: Array


def azimuth(y: Array, x: Array) -> Array:
    """atan2(y, x) [rad] with atan2(0, 0) = 0 whatever the signs of the zeros."""
    return np.where((y == 0) & (x == 0), 0.0, np.arctan2(y, x))


def wrap(angle: Array) -> Array:
    """`angle` [rad] moved into (-pi, pi]."""
    return math.pi - np.mod(math.pi - angle, 2 * math.pi)


def angles(w: Array) -> Angles:
    """The angles of `w` : (n, 3) in the thread frame, x along `t`, y along `b`, z along `n_t`."""
    t, b, n = np.moveaxis(np.asarray(w, np.float64), -1, 0)
    return Angles(theta=np.arctan2(t, np.hypot(b, n)), phi=azimuth(b, n), psi=azimuth(t, n))


def half_azimuth(i: Angles, o: Angles) -> Array:
    """cos(phi_d/2)."""
    return np.cos(0.5 * wrap(i.phi - o.phi))


def gaussian(s: float, x: Array) -> Array:
    """Unit-area Gaussian of standard deviation `s` [rad] at `x` [rad]."""
    return np.exp(-0.5 * (x / s) ** 2) / (s * math.sqrt(2 * math.pi))


def fresnel(ior: float, cosine: Array) -> Array:
    """Unpolarised reflectance of a dielectric at incidence cosine `cosine` in [0, 1]."""
    cosine = np.broadcast_to(cosine, np.shape(cosine))
    if ior == 1.0:
        return np.zeros_like(cosine)
    inside = np.sqrt(np.maximum(1 - (1 - cosine**2) / ior**2, 0))
    parallel = (ior * cosine - inside) / (ior * cosine + inside)
    perpendicular = (cosine - ior * inside) / (cosine + ior * inside)
    return 0.5 * (parallel**2 + perpendicular**2)


def longitudinal(a: Array, b: Array, s: float) -> Array:
    """`K(a, b; s)`, [dEon2011] eq. 7 without cancellation; K cos b integrates to 1 over b."""
    # Importing SciPy takes as long as importing NumPy, and kernels do without it.
    from scipy.special import i0e

    v = s * s
    peak = np.exp(-2 * np.sin(0.5 * (a + b)) ** 2 / v)
    return peak * i0e(np.cos(a) * np.cos(b) / v) / (v * -math.expm1(-2 / v))


def gaussian_terms(
    thread: Thread, i: Angles, o: Angles, reflected: Array, transmitted: Array
) -> tuple[Array, Array]:
    """Surface and volume term of a published model with given Fresnel factors. MODEL section 2."""
    theta_h, theta_d = 0.5 * (i.theta + o.theta), 0.5 * (i.theta - o.theta)
    kd = thread.isotropic
    surface = reflected * half_azimuth(i, o) * gaussian(thread.gamma_surface, theta_h)
    lobe = (1 - kd) * gaussian(thread.gamma_volume, theta_h) + kd
    volume = transmitted * lobe / np.maximum(np.cos(i.theta) + np.cos(o.theta), 1e-3)
    compressed = np.maximum(np.cos(theta_d) ** 2, 1e-6)
    return surface / compressed, volume / compressed
