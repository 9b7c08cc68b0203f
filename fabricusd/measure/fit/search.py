"""The search for the best parameters: many cheap starts, the best of them refined side by side."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.appearance.scattering.models import named
from fabricusd.measure.fit.problem import Problem
from fabricusd.run.spread import Place, spread

Floats = NDArray[np.float64]

CANDIDATES, REFINED = 240, 6
"""Starts that are drawn, and the best of them that are refined."""
CANDIDATES_WITH_TABLES, REFINED_WITH_TABLES = 48, 3
"""The same for the conserving model, whose tables take a tenth of a second a thread."""
ROWS = 600
"""Views by which candidates are judged."""
STEPS = 60


class Searched(Protocol):
    """Least squares of (k,) numbers: their ranges, their usual changes, and weighted residuals."""

    @property
    def low(self) -> Floats:
        """(k,) lower bounds."""

    @property
    def high(self) -> Floats:
        """(k,) upper bounds."""

    @property
    def steps(self) -> Floats:
        """(k,) usual changes."""

    def residuals(self, x: Floats) -> Floats:
        """(m,) weighted residuals."""


class Found(NamedTuple):
    """x : (k,) parameters; chi2 : the sum of squared weighted residuals."""

    x: Floats
    chi2: float


def search(problem: Problem, *, seed: int, place: Place) -> Found:
    """The best parameters from many starts; the same for a seed, wherever they are sought."""
    rng = np.random.default_rng(seed & (2**63 - 1))
    tables = named(problem.model).law == CONSERVING
    count = CANDIDATES_WITH_TABLES if tables else CANDIDATES
    lows = np.array([p.start[0] for p in problem.names])
    highs = np.array([p.start[1] for p in problem.names])
    # In a Latin hypercube each parameter meets every part of its range.
    cells = np.stack([rng.permutation(count) for _ in problem.names], axis=1)
    starts = lows + (highs - lows) * (cells + rng.random(cells.shape)) / count
    few = problem
    if len(problem.lobes) > ROWS:
        kept = np.sort(rng.choice(len(problem.lobes), ROWS, replace=False))
        few = Problem(
            problem.lobes.of(kept), problem.model, problem.names, gain=problem.gain,
            offset=problem.offset,
        )  # fmt: skip
    judged = spread(f"starts of {problem.model}", misfit, few, list(starts), place)
    order = np.argsort(judged, kind="stable")[: REFINED_WITH_TABLES if tables else REFINED]
    found = spread(f"fits of {problem.model}", refine, problem, list(starts[order]), place)
    return min(found, key=lambda each: each.chi2)


def misfit(problem: Searched, x: Floats) -> float:
    """chi^2 of parameters."""
    return float((problem.residuals(x) ** 2).sum())


def refine(problem: Searched, start: Floats, fixed: int | None = None) -> Found:
    """The nearest minimum from `start`; fixed : index of a parameter that stays as it is."""
    free = np.array([k for k in range(len(problem.low)) if k != fixed])
    x = np.clip(np.asarray(start, np.float64), problem.low, problem.high)

    def residuals(part: Floats) -> Floats:
        whole = x.copy()
        whole[free] = part
        return problem.residuals(whole)

    low, high = problem.low[free], problem.high[free]
    inner = 1e-6 * (high - low)
    done = least_squares(
        residuals, np.clip(x[free], low + inner, high - inner), bounds=(low, high),
        x_scale=problem.steps[free], max_nfev=STEPS, ftol=1e-10, xtol=1e-9,
    )  # fmt: skip
    x[free] = done.x
    return Found(x, 2.0 * float(done.cost))
