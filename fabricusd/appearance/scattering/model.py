"""What a thread model is: the parts that each module of `scattering.models` must have.

`f_s = surface + volume A` per channel in every model, in 1/sr, without a cosine; it is what curves
scatter, so `L_o = integral f_s L_i cos(theta_i) dwi` with the *inclination's* cosine. Each of the
two terms is a factor times a lobe in the inclinations: the law of published cloth averages the
lobes over a stretch of curve and leaves the factors. A table may scale the volume and add to it. Neither term is ever negative.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Thread

Floats = NDArray[np.float64]
Kernel = Any
"""A scalar numba function, compiled in place (`real.INLINE`), precision `R` first."""

PUBLISHED, CONSERVING = 0, 1
"""The surface law that a model's threads follow in cloth: masked and reweighted, reflection only;
or as microfacets, both sides, with light between threads."""


def mirror_widths(gamma_surface: float, gamma_volume: float) -> tuple[float, float]:
    """Deviations of theta_i [rad] of lobes in theta_h = (theta_i + theta_o)/2 around the mirror."""
    return 2.0 * gamma_surface, 2.0 * gamma_volume


@dataclass(frozen=True, kw_only=True)
class ThreadModel:
    """A scattering model of one thread. `row` is a row of `table.pack_threads`.

    summary : for the schema's documentation, a phrase
    law : PUBLISHED or CONSERVING
    factors : (R, row, sin_i, cos_i, sin_o, cos_o, cos_half) -> (surface, volume), everything but
        the lobes; cos_half is cos(phi_d/2) of the azimuths' difference wrapped to (-pi, pi]
    lobes : (R, row, sin_i, cos_i, sin_o, cos_o) -> (surface, volume)
    lobe_constants : deviation [rad], gs or gv -> two numbers that `lobes` finds in the row, from
        SURFACE_LOBE and VOLUME_LOBE on
    energies : (R, row, cos_o, transmitted, around, narrow_s, narrow_v) -> (surface, volume,
        isotropic): energy of the terms for a viewer at theta_o, for the sampler's shares. The
        surface's is per unit of Fresnel reflectance, whose integral over azimuth is `around`;
        transmitted is F_t at theta_o; narrow_ are `narrowing` of `sampling.inclination_lobe`
    plain : (thread, angles of wi, angles of wo) -> (surface, volume), (n,) each: the formula once
        more, in plain NumPy, as `docs/model.md` states it; shared with no kernel
    cell_lobes : (R, row, half, sin_i, cos_i, cos_phi_i, sin_o, cos_o, cos_phi_o) -> `lobes`,
        averaged over tangent angles `half` [rad] to each side; None where no closed form is known:
        curves are then integrated by points alone
    looked_up : (R, row, cos_i, cos_o) -> (factor, addend) of the volume, read from tables; None
        for (1, 0)
    transmission : thread -> T for the columns from TRANSMISSION on; None without that table
    completion : thread -> (x for the columns from COMPLETION on, X); None without that table
    widths : gs, gv -> the deviations of theta_i [rad] that samplers give the surface and the volume
        lobe around the mirror inclination
    most_albedo : `A` is clamped to this; 1 where it is an albedo
    """

    summary: str
    law: int
    factors: Kernel
    lobes: Kernel
    lobe_constants: Callable[[float], tuple[float, float]]
    energies: Kernel
    plain: Callable[[Thread, Any, Any], tuple[Floats, Floats]]
    cell_lobes: Kernel = None
    looked_up: Kernel = None
    transmission: Callable[[Thread], Floats] | None = None
    completion: Callable[[Thread], tuple[Floats, float]] | None = None
    widths: Callable[[float, float], tuple[float, float]] = mirror_widths
    most_albedo: float = math.inf
