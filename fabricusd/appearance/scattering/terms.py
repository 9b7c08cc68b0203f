"""What one thread scatters: the surface and the volume term of the three models, as kernels.

`f_s = surface + volume A` per channel in every model, in 1/sr, without a cosine; it is what curves
scatter, so `L_o = integral f_s L_i cos(theta_i) dwi` with the *inclination's* cosine. Neither term
is negative, for any pair of unit vectors. A thread is a row of a table of numbers of precision R,
made by `thread_table.pack_threads`; the columns are named here.

Sources: `thesis` [Bisker2011] eqs. 4.4-4.6; `microcylinder` [Sadeghi2013]; `conserving` is MODEL
section 2: reciprocal, and passive for every albedo up to 1.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.appearance.frame import (
    cos2_difference_inclination,
    cos2_half_inclination,
    cos_half_difference,
    cos_inclination,
    half_inclination,
    unit_azimuth,
)
from fabricusd.appearance.scattering.lobes import fresnel, gaussian, longitudinal
from fabricusd.kernels.real import INLINE

THESIS, MICROCYLINDER, CONSERVING = 0, 1, 2
"""Values of the column MODEL, in the order of `fabricusd.fabric.MODELS`."""

ALBEDO_R, ALBEDO_G, ALBEDO_B = 0, 1, 2
MODEL = 3
IOR_EXCESS = 4
"""eta^2 - 1."""
ISOTROPIC = 5
GAMMA_SURFACE, GAMMA_VOLUME = 6, 7
"""Standard deviations gs, gv [rad], at least `lobes.NARROWEST`."""
SURFACE_GAIN = 8
SURFACE_GAUSSIAN, VOLUME_GAUSSIAN = 9, 11
"""First of the two columns of `lobes.gaussian_constants` of gs and gv."""
SURFACE_KERNEL, VOLUME_KERNEL = 13, 15
"""First of the two columns of `lobes.longitudinal_constants` of 2 gs and 2 gv."""
INVERSE_T_MAX = 17
BRIGHTNESS = 18
"""Mean of the albedo's channels, for sampling."""
TRANSMISSION = 19
"""First of TRANSMISSION_ENTRIES + 1 columns: T over sqrt(cos theta) from 0 to 1, the last one
repeated. Only filled for the `conserving` model."""
TRANSMISSION_ENTRIES = 361
COLUMNS = TRANSMISSION + TRANSMISSION_ENTRIES + 1

COS2_D_MINIMUM = 1e-6
COS_SUM_MINIMUM = 1e-3
COS_MINIMUM = 1e-6


@njit(**INLINE)
def published_terms(R, thesis, row, sin_i, cos_i, sin_o, cos_o, cos_half):
    """(surface, volume) [1/sr] of `thesis` (if true) or `microcylinder`.

    cos_half : cos(phi_d/2) for the azimuths' difference wrapped to (-pi, pi]
    """
    cos2_d = cos2_difference_inclination(R, sin_i, cos_i, sin_o, cos_o)
    theta_h = half_inclination(R, sin_i, cos_i, sin_o, cos_o)
    excess, kd = row[IOR_EXCESS], row[ISOTROPIC]
    if thesis:
        # As printed: theta_h, which is 0 in the mirror direction, so the inclination drops out.
        cos2_h = cos2_half_inclination(R, sin_i, cos_i, sin_o, cos_o)
        reflected, _ = fresnel(R, excess, math.sqrt(cos2_h) * cos_half)
        _, entering = fresnel(R, excess, cos_i)
        _, leaving = fresnel(R, excess, cos_o)
        transmitted = entering * leaving
    else:
        reflected, once = fresnel(R, excess, math.sqrt(cos2_d) * cos_half)
        transmitted = once * once
    g_s = gaussian(R, row[SURFACE_GAUSSIAN], row[SURFACE_GAUSSIAN + 1], theta_h)
    g_v = gaussian(R, row[VOLUME_GAUSSIAN], row[VOLUME_GAUSSIAN + 1], theta_h)
    compressed = R(1) / max(cos2_d, R(COS2_D_MINIMUM))
    surface = reflected * cos_half * g_s * compressed
    lobe = (R(1) - kd) * g_v + kd
    volume = transmitted * lobe * compressed / max(cos_i + cos_o, R(COS_SUM_MINIMUM))
    return surface, volume


@njit(**INLINE)
def conserving_surface(R, row, sin_i, cos_i, sin_o, cos_o, cos_half):
    """Surface term of `conserving` [1/sr]; reciprocal, its albedo is at most 1."""
    cos2_d = cos2_difference_inclination(R, sin_i, cos_i, sin_o, cos_o)
    reflected, _ = fresnel(R, row[IOR_EXCESS], math.sqrt(cos2_d) * cos_half)
    reflected = min(R(1), row[SURFACE_GAIN] * reflected)
    k = longitudinal(R, row[SURFACE_KERNEL], row[SURFACE_KERNEL + 1], sin_i, cos_i, sin_o, cos_o)
    return R(0.25) * reflected * cos_half * k / max(max(cos_i, cos_o), R(COS_MINIMUM))


@njit(**INLINE)
def transmission(R, row, cos_theta):
    """T(theta) = 1 - E(theta), what the surface lets through, from the thread's table.

    The entries are uniform in sqrt(cos theta): E is even in theta, so smooth in the cosine, and
    all its steep part lies within the lobe's width of 90 degrees, where this spacing is finest.
    """
    position = math.sqrt(cos_theta) * R(TRANSMISSION_ENTRIES - 1)
    index = np.int32(min(position, R(TRANSMISSION_ENTRIES - 1)))
    low = row[TRANSMISSION + index]
    high = row[TRANSMISSION + 1 + index]
    return low + (position - R(index)) * (high - low)


@njit(**INLINE)
def conserving_terms(R, row, through, sin_i, cos_i, sin_o, cos_o, cos_half):
    """(surface, volume) [1/sr] of `conserving`; with an albedo A up to 1 no more leaves than came.

    through : T(theta_i) T(theta_o) / T_max, see `transmission`

    K / max(cos_i, cos_o) integrates to at most 1 against cos^2, so the volume keeps T/T_max <= 1
    of what the surface let through.
    """
    surface = conserving_surface(R, row, sin_i, cos_i, sin_o, cos_o, cos_half)
    k = longitudinal(R, row[VOLUME_KERNEL], row[VOLUME_KERNEL + 1], sin_i, cos_i, sin_o, cos_o)
    kd = row[ISOTROPIC]
    widest = max(max(cos_i, cos_o), R(COS_MINIMUM))
    lobe = (R(1) - kd) * R(0.5 / math.pi) * k / widest + kd * R(1 / (math.pi * math.pi))
    return surface, through * lobe


@njit(**INLINE)
def terms_at(R, row, sin_i, cos_i, sin_o, cos_o, cos_half):
    """(surface, volume) [1/sr] of the model that the row names, from the angles' sines and cosines.

    row : (COLUMNS,) of the thread table
    """
    if row[MODEL] == R(CONSERVING):
        through = transmission(R, row, cos_i) * transmission(R, row, cos_o) * row[INVERSE_T_MAX]
        return conserving_terms(R, row, through, sin_i, cos_i, sin_o, cos_o, cos_half)
    return published_terms(R, row[MODEL] == R(THESIS), row, sin_i, cos_i, sin_o, cos_o, cos_half)


@njit(**INLINE)
def pair_angles(R, iy, iz, oy, oz):
    """(cos theta_i, cos theta_o, cos(phi_d/2)) of two directions' y and z in the thread frame."""
    cos_i = cos_inclination(R, iy, iz)
    cos_o = cos_inclination(R, oy, oz)
    sin_phi_i, cos_phi_i = unit_azimuth(R, iy, iz, cos_i)
    sin_phi_o, cos_phi_o = unit_azimuth(R, oy, oz, cos_o)
    return cos_i, cos_o, cos_half_difference(R, sin_phi_i, cos_phi_i, sin_phi_o, cos_phi_o)


@njit(**INLINE)
def terms(R, row, ix, iy, iz, ox, oy, oz):
    """(surface, volume) [1/sr] for two unit vectors in the thread frame (t, b, n_t)."""
    cos_i, cos_o, cos_half = pair_angles(R, iy, iz, oy, oz)
    return terms_at(R, row, ix, cos_i, ox, cos_o, cos_half)
