"""What the fuzz of hairy threads does to one layer of cloth: `appearance.fuzz` in two numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.fuzz import (
    albedo_weights,
    cosine_mean,
    fibres_of,
    gathered_at,
    met,
    to_and_fro,
)
from fabricusd.fabric import Fabric

Floats = NDArray[np.float64]

VIEW = math.radians(8.0)
"""Angle between the view and the normal, of a d/8 instrument."""


@dataclass(frozen=True, kw_only=True)
class Fuzzed:
    """Shares of the light that meets the fuzz, at the view and in diffuse light.

    covered : float - share of the cloth that has fuzz
    met : (2,) - what meets a fibre
    albedo : (1 + k,) - of fibres: the surface's, and that of each thread's white volume
    up : (2, 1 + k) - what leaves on the side that it came from, of the same
    """

    covered: float
    met: Floats
    albedo: Floats
    up: Floats

    def over(self, shares: Floats, albedo: Floats) -> Floats:
        """(2, 2, ...) shares of the layer with its fuzz, from those `Layer.of` has without gaps.

        albedo : (k, ...) of the threads
        """
        grow = (slice(None), *(None,) * (albedo.ndim - 1))
        scattered = self.up[:, 0][grow] + np.tensordot(self.up[:, 1:], albedo, axes=1)
        lost = 1.0 - self.albedo[0] - np.tensordot(self.albedo[1:], albedo, axes=1)
        kept = 1.0 - self.met[grow] * lost - scattered
        again = to_and_fro(shares[1] / self.covered, scattered[1])
        out = shares * (kept * kept[1])[:, None] * again
        out[:, 0] += self.covered * scattered
        return np.asarray(out)


def fuzzed(fabric: Fabric) -> Fuzzed | None:
    """The fuzz over one layer of `fabric`; None where no thread is hairy."""
    fibres = fibres_of(fabric)
    if fibres is None:
        return None
    covered = float(fibres.share.sum())
    mean = fibres.share[:, None] / covered
    # Rows: the surface, then the volume of each thread.
    phase = np.concatenate(((mean * fibres.surface).sum(axis=0)[None], mean * fibres.volume))
    x, w = np.polynomial.legendre.leggauss(24)
    mu = 0.5 * (x + 1.0)
    rows = np.stack((gathered_at(fibres.depth, math.cos(VIEW)), cosine_mean(fibres.depth)))
    return Fuzzed(
        covered=covered,
        met=np.array(
            [float(met(fibres.depth, np.cos(VIEW))), float(w @ (mu * met(fibres.depth, mu)))]
        ),
        albedo=phase @ albedo_weights(),
        up=rows @ phase.T,
    )
