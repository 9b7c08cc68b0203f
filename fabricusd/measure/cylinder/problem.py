"""Least squares of the light of wraps, what is linear eliminated, and the search for its least."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from fabricusd.fabric import Fabric
from fabricusd.measure.cylinder.model import Model, Number
from fabricusd.measure.cylinder.profile import Profile
from fabricusd.measure.fit.search import Found, misfit, refine
from fabricusd.run.spread import Place, spread

Floats = NDArray[np.float64]

CANDIDATES, REFINED = 96, 4


class Linear(NamedTuple):
    """What follows from the other numbers. albedo : (k, 3) of the threads that are worn; gain"""

    albedo: Floats
    gain: float


def shown(
    model: Model, names: tuple[Number, ...], x: Floats, profiles: list[Profile]
) -> tuple[Floats, Floats]:
    """((n,) surface, (n, k) volume) that the pixels of wraps show for numbers x."""
    surface, volume = model.columns(
        names, x, *(np.concatenate([w.reshape(-1, 3) for w in (getattr(p, name) for p in profiles)])
                    for name in ("wi", "wo")),
    )  # fmt: skip
    whole = np.concatenate((surface[:, None], volume), axis=1)
    ends = np.cumsum([p.wi.size // 3 for p in profiles])[:-1]
    found = np.concatenate([
        p.seen(part.reshape(2, len(p.side), -1))
        for p, part in zip(profiles, np.split(whole, ends), strict=True)
    ])  # fmt: skip
    return found[:, 0], found[:, 1:]


class Problem:
    """Residuals of wraps; albedos, and the gain of a light that is not known, follow linearly.

    scale : irradiance of the light, 0 if it is not known
    """

    def __init__(
        self, template: Fabric, names: tuple[Number, ...], profiles: list[Profile], scale: float
    ) -> None:
        self.template, self.names, self.scale = template, names, scale
        self.light, self.sigma = (
            np.concatenate([getattr(p, name) for p in profiles]) for name in ("light", "sigma")
        )
        self.profiles = profiles
        self.model = Model(template)
        self.low, self.high, self.steps = (
            np.array([getattr(n, name) for n in names]) for name in ("low", "high", "step")
        )

    def held(self) -> Problem:
        """The same with the template's shadow for all cloths, see `Model.held`."""
        made = copy(self)
        made.model = self.model.holding()
        return made

    def columns(self, x: Floats) -> tuple[Floats, Floats]:
        """((n,) surface, (n, k) volume) that pixels of the fitted wraps show for numbers x."""
        return shown(self.model, self.names, x, self.profiles)

    def solve(self, x: Floats) -> tuple[Floats, Linear]:
        """((n, 3) light, what is linear) for numbers x."""
        surface, volume = self.columns(x)
        gain = self.scale or self._gain(surface, volume)
        albedo = np.stack([
            nnls(gain * volume / s[:, None], (y - gain * surface) / s)[0]
            for y, s in zip(self.light.T, self.sigma.T, strict=True)
        ], axis=1)  # fmt: skip
        return gain * (surface[:, None] + volume @ albedo), Linear(albedo, gain)

    def _gain(self, surface: Floats, volume: Floats) -> float:
        """The gain of the surface that all channels agree on best, albedos free."""
        above = below = 0.0
        for y, s in zip(self.light.T, self.sigma.T, strict=True):
            q, _ = np.linalg.qr(volume / s[:, None])
            own, left = surface / s, y / s
            own, left = own - q @ (q.T @ own), left - q @ (q.T @ left)
            above, below = above + float(own @ left), below + float(own @ own)
        return max(above / below, 1e-9) if below > 0 else 1.0

    def residuals(self, x: Floats) -> Floats:
        """(3n,) weighted."""
        return np.asarray(((self.solve(x)[0] - self.light) / self.sigma).ravel())


def search(problem: Problem, seed: int, place: Place) -> Found:
    """The least: many starts are judged with one shadow for all, the best refined."""
    rng = np.random.default_rng(seed & (2**63 - 1))
    names = problem.names
    starts = np.array([n.start for n in names])
    cells = np.stack([rng.permutation(CANDIDATES) for _ in names], axis=1)
    drawn = starts[:, 0] + (starts[:, 1] - starts[:, 0]) * (
        (cells + rng.random(cells.shape)) / CANDIDATES
    )
    held = problem.held()
    judged = spread("starts", misfit, held, list(drawn), place)
    order = np.argsort(judged, kind="stable")[:REFINED]
    rough = spread("fits", refine, held, list(drawn[order]), place)
    found = spread("fits with shadows", refine, problem, [each.x for each in rough], place)
    return min(found, key=lambda each: each.chi2)
