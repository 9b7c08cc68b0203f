"""The lobes and the Fresnel term from which the thread models are built, as scalar kernels.

The kernels take the precision `R` first, and widths and indices of refraction in the form that
evaluation needs (1/s^2, eta^2 - 1), so that a table can store them: see `gaussian_constants` and
`longitudinal_constants`.
"""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.frame import half_inclination_legs
from fabricusd.kernels.real import INLINE, exp, i0e

NARROWEST = 1e-6
"""Least standard deviation of a lobe [rad]; narrower lobes are widened to it. Its peak and 1/s^2
are finite in float32, and float32 directions do not resolve it."""
COS_MINIMUM = 1e-6
"""Lower bound on a cosine that is divided by."""
LARGEST_IOR = 1e8
"""Index of refraction above which reflection is total to the rounding of float32."""


def gaussian_constants(s: float) -> tuple[float, float]:
    """(1/(2 s^2), 1/(s sqrt(2 pi))) for the standard deviation s [rad]."""
    s = max(s, NARROWEST)
    return 0.5 / (s * s), 1.0 / (s * math.sqrt(2.0 * math.pi))


def longitudinal_constants(s: float) -> tuple[float, float]:
    """(1/v, 1/(v (1 - e^(-2/v)))) for the variance v = s^2, s in [rad]."""
    v = max(s, NARROWEST) ** 2
    return 1.0 / v, -1.0 / (v * math.expm1(-2.0 / v))


@njit(**INLINE)
def gaussian(R, half_precision, norm, x):
    """Unit-area Gaussian g(s, x): `half_precision` = 1/(2 s^2), `norm` = 1/(s sqrt(2 pi))."""
    return norm * exp(R, -half_precision * x * x)


@njit(**INLINE)
def fresnel(R, excess, c):
    """(F_r, F_t) of unpolarised light at incidence cosine c; `excess` = eta^2 - 1 >= 0.

    Neither value is computed as 1 minus the other, so both keep their relative precision where they
    are small. At eta = 1 nothing is reflected, down to c = 0.
    """
    c = max(c, R(1e-12))
    g = math.sqrt(excess + c * c)
    # Since (g - c)(g + c) = eta^2 - 1, the s-polarised amplitude needs no subtraction.
    inverse = R(1) / ((c + g) * (c + g))
    r_s = excess * inverse
    p = c + excess * c
    inverse_p = R(1) / ((p + g) * (p + g))
    reflected = R(0.5) * (r_s * r_s + (p - g) * (p - g) * inverse_p)
    transmitted = R(2) * g * (c * inverse + p * inverse_p)
    return reflected, transmitted


@njit(**INLINE)
def longitudinal(R, inverse_v, norm, sin_i, cos_i, sin_o, cos_o):
    """The kernel K(theta_i, theta_o) of [dEon2011], eq. 7; K cos theta_o integrates to 1.

    It is written with e^-x I0(x) and the squared sine of theta_h, so that v = 1e-6 causes neither
    overflow nor cancellation: K = e^(-2 sin^2(theta_h)/v) i0e(cos cos/v) norm.
    """
    y, x = half_inclination_legs(R, sin_i, cos_i, sin_o, cos_o)
    sin2_h = y * y / (y * y + x * x)
    decay = exp(R, R(-2) * inverse_v * sin2_h)
    return norm * decay * i0e(R, cos_i * cos_o * inverse_v)
