"""How well parameters are known: by curvature, and by profile where curvature misleads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from fabricusd.measure.fit.problem import Linear, Problem
from fabricusd.measure.fit.search import Found, Searched, refine
from fabricusd.run.spread import Place, spread

Floats = NDArray[np.float64]

LEVEL = 0.95
SIGMAS = float(norm.ppf(0.5 + 0.5 * LEVEL))
RISE = float(chi2.ppf(LEVEL, 1))
"""By how much chi^2 rises at the ends of a profile's interval."""

CORRELATED, WIDE = 0.95, 0.20
"""A parameter is profiled if it is correlated with another one by more, or if half its interval is
a larger share of its value."""
POINTS = 12
"""Most points of a profile to each side."""
BETTER = 0.05
"""A profile that finds a chi^2 lower by this has found a better minimum."""


@dataclass(frozen=True, kw_only=True)
class Curvature:
    """The covariance of all parameters, by (J^T J)^-1.

    labels : of the parameters, the linear ones last: "gain", "albedo 0", "offset 0" and so on
    values, deviations : (p,); correlation : (p, p)
    covariance : (p, p), 0 for parameters at the end of their range
    """

    labels: tuple[str, ...]
    values: Floats
    covariance: Floats

    @property
    def deviations(self) -> Floats:
        """(p,) standard deviations."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def correlation(self) -> Floats:
        """(p, p) correlations, 0 on the diagonal and for parameters at the end of their range."""
        d = self.deviations
        scale = np.where(d > 0, d, np.inf)
        made = self.covariance / np.outer(scale, scale)
        np.fill_diagonal(made, 0.0)
        return np.asarray(made, np.float64)


@dataclass(frozen=True, kw_only=True)
class Profile:
    """chi^2 at its least for fixed values of one parameter.

    low, high : where it rises by `RISE`, or the end of the range where it does not
    open_low, open_high : whether it is the end of the range
    points : parameters on the way, each within the interval
    better : the parameters of a lower minimum, if one was met
    """

    low: float
    high: float
    open_low: bool
    open_high: bool
    points: tuple[Floats, ...]
    better: Found | None


def curvature(problem: Problem, x: Floats, linear: Linear, scale: float) -> Curvature:
    """scale : by which chi^2 per value exceeds 1; it widens all intervals."""
    surface, volume = problem.terms(x)
    n = len(problem.names)
    labels = [p.name for p in problem.names]
    values = list(x)
    columns = [_slope(problem, x, linear, k) for k in range(n)]
    if problem.gain:
        labels.append("gain")
        values.append(linear.gain)
        whole = surface[:, None] + volume[:, None] * linear.albedo
        columns.append((whole * problem.weight).ravel())
    for name, wanted, factor in (
        ("albedo", True, linear.gain * volume), ("offset", problem.offset, np.ones_like(volume)),
    ):  # fmt: skip
        for c in range(3) if wanted else ():
            column = np.zeros_like(problem.weight)
            column[:, c] = factor * problem.weight[:, c]
            labels.append(f"{name} {c}")
            values.append(float(getattr(linear, name)[c]))
            columns.append(column.ravel())
    jacobian = np.stack(columns, axis=1)
    free = np.ones(len(labels), bool)
    free[:n] = ~at_end(problem, x)
    for c in range(3):
        k = labels.index(f"albedo {c}")
        free[k] = 0.0 < linear.albedo[c] < problem.most
    return Curvature(
        labels=tuple(labels), values=np.array(values),
        covariance=covariance_of(jacobian, free, scale),
    )  # fmt: skip


def covariance_of(jacobian: Floats, free: NDArray[np.bool_], scale: float) -> Floats:
    """(p, p) `scale (J^T J)^-1` of the columns of (m, p) `jacobian` that are free, 0 elsewhere."""
    norms = np.linalg.norm(jacobian, axis=0)
    free = free & (norms > 0)
    covariance = np.zeros((len(norms), len(norms)))
    if free.any():
        scaled = jacobian[:, free] / norms[free]
        inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-13, hermitian=True)
        covariance[np.ix_(free, free)] = inverse / np.outer(norms[free], norms[free]) * scale
    return covariance


def at_end(problem: Searched, x: Floats) -> NDArray[np.bool_]:
    """(k,) which parameters lie at an end of their range."""
    near = 2e-5 * (problem.high - problem.low)
    return np.asarray((x - problem.low < near) | (problem.high - x < near))


def _slope(problem: Problem, x: Floats, linear: Linear, k: int) -> Floats:
    """(3n,) derivative of the residuals by x[k], the linear part fixed."""
    step = 1e-3 * problem.steps[k]
    up, down = x.copy(), x.copy()
    up[k] = min(x[k] + step, problem.high[k])
    down[k] = max(x[k] - step, problem.low[k])
    rise = problem.residuals_at(up, linear) - problem.residuals_at(down, linear)
    return np.asarray(rise / (up[k] - down[k]))


def to_profile(problem: Searched, x: Floats, known: Curvature) -> list[int]:
    """Indices of the nonlinear parameters whose interval curvature does not tell."""
    related = np.abs(known.correlation).max(axis=1)
    half = SIGMAS * known.deviations
    end = at_end(problem, x)
    return [
        k for k in range(len(x))
        if end[k] or related[k] > CORRELATED or half[k] == 0
        or half[k] > WIDE * max(abs(x[k]), 0.05 * problem.steps[k])
    ]  # fmt: skip


def profiles(
    problem: Searched, best: Found, which: list[int], known: Curvature, scale: float,
    place: Place, name: str,
) -> dict[int, Profile]:  # fmt: skip
    """The profiles of parameters, their sides spread over `place`. name : of what is fitted"""
    sides = [
        _Side(best, k, side, float(known.deviations[k]), RISE * scale)
        for k in which
        for side in (-1.0, 1.0)
    ]
    made = spread(f"intervals of {name}", _traced, problem, sides, place)
    found = {}
    for n, k in enumerate(which):
        (low, open_low, below, first), (high, open_high, above, second) = made[2 * n : 2 * n + 2]
        lower = [each for each in (first, second) if each is not None]
        found[k] = Profile(
            low=low, high=high, open_low=open_low, open_high=open_high,
            points=(*below, *above),
            better=min(lower, key=lambda each: each.chi2) if lower else None,
        )  # fmt: skip
    return found


class _Side(NamedTuple):
    """A side of a profile: downwards, -1, or upwards, 1. k : the parameter's number"""

    best: Found
    k: int
    side: float
    deviation: float
    rise: float


def _traced(problem: Searched, one: _Side) -> tuple[float, bool, list[Floats], Found | None]:
    """(end of the interval, whether it is the range's, points within, a better minimum or None)."""
    best, k, side, deviation, rise = one
    end = float(problem.high[k] if side > 0 else problem.low[k])
    at = float(best.x[k])
    inside_at, inside_rise, x = at, 0.0, best.x
    outside: tuple[float, float] | None = None
    within: list[Floats] = []
    better: Found | None = None
    step = SIGMAS * deviation if deviation > 0 else 0.2 * float(problem.steps[k])
    step = min(max(step, 1e-4 * float(problem.steps[k])), 0.4 * (problem.high[k] - problem.low[k]))
    for _ in range(POINTS):
        if outside is None:
            value = inside_at + side * step
            if side * (value - end) >= 0:
                value = end
        else:
            # chi^2 is nearly a parabola: its root is nearly straight.
            a, b = np.sqrt(max(inside_rise, 0.0)), np.sqrt(outside[1])
            share = float(np.clip((np.sqrt(rise) - a) / (b - a), 0.1, 0.9))
            value = inside_at + share * (outside[0] - inside_at)
        if value == inside_at:
            return end, True, within, better
        start = x.copy()
        start[k] = value
        found = refine(problem, start, fixed=k)
        risen = found.chi2 - best.chi2
        if risen < -BETTER and (better is None or found.chi2 < better.chi2):
            better = found
        if risen > rise:
            outside = (value, risen)
        else:
            inside_at, inside_rise, x = value, risen, found.x
            within.append(found.x)
            if value == end:
                return end, True, within, better
            # As far again as a parabola would rise from here, but never in smaller steps: chi^2
            # may level out.
            reach = abs(value - at) * (1.1 * np.sqrt(rise / max(risen, 1e-9)) - 1.0)
            step = float(np.clip(reach, step, 3.0 * step))
        if outside is not None and abs(outside[1] - rise) < 0.1 * rise:
            return outside[0], False, within, better
        if outside is not None and abs(inside_rise - rise) < 0.1 * rise:
            return inside_at, False, within, better
    if outside is None:
        return inside_at, True, within, better
    return outside[0], False, within, better
