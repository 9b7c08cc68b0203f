"""Cloth on cylinders -> its threads: lobes, colours, the scale of its curves, and its coverage."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from fabricusd.fabric import Fabric
from fabricusd.measure.cylinder.model import Model, Number, fabric_of, numbers, worn
from fabricusd.measure.cylinder.profile import Profile
from fabricusd.measure.cylinder.setup import FIT
from fabricusd.measure.fit.result import Estimate
from fabricusd.quality.colors import delta_e_2000
from fabricusd.steps import parts

Floats = NDArray[np.float64]

CANDIDATES, REFINED = 96, 3
STEPS, LAST_STEPS = 40, 8
FINE, COARSE = 1e-4, 5e-3
"""Relative steps of derivatives: by lobes, and by what the tables of shadows are rounded for."""
SIGMAS = 1.96
BRIGHTER = 2.0
"""chi^2 per value on a side of a wrap from which light of a neighbour is suspected, ..."""
EXCESS = 0.005
"""... if that side is also brighter than the fit by this share of the wrap's mean."""
CORRELATED = 0.95
CHANNELS = ("red", "green", "blue")


@dataclass(frozen=True, kw_only=True)
class Wrap:
    """How near a wrap comes. chi2 : per value; mean, worst : delta E 2000, the latter its 95th
    percentile, the brightest light of all wraps as white; predicted : whether it was not fitted"""

    name: str
    photograph: int
    predicted: bool
    chi2: float
    mean: float
    worst: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Wrapped:
    """The fit. fabric : the template with the fitted numbers; chi2 : per value of the fitted wraps
    estimates : label -> number with its interval; wraps; notes
    """

    fabric: Fabric
    chi2: float
    values: int
    estimates: dict[str, Estimate]
    wraps: tuple[Wrap, ...]
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """The fit in words."""
        said = [f"cylinders: chi2/n {self.chi2:.3g} over {self.values} values"]
        said += [f"  {estimate}" for estimate in self.estimates.values()]
        for wrap in self.wraps:
            how = "predicted" if wrap.predicted else "fitted"
            said.append(
                f"  {wrap.name}, {how}: delta E 2000 {wrap.mean:.2f} in the mean, {wrap.worst:.2f} "
                f"at the 95th percentile, chi2/n {wrap.chi2:.3g}"
            )
        return said + [f"  note: {note}" for note in self.notes]

    def as_json(self) -> dict[str, Any]:
        """The fit as plain numbers and texts."""
        return {
            "chi2_per_value": self.chi2,
            "estimates": {
                name: {"value": e.value, "low": e.low, "high": e.high, "unit": e.unit}
                for name, e in self.estimates.items()
            },
            "wraps": [vars(wrap) for wrap in self.wraps],
            "notes": list(self.notes),
        }


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
        self.model = Model(
            template, np.concatenate([p.wi for p in profiles]),
            np.concatenate([p.wo for p in profiles]),
        )  # fmt: skip
        self.low, self.high, self.steps = (
            np.array([getattr(n, name) for n in names]) for name in ("low", "high", "step")
        )

    def solve(self, x: Floats) -> tuple[Floats, Floats, float]:
        """((n, 3) light, (k, 3) albedos, gain) for numbers x."""
        surface, volume = self.model.columns(self.names, x)
        gain = self.scale or self._gain(surface, volume)
        albedo = np.stack([
            nnls(gain * volume / s[:, None], (y - gain * surface) / s)[0]
            for y, s in zip(self.light.T, self.sigma.T, strict=True)
        ], axis=1)  # fmt: skip
        return gain * (surface[:, None] + volume @ albedo), albedo, gain

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


def fit_cylinders(
    template: Fabric, profiles: list[Profile], *, irradiance: float = 0.0, coverage: bool = False,
    seed: int = 0,
) -> Wrapped:  # fmt: skip
    """The threads with which cloth of the template's weave looks like its wraps.

    irradiance : of the light in the photographs' values; 0 frees it
    coverage : whether the share that each set covers is fitted too
    """
    names = numbers(template, coverage=coverage)
    own = [p for p in profiles if p.cylinder.use == FIT]
    problem = Problem(template, names, own, irradiance)
    x, cost = _search(problem, seed)
    light, albedo, gain = problem.solve(x)
    fabric = _dressed(template, names, x, albedo)
    wraps, notes = _wraps(template, names, profiles, x, albedo, gain)
    estimates, more = _estimates(problem, x, albedo, cost)
    notes += more
    chi2 = cost / light.size
    if chi2 > BRIGHTER:
        notes.append(
            f"the cloth explains the wraps worse than their deviations allow, by a factor of "
            f"{math.sqrt(chi2):.2g}"
        )
    if not irradiance:
        notes.append("the irradiance is not stated: the scale of A rests on the surface's light")
    return Wrapped(
        fabric=fabric, chi2=chi2, values=light.size, estimates=estimates, wraps=tuple(wraps),
        notes=tuple(notes),
    )  # fmt: skip


def _search(problem: Problem, seed: int) -> tuple[Floats, float]:
    """(best numbers, chi^2): many starts judged, the best refined, with one shadow for all of them;
    the best of those with a shadow of its own."""
    rng = np.random.default_rng(seed)
    names = problem.names
    starts = np.array([n.start for n in names])
    cells = np.stack([rng.permutation(CANDIDATES) for _ in names], axis=1)
    drawn = starts[:, 0] + (starts[:, 1] - starts[:, 0]) * (
        (cells + rng.random(cells.shape)) / CANDIDATES
    )
    problem.model.hold(problem.template)
    judged = [float((problem.residuals(x) ** 2).sum()) for x in parts("starts", list(drawn))]
    order = np.argsort(judged, kind="stable")[:REFINED]
    found = [_refined(problem, drawn[k], STEPS) for k in parts("fits", list(order))]
    best = min(found, key=lambda each: each[1])
    problem.model.hold(None)
    if problem.model.law.absolute:
        best = _refined(problem, best[0], LAST_STEPS)
    return best


def _refined(problem: Problem, start: Floats, steps: int) -> tuple[Floats, float]:
    inner = 1e-6 * (problem.high - problem.low)
    done = least_squares(
        problem.residuals, np.clip(start, problem.low + inner, problem.high - inner),
        bounds=(problem.low, problem.high), x_scale=problem.steps, max_nfev=steps,
        diff_step=np.where([n.field in ("curve", "coverage") for n in problem.names], COARSE, FINE),
        xtol=1e-6, ftol=1e-7,
    )  # fmt: skip
    return done.x, 2.0 * float(done.cost)


def _dressed(template: Fabric, names: tuple[Number, ...], x: Floats, albedo: Floats) -> Fabric:
    colors = {k: tuple(albedo[n]) for n, k in enumerate(worn(template))}
    return fabric_of(template, names, x, colors)


def _wraps(
    template: Fabric, names: tuple[Number, ...], profiles: list[Profile], x: Floats, albedo: Floats,
    gain: float,
) -> tuple[list[Wrap], list[str]]:  # fmt: skip
    """How near each wrap comes, and which are lit by a neighbour."""
    white = max(float(p.light.max()) for p in profiles)
    wraps, notes = [], []
    for p in profiles:
        surface, volume = Model(template, p.wi, p.wo).columns(names, x)
        light = gain * (surface[:, None] + volume @ albedo)
        off = (p.light - light) / p.sigma
        told = delta_e_2000(light / white, p.light / white)
        wraps.append(
            Wrap(
                name=p.cylinder.name, photograph=p.photograph, predicted=p.cylinder.use != FIT,
                chi2=float((off**2).mean()), mean=float(told.mean()),
                worst=float(np.quantile(told, 0.95)),
            )
        )  # fmt: skip
        notes += _neighbours(
            p, [q.cylinder for q in profiles if q.photograph == p.photograph], light
        )
    return wraps, notes


def _neighbours(p: Profile, others: list[Any], light: Floats) -> list[str]:
    """A note for each side of a wrap that is brighter than the fit and faces another cylinder."""
    said = []
    for sign, word in ((-1, "left"), (1, "right")):
        facing = [o.name for o in others if sign * (o.x - p.cylinder.x) > 0]
        here = sign * p.side > 0.55
        if not facing or np.count_nonzero(here) < 5:
            continue
        off = ((p.light - light) / p.sigma)[here]
        more = float((p.light - light)[here].mean() / p.light.mean())
        if (off**2).mean() > BRIGHTER and more > EXCESS:
            said.append(
                f"'{p.cylinder.name}' is {more:.1%} of its mean brighter than the fit on its {word}"
                f" (chi2/n {(off**2).mean():.3g} there), where it faces {' and '.join(facing)}: "
                "light from a neighbour? Photograph the cylinders one by one, or further apart"
            )
    return said


def _estimates(
    problem: Problem, x: Floats, albedo: Floats, cost: float
) -> tuple[dict[str, Estimate], list[str]]:
    """Intervals by the curvature, and which numbers cannot be told apart."""
    start = problem.residuals(x)
    columns = []
    for k in range(len(x)):
        step = (
            1e-3
            * float(problem.steps[k])
            * (-1 if x[k] > 0.5 * (problem.low[k] + problem.high[k]) else 1)
        )
        moved = x.copy()
        moved[k] += step
        columns.append((problem.residuals(moved) - start) / step)
    jacobian = np.stack(columns, axis=1)
    norms = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    inverse = np.linalg.pinv((jacobian / norms).T @ (jacobian / norms), rcond=1e-12)
    covariance = inverse / np.outer(norms, norms) * max(cost / start.size, 1.0)
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    found = {}
    for n, value, d in zip(problem.names, x, deviation, strict=True):
        low, high = max(value - SIGMAS * d, n.low), min(value + SIGMAS * d, n.high)
        found[n.label] = Estimate(
            label=n.label, value=float(value / n.scale), low=float(low / n.scale),
            high=float(high / n.scale), unit=n.unit,
        )  # fmt: skip
    names = list(problem.template.threads)
    spread = _albedo_deviations(problem, x, covariance)
    for m, k in enumerate(worn(problem.template)):
        for c, channel in enumerate(CHANNELS):
            at, half = float(albedo[m, c]), SIGMAS * float(spread[m, c])
            label = f"{names[k]} A {channel}"
            found[label] = Estimate(label=label, value=at, low=max(at - half, 0.0), high=at + half)
    pairs = covariance / np.maximum(np.outer(deviation, deviation), 1e-300)
    notes = [
        f"{problem.names[i].label} and {problem.names[j].label} are hardly told apart "
        f"(correlation {pairs[i, j]:.2f})"
        for i in range(len(x)) for j in range(i) if abs(pairs[i, j]) > CORRELATED
    ]  # fmt: skip
    return found, notes


def _albedo_deviations(problem: Problem, x: Floats, covariance: Floats) -> Floats:
    """(k, 3) deviations of the albedos: of their linear solve, and by the other numbers."""
    _, volume = problem.model.columns(problem.names, x)
    _, albedo, gain = problem.solve(x)
    own = np.stack([
        np.diag(np.linalg.pinv((gain * volume / s[:, None]).T @ (gain * volume / s[:, None])))
        for s in problem.sigma.T
    ], axis=1)  # fmt: skip
    slopes = []
    for k in range(len(x)):
        step = (
            1e-3
            * float(problem.steps[k])
            * (-1 if x[k] > 0.5 * (problem.low[k] + problem.high[k]) else 1)
        )
        moved = x.copy()
        moved[k] += step
        slopes.append((problem.solve(moved)[1] - albedo) / step)
    slope = np.stack(slopes, axis=-1)
    return np.asarray(np.sqrt(own + np.einsum("mcp,pq,mcq->mc", slope, covariance, slope)))
