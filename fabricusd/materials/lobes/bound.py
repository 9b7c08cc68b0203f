"""Keep a mixture from being brighter than the cloth under an even sky, in any view.

The factor V of a mixture is the exponential of polynomials. The bound is therefore linear in their
coefficients, and so is how dark the mixture becomes: a linear program finds the least dark V.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from fabricusd.fabric import Fabric
from fabricusd.materials.lobes import skies
from fabricusd.materials.lobes.colors import REC_709
from fabricusd.materials.lobes.mixture import (
    CYCLES,
    POWERS,
    Mixture,
    evaluate,
    view_terms,
)
from fabricusd.materials.lobes.target import cloth

Floats = NDArray[np.float64]

POLAR = (
    0.0, 7.5, 15.0, 22.5, 30.0, 37.5, 44.0, 50.0, 54.0, 58.0, 61.0, 64.0, 66.5, 69.0, 71.0, 73.0,
    75.0, 76.5, 77.5, 78.5, 79.5, 80.5, 81.25, 82.25, 83.0, 83.75, 84.25, 84.75, 85.25, 85.75,
    86.25, 86.75, 87.25, 87.75, 88.25, 88.75, 89.0,
)  # fmt: skip
AROUND, FEW = 48, 24
"""Polar angles of the views [degrees], and azimuths of those beyond STEEP and of the others."""

STEEP = 50.0

LARGEST = 20.0
"""Bound on each coefficient of V. The program would otherwise trade one term for another."""

SYMMETRIC = 2e-3
"""Logarithm of the ratio of opposite views' albedos below which V needs no odd terms."""

MARGIN = 0.008
"""Logarithm of what is left to the bound, for views between those that it holds at."""

DARKEST = 1e-6
"""Luminance that is as good as black."""


class Bound:
    """The albedo of one fabric by view, which its mixtures must not exceed.

    views : (n, 3); solid : (n,) their solid angles; most : (n,) luminance of the cloth's albedo
    terms : (n, m) `view_terms` that V has
    """

    def __init__(self, fabric: Fabric) -> None:
        self.lights = skies.directions()
        self.views, self.solid = _views()
        self.most = self._albedo(lambda wi, wo: cloth(fabric, wi, wo))
        self.terms = view_terms(self.views)
        if self._symmetric():
            self.terms = self.terms[:, : 3 * POWERS]

    def __call__(self, mixture: Mixture) -> Mixture:
        """Return the mixture with the V that makes it least dark, and nowhere too bright."""
        best = linprog(
            -(self.solid @ self.terms), A_ub=self.terms, b_ub=np.log(self._room(mixture)) - MARGIN,
            bounds=(-LARGEST, LARGEST), method="highs",
        )  # fmt: skip
        return replace(mixture, view=tuple(float(c) for c in best.x))

    def _room(self, mixture: Mixture) -> Floats:
        """(views,) largest V."""
        one = self._brightness(replace(mixture, view=()))
        if mixture.form == CYCLES:
            return self.most / one
        two = self._brightness(replace(mixture, view=(np.log(2.0),)))
        # What MaterialX adds to a lobe grows with the square of its reflectance: the albedo is
        # once V + twice V^2.
        twice = np.maximum(0.5 * two - one, 0.0)
        once = one - twice
        return np.asarray(2.0 * self.most / (once + np.sqrt(once * once + 4.0 * twice * self.most)))

    def _brightness(self, mixture: Mixture) -> Floats:
        return self._albedo(lambda wi, wo: evaluate(mixture, wi, wo))

    def _albedo(self, value: Callable[[Floats, Floats], Floats]) -> Floats:
        """(views,) luminance under an even sky."""
        whole = [value(self.lights, np.tile(v, (len(self.lights), 1))).mean(0) for v in self.views]
        luminance = np.array(whole) @ REC_709 * 2.0 * np.pi
        return np.asarray(np.maximum(luminance, DARKEST))

    def _symmetric(self) -> bool:
        """Whether opposite views see the same albedo."""
        opposite = np.argmin(
            np.linalg.norm(self.views[:, None] - self.views * (-1.0, -1.0, 1.0), axis=-1), axis=1
        )
        return bool(np.abs(np.log(self.most / self.most[opposite])).max() < SYMMETRIC)


def _views() -> tuple[Floats, Floats]:
    """(n, 3) views, and the solid angle of each."""
    polar = np.radians(POLAR)
    edges = np.concatenate(([0.0], 0.5 * (polar[1:] + polar[:-1]), [0.5 * np.pi]))
    rings = np.cos(edges[:-1]) - np.cos(edges[1:])
    views, solid = [], []
    for k, (p, ring) in enumerate(zip(polar, rings, strict=True)):
        n = AROUND if p > np.radians(STEEP) else FEW
        # Every second ring is turned, so that its views lie between the azimuths of its neighbours.
        a = 2.0 * np.pi * (np.arange(n) + 0.5 * (k % 2)) / n
        s = np.sin(p)
        views.append(np.column_stack((s * np.cos(a), s * np.sin(a), np.full(n, np.cos(p)))))
        solid.append(np.full(n, ring / n))
    return np.concatenate(views), np.concatenate(solid)
