"""Cloth on cylinders -> its threads: lobes, colours, the scale of its curves, and its coverage."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Fabric
from fabricusd.measure.cylinder.intervals import (
    BADLY_FITTED,
    estimates_of,
    known_of,
    products_of,
)
from fabricusd.measure.cylinder.model import fabric_of, numbers, worn
from fabricusd.measure.cylinder.problem import Linear, Problem, search, shown
from fabricusd.measure.cylinder.profile import Profile
from fabricusd.measure.cylinder.setup import FIT
from fabricusd.measure.fit.intervals import at_end
from fabricusd.measure.fit.result import Estimate, as_numbers
from fabricusd.quality.colors import delta_e_2000
from fabricusd.run.blas import one_blas_thread
from fabricusd.run.cluster import Cluster, cluster_or_threads

Floats = NDArray[np.float64]

BRIGHTER = 2.0
"""chi^2 per value on a side of a wrap from which light of a neighbour is suspected, ..."""
EXCESS = 0.005
"""... if that side is also brighter than the fit by this share of the wrap's mean."""


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
    products : what the wraps tell of numbers that they do not tell apart
    """

    fabric: Fabric
    chi2: float
    values: int
    estimates: dict[str, Estimate]
    products: tuple[Estimate, ...]
    wraps: tuple[Wrap, ...]
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """The fit in words."""
        said = [f"cylinders: chi2/n {self.chi2:.3g} over {self.values} values"]
        said += [f"  {estimate}" for estimate in (*self.estimates.values(), *self.products)]
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
            "estimates": {name: as_numbers(e) for name, e in self.estimates.items()},
            "products": {e.label: as_numbers(e) for e in self.products},
            "wraps": [vars(wrap) for wrap in self.wraps],
            "notes": list(self.notes),
        }


@one_blas_thread()
def fit_cylinders(
    template: Fabric, profiles: list[Profile], *, irradiance: float = 0.0, coverage: bool = False,
    seed: int = 0, workers: int | None = None, scheduler: str | Cluster | None = None,
) -> Wrapped:  # fmt: skip
    """The threads with which cloth of the template's weave looks like its wraps.

    irradiance : of the light in the photographs' values; 0 frees it
    coverage : whether the share that each set covers is fitted too
    seed : of the starts; equal seeds give equal fits
    workers, scheduler : threads of this process, or a cluster, see `run.cluster.cluster_or_threads`
    """
    names = numbers(template, coverage=coverage)
    own = [p for p in profiles if p.cylinder.use == FIT]
    problem = Problem(template, names, own, irradiance)
    with cluster_or_threads(scheduler, workers) as cluster:
        place = workers if cluster is None else cluster
        known = known_of(problem, search(problem, seed, place), place)
    estimates = estimates_of(problem, known)
    products, notes = products_of(problem, known, estimates)
    colors = {k: tuple(known.linear.albedo[n]) for n, k in enumerate(worn(template))}
    wraps, more = _wraps(problem, profiles, known.best.x, known.linear)
    notes += [*more, *(cluster.notes if cluster is not None else ())]
    chi2 = known.best.chi2 / problem.light.size
    if chi2 > BADLY_FITTED:
        notes.append(
            f"the cloth explains the wraps worse than their deviations allow, by a factor of "
            f"{math.sqrt(chi2):.2g}; intervals are wider by it"
        )
    for k in np.flatnonzero(at_end(problem, known.best.x)):
        value = known.best.x[k] / names[k].scale
        notes.append(f"{names[k].label} lies at the end of its range, {value:.4g}")
    if not irradiance:
        notes.append("the irradiance is not stated: the scale of A rests on the surface's light")
    return Wrapped(
        fabric=fabric_of(template, names, known.best.x, colors), chi2=chi2,
        values=problem.light.size, estimates=estimates, products=tuple(products),
        wraps=tuple(wraps), notes=tuple(notes),
    )  # fmt: skip


def _wraps(
    problem: Problem, profiles: list[Profile], x: Floats, linear: Linear
) -> tuple[list[Wrap], list[str]]:
    """How near each wrap comes, and which are lit by a neighbour."""
    white = max(float(p.light.max()) for p in profiles)
    wraps, notes = [], []
    for p in profiles:
        surface, volume = shown(problem.model, problem.names, x, [p])
        light = linear.gain * (surface[:, None] + volume @ linear.albedo)
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
