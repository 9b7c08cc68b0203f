"""The interface of a thread model: the parts that each module of `scattering.models` must provide.

In every model `f_s = surface + volume A` per channel, in 1/sr, without a cosine. It is the
scattering function of a curve, so `L_o = integral f_s L_i cos(theta_i) dwi` with the cosine of the
*inclination*. Each of the two terms is a factor times a lobe in the inclinations; the published
surface law can average the lobes over a stretch of the curve and evaluate the factors once. A model
may scale its volume term, and add to it, by values from tables. Neither term is ever negative.
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
"""The surface law that threads of a model follow in cloth. PUBLISHED: masked and reweighted,
reflection only. CONSERVING: as microfacets, on both sides, with scattering between threads."""


def mirror_widths(gamma_surface: float, gamma_volume: float) -> tuple[float, float]:
    """Standard deviations of theta_i [rad] for lobes around theta_h = (theta_i + theta_o)/2 = 0."""
    return 2.0 * gamma_surface, 2.0 * gamma_volume


@dataclass(frozen=True, kw_only=True)
class ThreadModel:
    """A scattering model of one thread. `row` is a row of `table.pack_threads`.

    summary : a phrase for the documentation of the schema
    law : PUBLISHED or CONSERVING
    factors : (R, row, sin_i, cos_i, sin_o, cos_o, cos_half) -> (surface, volume), everything but
        the lobes; cos_half is cos(phi_d/2), phi_d the difference of azimuths in (-pi, pi]
    lobes : (R, row, sin_i, cos_i, sin_o, cos_o) -> (surface, volume)
    lobe_constants : standard deviation gs or gv [rad] -> two constants, which `lobes` reads from
        the row, starting at SURFACE_LOBE and VOLUME_LOBE
    energies : (R, row, cos_o, transmitted, around, narrow_s, narrow_v) -> (surface, volume,
        isotropic): energies of the terms for a viewer at theta_o, for the shares of the sampler.
        The surface's is per unit of Fresnel reflectance, whose integral over azimuth is `around`;
        transmitted is F_t at theta_o; narrow_ are `narrowing` of `sampling.inclination_lobe`
    plain : (thread, angles of wi, angles of wo) -> (surface, volume), each (n,): the formula as
        `docs/model.md` states it, in plain NumPy, sharing no code with the kernels
    cell_lobes : (R, row, half, sin_i, cos_i, cos_phi_i, sin_o, cos_o, cos_phi_o) -> `lobes`,
        averaged over tangent angles up to `half` [rad] to each side; None if no closed form is
        known, in which case curves are integrated by points only
    position : (R, cos_theta) -> place of an inclination in the tables; None without them
    read : (R, row, position) -> two numbers from the tables; None without them
    looked_up : (R, row, the two of theta_i, the two of theta_o) -> (factor, addend) of the volume
        term, from what `read` gives; None for (1, 0)
    transmission : thread, entries -> T for the columns from TRANSMISSION on; None without this
        table. `entries` is how many are computed, all by default; the others are interpolated
    completion : thread, entries -> (x for the columns from COMPLETION on, X); None without it
    widths : gs, gv -> the standard deviations of theta_i [rad] that samplers use for the surface
        and the volume lobe around the mirror inclination
    most_albedo : `A` is clamped to this value, which is 1 if `A` is an albedo
    """

    summary: str
    law: int
    factors: Kernel
    lobes: Kernel
    lobe_constants: Callable[[float], tuple[float, float]]
    energies: Kernel
    plain: Callable[[Thread, Any, Any], tuple[Floats, Floats]]
    cell_lobes: Kernel = None
    position: Kernel = None
    read: Kernel = None
    looked_up: Kernel = None
    transmission: Callable[..., Floats] | None = None
    completion: Callable[..., tuple[Floats, float]] | None = None
    widths: Callable[[float, float], tuple[float, float]] = mirror_widths
    most_albedo: float = math.inf
