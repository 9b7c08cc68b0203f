"""The `thesis` model: [Bisker2011] eqs. 4.4-4.6, as printed.

    surface = F_r(eta, cos theta_h cos(phi_d/2)) cos(phi_d/2) g(gs, theta_h)/cos^2 theta_d
    volume  = F_t(eta, cos theta_i) F_t(eta, cos theta_o) ((1-kd) g(gv, theta_h) + kd)
              / (cos theta_i + cos theta_o)/cos^2 theta_d

The theta_h in the angle of the surface's Fresnel term looks like an erratum: it is 0 in the mirror
direction, so the inclination drops out there. It is kept to reproduce the printed formula.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.appearance.frame import cos2_difference_inclination, cos2_half_inclination
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
    excess = row[IOR_EXCESS]
    cos2_h = cos2_half_inclination(R, sin_i, cos_i, sin_o, cos_o)
    reflected, _ = fresnel(R, excess, math.sqrt(cos2_h) * cos_half)
    _, entering = fresnel(R, excess, cos_i)
    _, leaving = fresnel(R, excess, cos_o)
    scale = compressed(R, cos2_difference_inclination(R, sin_i, cos_i, sin_o, cos_o))
    return reflected * cos_half * scale, entering * leaving * scale * spread(R, cos_i, cos_o)


def plain_terms(thread: Thread, i: plain.Angles, o: plain.Angles) -> tuple[Floats, Floats]:
    """See `ThreadModel.plain`."""
    cos_h = np.cos(0.5 * (i.theta + o.theta))
    reflected = plain.fresnel(thread.ior, cos_h * plain.half_azimuth(i, o))
    entering, leaving = (1 - plain.fresnel(thread.ior, np.cos(w.theta)) for w in (i, o))
    return plain.gaussian_terms(thread, i, o, reflected, entering * leaving)


MODEL = ThreadModel(
    summary="Bisker 2011 as printed",
    law=PUBLISHED,
    factors=factors,
    lobes=gaussian_lobes,
    lobe_constants=gaussian_constants,
    cell_lobes=gaussian_cell_lobes,
    energies=gaussian_energies,
    plain=plain_terms,
)
