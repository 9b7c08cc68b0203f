"""Fit how much light comes through a thin sheet to the cloth, for lights behind it.

The sheet scatters evenly, and its transmittance is a factor on the map `transmission_color`. The
factor is linear in the radiance, so least squares over the transmittances of the views give it in
closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import surface
from fabricusd.fabric import Fabric
from fabricusd.materials.fit.forward import forward_through, frames_of
from fabricusd.materials.fit.judge import albedo, direction_pairs
from fabricusd.materials.fit.target import TexelSample
from fabricusd.materials.networks.look import Look
from fabricusd.quality.colors import delta_e_2000

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Through:
    """A fitted factor and its error.

    scale : (3,) factor on the map `transmission_color`
    delta_e, start_delta_e : mean delta E 2000 over pairs of directions, in a light under which a
        white sheet that transmits everything evenly is white; with the factor and without it
    """

    scale: tuple[float, float, float]
    delta_e: float
    start_delta_e: float


def fit_through(kind: str, texels: TexelSample, fabric: Fabric, look: Look) -> Through:
    """Return the factor with which surface `kind` transmits what `fabric` does in an even sky.

    The pairs of directions may come out a little worse by it than with the map alone: a sheet
    cannot be bright straight ahead and dark beside. Too little light in all would show more.
    """
    wi, wo = direction_pairs()
    wi = wi * (1.0, 1.0, -1.0)
    true = surface.evaluate(fabric, wi, wo, level="far", shadow=surface.mean_shadow(fabric))
    frames = frames_of(texels)
    i, o = (np.einsum("kab,nb->kna", frames, w) for w in (wi, wo))
    plain = np.einsum("k,knc->nc", texels.weight, forward_through(kind, look, texels, i, o))
    mine, theirs = albedo(plain), albedo(true)
    scale = (mine * theirs).sum(axis=0) / np.maximum((mine * mine).sum(axis=0), 1e-12)
    # Beyond 1 the sheet would let through more than arrives.
    most = np.max(np.broadcast_to(texels.through, (len(texels.base), 3)), axis=0)
    scale = np.minimum(scale, 1.0 / np.maximum(most, 1e-12))
    start, end = (
        float(delta_e_2000(np.pi * np.clip(plain * k, 0.0, None), np.pi * true).mean())
        for k in (1.0, scale)
    )
    red, green, blue = (float(x) for x in scale)
    return Through(scale=(red, green, blue), delta_e=end, start_delta_e=start)
