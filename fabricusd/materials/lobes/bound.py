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
    MATERIALX,
    POWERS,
    Mixture,
    evaluate,
    view_factor,
    view_terms,
)
from fabricusd.materials.lobes.target import cloth

Floats = NDArray[np.float64]

POLAR = (
    0.0, 10.0, 20.0, 30.0, 40.0, 45.0, 50.0, 54.0, 58.0, 61.0, 64.0, 66.5, 69.0, 71.0, 73.0, 75.0,
    76.5, 78.0, 79.5, 81.0, 82.0, 83.0, 84.0, 85.0, 86.0, 86.75, 87.5, 88.0, 88.5, 89.0,
)  # fmt: skip
AROUND, FEW = 64, 16
"""Polar angles of the views [degrees], and azimuths of those beyond STEEP and of the others."""

STEEP = 50.0

LARGEST = 20.0
"""Bound on each coefficient of V. The program would otherwise trade one term for another."""

SYMMETRIC = 2e-3
"""Logarithm of the ratio of opposite views' albedos below which V needs no odd terms."""

MARGIN = 0.003
"""Logarithm of what is left to the bound, for views between those that it holds at."""

TURNS = 2
"""Times that V is found. Light that a closure scatters more than once is not linear in V, so the
first V is a little off in the form of MaterialX."""

DARKEST = 1e-6
"""Luminance that is as good as black."""


class Bound:
    """The albedo of one fabric by view, which its mixtures must not exceed."""

    def __init__(self, fabric: Fabric) -> None:
        self.lights = skies.directions()
        self.views, self.solid = _views()
        self.most = self._albedo(lambda wi, wo: cloth(fabric, wi, wo))
        self.terms = view_terms(self.views)
        if self._symmetric():
            self.terms = self.terms[:, : 3 * POWERS]

    def __call__(self, mixture: Mixture) -> Mixture:
        """Return the mixture with the V that makes it least dark, and nowhere too bright."""
        found = replace(mixture, view=())
        for _ in range(TURNS if mixture.form == MATERIALX else 1):
            mine = self._albedo(lambda wi, wo, one=found: evaluate(one, wi, wo))
            room = np.log(self.most / mine) + np.log(view_factor(found, self.views)) - MARGIN
            best = linprog(
                -(self.solid @ self.terms), A_ub=self.terms, b_ub=room,
                bounds=(-LARGEST, LARGEST), method="highs",
            )  # fmt: skip
            found = replace(found, view=tuple(float(c) for c in best.x))
        return found

    def _albedo(self, value: Callable[[Floats, Floats], Floats]) -> Floats:
        """(views,) luminance under an even sky."""
        whole = [value(self.lights, np.tile(v, (len(self.lights), 1))).mean(0) for v in self.views]
        return np.maximum(np.array(whole) @ REC_709 * 2.0 * np.pi, DARKEST)

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
        # Rings are turned in turn, so that V is bound between the azimuths of each as well.
        a = 2.0 * np.pi * (np.arange(n) + 0.5 * (k % 2)) / n
        s = np.sin(p)
        views.append(np.column_stack((s * np.cos(a), s * np.sin(a), np.full(n, np.cos(p)))))
        solid.append(np.full(n, ring / n))
    return np.concatenate(views), np.concatenate(solid)
