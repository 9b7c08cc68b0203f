"""The `microcylinder` model of [Sadeghi2013], the default.

    surface = F_r cos(phi_d/2) g(gs, theta_h)/cos^2 theta_d
    volume  = F_t^2 ((1-kd) g(gv, theta_h) + kd)/(cos theta_i + cos theta_o)/cos^2 theta_d

with the Fresnel terms at the incidence cosine cos theta_d cos(phi_d/2).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.appearance.frame import cos2_difference_inclination
from fabricusd.appearance.scattering import plain_lobes as plain
from fabricusd.appearance.scattering.columns import IOR_EXCESS
from fabricusd.appearance.scattering.gaussian import (
    compressed,
    gaussian_cell_lobes,
    gaussian_energies,
    gaussian_lobes,
    spread,
)
from fabricusd.appearance.scattering.lobes import fresnel, gaussian_constants
from fabricusd.appearance.scattering.model import PUBLISHED, Floats, ThreadModel
from fabricusd.fabric import Thread
from fabricusd.kernels.real import INLINE


@njit(**INLINE)
def factors(R, row, sin_i, cos_i, sin_o, cos_o, cos_half):
    """See `ThreadModel.factors`."""
    cos2_d = cos2_difference_inclination(R, sin_i, cos_i, sin_o, cos_o)
    reflected, once = fresnel(R, row[IOR_EXCESS], math.sqrt(cos2_d) * cos_half)
    scale = compressed(R, cos2_d)
    return reflected * cos_half * scale, once * once * scale * spread(R, cos_i, cos_o)


def plain_terms(thread: Thread, i: plain.Angles, o: plain.Angles) -> tuple[Floats, Floats]:
    """See `ThreadModel.plain`."""
    cos_d = np.cos(0.5 * (i.theta - o.theta))
    reflected = plain.fresnel(thread.ior, cos_d * plain.half_azimuth(i, o))
    return plain.gaussian_terms(thread, i, o, reflected, (1 - reflected) ** 2)


MODEL = ThreadModel(
    summary="Sadeghi et al. 2013",
    law=PUBLISHED,
    factors=factors,
    lobes=gaussian_lobes,
    lobe_constants=gaussian_constants,
    cell_lobes=gaussian_cell_lobes,
    energies=gaussian_energies,
    plain=plain_terms,
)
