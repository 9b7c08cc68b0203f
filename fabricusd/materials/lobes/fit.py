"""Find the mixture of lobes that is nearest to a fabric.

The solver minimises differences of lightness, chroma and hue over pairs of directions and over the
views under an even sky, reweighted until they are the mean delta E 2000. The solver is
`scipy.optimize.least_squares`, after [Branch1999]. What is found is then kept from being brighter
than the fabric, `bound`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.materials.lobes.bound import Bound
from fabricusd.materials.lobes.colors import Colors
from fabricusd.materials.lobes.mixture import CYCLES, Mixture
from fabricusd.materials.lobes.parameters import bounds, pack, unpack, value_and_slopes
from fabricusd.materials.lobes.starts import grown, starts, turned
from fabricusd.materials.lobes.target import GRAZING, LIGHTS, Pairs, fitted_pairs
from fabricusd.quality.colors import delta_e_2000
from fabricusd.run.blas import one_blas_thread

Floats = NDArray[np.float64]

COUNT, COUNTS = 4, (1, 2, 3, 4, 5, 6)
"""Number of lobes unless another is asked for, and the numbers that may be."""

SKY = 0.2
"""Weight of the views under an even sky; the pairs have the rest."""

DARKEST = 1e-4
"""Albedo below which nothing is a share of the cloth's."""

GRAZING_SHARE = 0.25
"""Weight of the pairs of a grazing view; those of any other view have 1."""

EXCESS, BRIGHTNESS = 5.0, 10.0
"""Delta E that is as bad as being twice as bright as the cloth in each view, and as being twice as
bright, or dark, in the mean over the views. The less bright a fit, the less does `bound` take."""

PULL = 0.02
"""Delta E that a number costs that moves by 1, so that numbers without effect stay."""

FIRST, KEPT, MORE, ROUNDS = 8, 2, 25, 4
"""Steps from each start, starts that are kept, steps in each round, and rounds."""


class Problem:
    """Residuals of mixtures against the pairs of one fabric, and their derivatives."""

    def __init__(self, pairs: Pairs) -> None:
        self.pairs = pairs
        self.white = np.pi * pairs.values
        self.sky = self._albedo(pairs.values)
        self.colors, self.sky_colors = Colors(self.white), Colors(self.sky)
        share = np.ones(pairs.views)
        share[-len(GRAZING) :] = GRAZING_SHARE
        share /= share.sum()
        self.share_pairs = np.repeat((1.0 - SKY) * share / LIGHTS, LIGHTS)
        self.share_views, self.share_sky = share, SKY * share

    def _albedo(self, values: Floats) -> Floats:
        """(..., views, 3) directional albedos of (..., n, 3) values."""
        by_view = values.reshape(*values.shape[:-2], self.pairs.views, LIGHTS, 3)
        return np.asarray(by_view.mean(axis=-2) * 2.0 * np.pi)

    def errors(self, values: Floats) -> tuple[Floats, Floats]:
        """Delta E 2000 of the pairs and of the views."""
        return (
            delta_e_2000(np.pi * values, self.white),
            delta_e_2000(self._albedo(values), self.sky),
        )

    def delta_e(self, mixture: Mixture) -> float:
        """Mean delta E 2000 of the pairs of views that are not grazing."""
        values, _ = value_and_slopes(mixture, self.pairs.wi, self.pairs.wo, slopes=False)
        steep = len(values) - len(GRAZING) * LIGHTS
        return float(self.errors(values)[0][:steep].mean())

    def score(self, mixture: Mixture) -> float:
        """Mean delta E 2000, with what light too much and too little costs."""
        values, _ = value_and_slopes(mixture, self.pairs.wi, self.pairs.wo, slopes=False)
        pairs, sky = self.errors(values)
        light = self._light_cost(values)
        return float(self.share_pairs @ pairs + self.share_sky @ sky) + light

    def light(self, mixture: Mixture) -> float:
        """What light too much and too little costs."""
        values, _ = value_and_slopes(mixture, self.pairs.wi, self.pairs.wo, slopes=False)
        return self._light_cost(values)

    def _light_cost(self, values: Floats) -> float:
        excess, mean, _, _ = self._light(self._albedo(values))
        return float(np.sum(excess**2) + np.sum(mean**2))

    def _light(self, albedo: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Residuals of (views, 3) albedos: excess in each view, (3,) of the mean; their slopes."""
        scale = EXCESS / np.sqrt(len(albedo))
        scale = scale / np.maximum(self.sky.max(axis=1, keepdims=True), DARKEST)
        off = albedo - self.sky
        over = np.where(off > 0.0, scale, 0.0)
        even = BRIGHTNESS * self.share_views / max((self.share_views @ self.sky).max(), DARKEST)
        return off * over, even @ off, over, even

    def solve(self, start: Mixture, steps: int, *, evened: bool) -> Mixture:
        """Improve a mixture; `evened` turns the sum of squares into a sum."""
        wi, wo = self.pairs.wi, self.pairs.wo
        less_pairs, less_sky = np.sqrt(self.share_pairs), np.sqrt(self.share_sky)
        if evened:
            values, _ = value_and_slopes(start, wi, wo, slopes=False)
            pairs, sky = self.errors(values)
            less_pairs = less_pairs / np.sqrt(np.maximum(pairs, 0.7))
            less_sky = less_sky / np.sqrt(np.maximum(sky, 0.7))
        low, high = bounds(start)
        x0 = np.clip(pack(start), low + 1e-10, high - 1e-10)
        pull = PULL / np.sqrt(len(x0))
        held: dict[bytes, tuple[Floats, Floats]] = {}

        def both(x: Floats) -> tuple[Floats, Floats]:
            key = x.tobytes()
            if key not in held:
                held.clear()
                r, j = self._system(unpack(x, start), less_pairs, less_sky)
                held[key] = (
                    np.concatenate((r, pull * (x - x0))),
                    np.concatenate((j, pull * np.eye(len(x)))),
                )
            return held[key]

        best = least_squares(
            lambda x: both(x)[0], x0, jac=lambda x: both(x)[1], bounds=(low, high),
            x_scale=1.0, max_nfev=steps, ftol=1e-5, xtol=1e-6,
        )  # fmt: skip
        return unpack(best.x, start)

    def _system(self, mixture: Mixture, less: Floats, less_sky: Floats) -> tuple[Floats, Floats]:
        """Return residuals and their derivatives."""
        values, slopes = value_and_slopes(mixture, self.pairs.wi, self.pairs.wo)
        r, by_value = self.colors.residuals(np.pi * values)
        j = np.einsum("nij,mnj->nim", np.pi * by_value * less[:, None, None], slopes, optimize=True)
        albedo, albedo_slopes = self._albedo(values), self._albedo(slopes)
        rs, by_albedo = self.sky_colors.residuals(albedo)
        js = np.einsum(
            "nij,mnj->nim", by_albedo * less_sky[:, None, None], albedo_slopes, optimize=True
        )
        excess, mean, over, even = self._light(albedo)
        m = len(slopes)
        residuals = (r * less[:, None], rs * less_sky[:, None], excess, mean)
        by_number = (
            j.reshape(-1, m), js.reshape(-1, m), (over * albedo_slopes).reshape(m, -1).T,
            np.einsum("v,mvc->cm", even, albedo_slopes),
        )  # fmt: skip
        return np.concatenate([one.ravel() for one in residuals]), np.concatenate(by_number)


class Fits(NamedTuple):
    """The nearest mixture, and the nearest whose lobes are all of GGX, without V. A fit in the form
    of MaterialX starts from both: either may end nearer."""

    best: Mixture
    ggx: Mixture


def fit(
    fabric: Fabric, count: int = COUNT, form: str = CYCLES, *, max_error: float | None = None
) -> Mixture:
    """Return the mixture of `count` lobes in `form` that is nearest to `fabric`.

    max_error : mean delta E 2000 that fewer lobes may have; None takes `count` of them

    It is no brighter than the fabric under an even sky, in any view.

    Raises FabricError for a number of lobes out of COUNTS, and for a fabric without threads.
    """
    return fits(fabric, count, form, max_error=max_error).best


@one_blas_thread()
def fits(
    fabric: Fabric, count: int = COUNT, form: str = CYCLES, *, max_error: float | None = None
) -> Fits:
    """Return what `fit` does, and where a fit in another form starts."""
    if count not in COUNTS:
        raise FabricError("lobes", f"is {count}; it must be from {COUNTS[0]} to {COUNTS[-1]}")
    problem, bound = Problem(fitted_pairs(fabric)), Bound(fabric)

    @cache
    def of(few: int) -> list[Mixture]:
        return _found(problem, starts(fabric, few, form))

    def held(found: list[Mixture]) -> Mixture | None:
        return min((bound(one) for one in found), key=problem.score, default=None)

    for few in range(1, count) if max_error is not None else ():
        less = held(of(few))
        if less is not None and problem.delta_e(less) <= (max_error or 0.0):
            return Fits(less, of(few)[0])
    tried = list(of(count))
    if count > COUNT:
        # With more lobes the usual starts may end farther off than with fewer.
        fewer = min(of(count - 2), key=problem.score, default=None)
        tried += _found(problem, grown(fewer)) if fewer is not None else []
    best = held(tried)
    if best is None:
        raise FabricError(f"fabric '{fabric.name}'", f"has no threads for {count} lobes")
    alike = [one for one in tried if not any(lobe.gaussian for lobe in one.lobes)]
    return Fits(best, min(alike, key=problem.score))


@one_blas_thread()
def refit(fabric: Fabric, *mixtures: Mixture) -> Mixture:
    """Return the mixture nearest to `fabric` that a solver finds from `mixtures`, as `fit` does."""
    problem, bound = Problem(fitted_pairs(fabric)), Bound(fabric)
    begun = dict.fromkeys(replace(one, view=()) for one in mixtures)
    found = _found(problem, list(begun))
    return min((bound(one) for one in found), key=problem.score)


def _found(problem: Problem, begun: list[Mixture]) -> list[Mixture]:
    """Return the best of what is found from `begun`, and then those of other distributions."""
    if not begun:
        return []
    found = [_nearest(problem, begun)]
    if begun[0].form == CYCLES:
        found.append(_nearest(problem, [turned(one, range(len(one.lobes))) for one in begun]))
        best = min(found, key=problem.score)
        # Single lobes may be better off with the other distribution.
        single = [turned(best, (k,)) for k in range(len(best.lobes))]
        tried = [problem.solve(one, FIRST, evened=True) for one in single]
        found.append(_rounds(problem, min(tried, key=problem.score)))
    return found


def _nearest(problem: Problem, begun: list[Mixture]) -> Mixture:
    tried = [problem.solve(one, FIRST, evened=False) for one in begun]
    kept = sorted(tried, key=problem.score)[:KEPT]
    return min((_rounds(problem, one) for one in kept), key=problem.score)


def _rounds(problem: Problem, mixture: Mixture) -> Mixture:
    best, score = mixture, problem.score(mixture)
    for _ in range(ROUNDS):
        # Least squares favours the worst pairs. Reweighting [Holland1977] turns it to the mean.
        mixture = problem.solve(mixture, MORE, evened=True)
        got = problem.score(mixture)
        if got > score - 1e-3:
            return best if got > score else mixture
        best, score = mixture, got
    return best
