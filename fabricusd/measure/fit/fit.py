"""Fit a thread to lobes: search, intervals, and what cannot be told apart."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.fabric import MODELS
from fabricusd.measure.angles import listed
from fabricusd.measure.fit.intervals import (
    CORRELATED,
    SIGMAS,
    Curvature,
    Profile,
    at_end,
    curvature,
    profiles,
    to_profile,
)
from fabricusd.measure.fit.parameters import (
    level_formula,
    parameters,
    thread_of,
    volume_level,
)
from fabricusd.measure.fit.problem import Linear, Problem
from fabricusd.measure.fit.result import Estimate, Fitted
from fabricusd.measure.fit.search import Found, refine, search
from fabricusd.measure.lobes import Lobes
from fabricusd.run.blas import one_blas_thread
from fabricusd.run.cluster import Cluster, cluster_or_threads
from fabricusd.run.spread import Place

Floats = NDArray[np.float64]

CHANNELS = ("red", "green", "blue")
CALIBRATED = (0.8, 1.2)
"""chi^2 per value that agrees with the deviations of the lobes."""
TELLING = 0.7
"""A product is worth stating if its relative interval is smaller than that of A by this factor."""
OUTLYING = 0.2
"""Share of chi^2 from which the view that it is of is named."""
FEWEST = 12
"""Views below which a thread is not fitted."""


@one_blas_thread()
def fit_thread(
    lobes: Lobes,
    model: str,
    *,
    gain: bool | None = None,
    offset: bool = False,
    lean: bool = False,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | Cluster | None = None,
) -> Fitted:
    """The thread of `model` whose scattering is nearest to the lobes.

    gain : whether a factor common to all lobes is unknown; None frees it for relative lobes
    offset, lean : whether stray light, a constant per channel, and a lean of the thread in the
        light's plane are fitted too
    seed : of the starts; equal seeds give equal fits
    workers, scheduler : threads of this process, or a cluster, see `run.cluster.cluster_or_threads`

    Raises FabricError for too few views, and for a free gain where all views have one incidence:
    the index of refraction then cannot be told from the gain.
    """
    if model not in MODELS:
        raise FabricError("model", f"is '{model}'; it must be one of {', '.join(MODELS)}")
    free_gain = not lobes.absolute if gain is None else gain
    if len(lobes) < FEWEST:
        raise FabricError(
            f"'{lobes.name}'", f"has {len(lobes)} views; there must be at least {FEWEST}"
        )
    if free_gain and len(lobes.incidences) < 2:
        raise FabricError(
            f"'{lobes.name}'",
            f"has views of one incidence, {listed(lobes.incidences)} degrees, which cannot tell a "
            "free gain from the index of refraction; add another incidence, or fix the gain "
            "(--gain fixed, with the thread's imaged diameter in the manifest)",
        )
    names = parameters(model, gain=free_gain, lean=lean)
    problem = Problem(lobes, model, names, gain=free_gain, offset=offset)
    with cluster_or_threads(scheduler, workers) as cluster:
        found = _sought(problem, seed, workers if cluster is None else cluster)
    notes = cluster.notes if cluster is not None else ()
    return replace(found, notes=(*found.notes, *notes))


def _sought(problem: Problem, seed: int, place: Place) -> Fitted:
    best = search(problem, seed=seed, place=place)
    for _ in range(3):
        linear = problem.solve(best.x)[1]
        per_value = best.chi2 / problem.freedom
        # Deviations that are too small would make intervals too narrow; the fit itself shows it.
        scale = per_value if per_value > CALIBRATED[1] else 1.0
        known = curvature(problem, best.x, linear, scale)
        which = to_profile(problem, best.x, known)
        traced = profiles(problem, best, which, known, scale, place, problem.model)
        lower = [p.better for p in traced.values() if p.better is not None]
        if not lower:
            break
        best = refine(problem, min(lower, key=lambda each: each.chi2).x)
    return _fitted(problem, best, linear, known, traced)


def _fitted(
    problem: Problem, best: Found, linear: Linear, known: Curvature, traced: dict[int, Profile]
) -> Fitted:  # fmt: skip
    estimates = _estimates(problem, best, linear, known, traced)
    products, notes = _inseparable(problem, best, linear, known, traced, estimates)
    per_value = best.chi2 / problem.freedom
    if per_value > CALIBRATED[1]:
        notes.insert(
            0, f"the thread explains the lobes worse than their deviations allow, by a factor of "
            f"{per_value ** 0.5:.2g}; intervals are wider by it{_worst(problem, best)}",
        )  # fmt: skip
    elif per_value < CALIBRATED[0]:
        notes.insert(0, "the deviations of the lobes are too large: intervals are too wide")
    for k in np.flatnonzero(at_end(problem, best.x)):
        name = problem.names[k]
        notes.append(f"{name.label} lies at the end of its range, {best.x[k] / name.scale:.4g}")
    for c in range(3):
        if linear.albedo[c] >= problem.most:
            notes.append(f"A {CHANNELS[c]} lies at the end of its range, {problem.most:g}")
    if problem.gain and not problem.lobes.absolute:
        notes.append("the lobes are relative: their scale rests on the surface term alone")
    return Fitted(
        model=problem.model,
        thread=replace(thread_of(problem.names, best.x, list(linear.albedo)), model=problem.model),
        chi2=per_value,
        freedom=problem.freedom,
        values=problem.target.size,
        estimates=estimates,
        products=tuple(products),
        notes=tuple(notes),
    )


def _worst(problem: Problem, best: Found) -> str:
    """Words for the view that explains most of chi^2, if it explains much of it; or ""."""
    by_view = (problem.residuals(best.x).reshape(-1, 3) ** 2).sum(axis=1)
    k = int(np.argmax(by_view))
    if by_view[k] < OUTLYING * by_view.sum():
        return ""
    lobes = problem.lobes
    angles = np.degrees([lobes.theta_i[k], lobes.theta_o[k], lobes.phi_d[k]])
    return (
        f"; {by_view[k] / by_view.sum():.0%} of chi2 is of the view theta_i {angles[0]:.4g}, "
        f"theta_o {angles[1]:.4g}, phi_d {angles[2]:.4g}: is it an outlier?"
    )


def _estimates(
    problem: Problem, best: Found, linear: Linear, known: Curvature, traced: dict[int, Profile]
) -> dict[str, Estimate]:  # fmt: skip
    """Label -> the number, its interval by profile where there is one."""
    found: dict[str, Estimate] = {}
    half = SIGMAS * known.deviations
    for k, name in enumerate(problem.names):
        at, scale = float(best.x[k]), name.scale
        made = Estimate(
            label=name.label, value=at / scale, unit=name.unit,
            low=max(at - half[k], name.low) / scale, high=min(at + half[k], name.high) / scale,
        )  # fmt: skip
        if k in traced:
            p = traced[k]
            made = replace(
                made, low=p.low / scale, high=p.high / scale, how="profile", open_low=p.open_low,
                open_high=p.open_high,
            )  # fmt: skip
        found[name.label] = made
    points = [problem.solve(x)[1] for p in traced.values() for x in p.points]
    for c, channel in enumerate(CHANNELS):
        at = float(linear.albedo[c])
        width = half[known.labels.index(f"albedo {c}")]
        met = [at, *(float(point.albedo[c]) for point in points)]
        low, high = min(at - width, *met), max(at + width, *met)
        wider = low < at - width or high > at + width
        how = "profile" if wider else "curvature"
        found[f"A {channel}"] = Estimate(
            label=f"A {channel}", value=at, low=max(low, 0.0), high=min(high, problem.most),
            how=how if 0.0 < at < problem.most else "bound",
        )  # fmt: skip
    if problem.gain:
        width = half[known.labels.index("gain")]
        met = [linear.gain, *(point.gain for point in points)]
        found["gain"] = Estimate(
            label="gain", value=linear.gain, low=min(linear.gain - width, *met),
            high=max(linear.gain + width, *met),
        )  # fmt: skip
    if problem.offset:
        for c, channel in enumerate(CHANNELS):
            width = half[known.labels.index(f"offset {c}")]
            at = float(linear.offset[c])
            found[f"offset {channel}"] = Estimate(
                label=f"offset {channel}", value=at, low=at - width, high=at + width, unit="1/sr"
            )
    return found


def _inseparable(
    problem: Problem, best: Found, linear: Linear, known: Curvature, traced: dict[int, Profile],
    estimates: dict[str, Estimate],
) -> tuple[list[Estimate], list[str]]:  # fmt: skip
    """The products that can be told where parameters cannot, and the words that say so."""
    labels = list(known.labels)
    correlation = np.abs(known.correlation)
    volume = [labels.index(name) for name in ("gamma_volume", "isotropic")]
    albedos = [labels.index(f"albedo {c}") for c in range(3)]
    group = [*volume, *albedos]
    joined = max(
        float(correlation[i, j]) for i in volume for j in group if i != j
    )  # fmt: skip
    products: list[Estimate] = []
    notes: list[str] = []
    open_ended = any(
        traced[k].open_low or traced[k].open_high for k in volume if k in traced
    )  # fmt: skip
    if joined > CORRELATED or open_ended:
        k = labels.index("gamma_volume")
        fits = ""
        if k in traced:
            low, high = (np.degrees(v) for v in (traced[k].low, traced[k].high))
            fits = f": gv from {low:.3g} to {high:.3g} degrees all fit"
        levels = _levels(problem, best, linear, known, traced)
        if all(
            level.spread < TELLING * estimates[f"A {channel}"].spread
            for level, channel in zip(levels, CHANNELS, strict=True)
        ):
            products += levels
            notes.append(
                f"gv, kd and A cannot be told apart by these views{fits}; their product can, "
                f"{level_formula(problem.model)}"
            )
        else:
            notes.append(f"gv and kd cannot be told apart by these views{fits}")
    if problem.gain:
        pair = float(correlation[labels.index("ior"), labels.index("gain")])
        if pair > CORRELATED:
            products.append(_surface_level(best, linear, known, traced, problem))
            notes.append(
                "eta and the gain cannot be told apart by these views; their product can, "
                "gain ((eta - 1)/(eta + 1))^2"
            )
    return products, notes


def _levels(
    problem: Problem, best: Found, linear: Linear, known: Curvature, traced: dict[int, Profile]
) -> list[Estimate]:  # fmt: skip
    """Albedo times `volume_level`, per channel; their errors cancel in the product."""
    labels = known.labels
    at_gv, at_kd = labels.index("gamma_volume"), labels.index("isotropic")

    def level(x: Floats, albedo: float) -> float:
        return albedo * volume_level(problem.model, float(x[at_gv]), float(x[at_kd]))

    made = []
    met = [(x, problem.solve(x)[1]) for k in (at_gv, at_kd) if k in traced
           for x in traced[k].points]  # fmt: skip
    for c, channel in enumerate(CHANNELS):
        albedo = float(linear.albedo[c])
        value = level(best.x, albedo)
        slope = np.zeros(len(labels))
        for k in (at_gv, at_kd):
            step = 1e-4 * float(problem.steps[k])
            up, down = best.x.copy(), best.x.copy()
            up[k], down[k] = up[k] + step, down[k] - step
            slope[k] = (level(up, albedo) - level(down, albedo)) / (2 * step)
        slope[labels.index(f"albedo {c}")] = value / albedo if albedo > 0 else 0.0
        half = SIGMAS * math.sqrt(max(float(slope @ known.covariance @ slope), 0.0))
        seen = [value, *(level(x, float(point.albedo[c])) for x, point in met)]
        made.append(
            Estimate(
                label=f"{level_formula(problem.model)} {channel}", value=value,
                low=min(value - half, *seen), high=max(value + half, *seen),
                how="profile" if met else "curvature",
            )
        )  # fmt: skip
    return made


def _surface_level(
    best: Found, linear: Linear, known: Curvature, traced: dict[int, Profile], problem: Problem
) -> Estimate:  # fmt: skip
    """gain times the Fresnel reflectance face on."""
    k, g = known.labels.index("ior"), known.labels.index("gain")

    def level(ior: float, gain: float) -> float:
        return gain * ((ior - 1.0) / (ior + 1.0)) ** 2

    ior = float(best.x[k])
    value = level(ior, linear.gain)
    slope = np.zeros(len(known.labels))
    slope[k] = (level(ior + 1e-5, linear.gain) - level(ior - 1e-5, linear.gain)) / 2e-5
    slope[g] = value / linear.gain
    half = SIGMAS * math.sqrt(max(float(slope @ known.covariance @ slope), 0.0))
    points = traced[k].points if k in traced else ()
    seen = [value, *(level(float(x[k]), problem.solve(x)[1].gain) for x in points)]
    return Estimate(
        label="gain ((eta - 1)/(eta + 1))^2", value=value, low=min(value - half, *seen),
        high=max(value + half, *seen), how="profile" if points else "curvature",
    )  # fmt: skip
