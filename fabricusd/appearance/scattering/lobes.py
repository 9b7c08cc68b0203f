"""The lobes that every thread model is made of. Precision `R` first; all are scalar kernels.

Widths and indices come in the form that evaluation needs (1/s^2, eta^2 - 1), so that a table can
hold them ready: see `gaussian_constants` and `longitudinal_constants`.
"""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.frame import half_inclination_legs
from fabricusd.kernels.real import INLINE, exp, i0e

NARROWEST = 1e-6
"""Standard deviation below which a lobe is taken as this wide [rad]: its peak and 1/s^2 stay finite
in float32, and no float32 direction resolves it."""
COS_MINIMUM = 1e-6
"""Floor of a cosine that is divided by."""
LARGEST_IOR = 1e8
"""Index of refraction above which reflection is total to float32's rounding."""


def gaussian_constants(s: float) -> tuple[float, float]:
    """(1/(2 s^2), 1/(s sqrt(2 pi))) of the standard deviation s [rad]."""
    s = max(s, NARROWEST)
    return 0.5 / (s * s), 1.0 / (s * math.sqrt(2.0 * math.pi))


def longitudinal_constants(s: float) -> tuple[float, float]:
    """(1/v, 1/(v (1 - e^(-2/v)))) of the variance v = s^2, s in [rad]."""
    v = max(s, NARROWEST) ** 2
    return 1.0 / v, -1.0 / (v * math.expm1(-2.0 / v))


@njit(**INLINE)
def gaussian(R, half_precision, norm, x):
    """Unit-area Gaussian g(s, x): `half_precision` = 1/(2 s^2), `norm` = 1/(s sqrt(2 pi))."""
    return norm * exp(R, -half_precision * x * x)


@njit(**INLINE)
def fresnel(R, excess, c):
    """(F_r, F_t) of an unpolarised wave at incidence cosine c; `excess` = eta^2 - 1 >= 0.

    Neither of the two is the other's difference from 1: both keep their relative precision where
    they are small. At eta = 1 nothing is reflected, down to c = 0.
    """
    c = max(c, R(1e-12))
    g = math.sqrt(excess + c * c)
    # (g - c)(g + c) = eta^2 - 1, so the s-polarised amplitude needs no difference.
    inverse = R(1) / ((c + g) * (c + g))
    r_s = excess * inverse
    p = c + excess * c
    inverse_p = R(1) / ((p + g) * (p + g))
    reflected = R(0.5) * (r_s * r_s + (p - g) * (p - g) * inverse_p)
    transmitted = R(2) * g * (c * inverse + p * inverse_p)
    return reflected, transmitted


@njit(**INLINE)
def longitudinal(R, inverse_v, norm, sin_i, cos_i, sin_o, cos_o):
    """The kernel K(theta_i, theta_o) of [dEon2011], eq. 7: its integral times cos is 1.

    Written with e^-x I0(x) and the squared sine of theta_h, so that v = 1e-6 neither overflows nor
    cancels: K = e^(-2 sin^2(theta_h)/v) i0e(cos cos/v) norm.
    """
    y, x = half_inclination_legs(R, sin_i, cos_i, sin_o, cos_o)
    sin2_h = y * y / (y * y + x * x)
    decay = exp(R, R(-2) * inverse_v * sin2_h)
    return norm * decay * i0e(R, cos_i * cos_o * inverse_v)
