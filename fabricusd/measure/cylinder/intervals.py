"""How well the numbers of cloth on cylinders are known, and in which product where not each."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.measure.cylinder.model import worn
from fabricusd.measure.cylinder.problem import Linear, Problem
from fabricusd.measure.fit.intervals import (
    CORRELATED,
    SIGMAS,
    Curvature,
    Profile,
    at_end,
    covariance_of,
    profiles,
)
from fabricusd.measure.fit.parameters import level_formula, volume_level
from fabricusd.measure.fit.result import Estimate
from fabricusd.measure.fit.search import Found, refine
from fabricusd.run.spread import Place

Floats = NDArray[np.float64]

CHANNELS = ("red", "green", "blue")
BADLY_FITTED = 1.2
"""chi^2 per value from which intervals are widened by it."""
WIDE = 0.4
"""Width of an interval over its value from which a number is said not to be told alone."""
TELLING = 0.7
"""A product is worth stating if its relative interval is smaller than that of its factor by this.
"""
ROUNDS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class Known:
    """What the wraps tell. best : the least, with `linear` of it; curvature, its labels those of
    the numbers and "THREAD A CHANNEL"; traced : index of a number -> its profile
    met : (x, linear) of every point of the profiles, each within an interval
    """

    best: Found
    linear: Linear
    curvature: Curvature
    traced: dict[int, Profile]
    met: tuple[tuple[Floats, Linear], ...]


def known_of(problem: Problem, best: Found, place: Place) -> Known:
    """Profiles of all numbers: the valley in which threads fit is seldom straight, so that the
    curvature at its lowest place tells little of it. A lower place that a profile meets is taken.
    """
    for last in range(ROUNDS):
        linear = problem.solve(best.x)[1]
        per_value = best.chi2 / problem.light.size
        scale = per_value if per_value > BADLY_FITTED else 1.0
        curve = _curvature(problem, best.x, linear, scale)
        every = list(range(len(best.x)))
        traced = profiles(problem, best, every, curve, scale, place, "cylinders")
        lower = [p.better for p in traced.values() if p.better is not None]
        if not lower or last == ROUNDS - 1:
            break
        best = refine(problem, min(lower, key=lambda each: each.chi2).x)
    met = tuple((x, problem.solve(x)[1]) for p in traced.values() for x in p.points)
    return Known(best=best, linear=linear, curvature=curve, traced=traced, met=met)


def _albedo_label(problem: Problem, m: int, c: int) -> str:
    return f"{list(problem.template.threads)[worn(problem.template)[m]]} A {CHANNELS[c]}"


def _curvature(problem: Problem, x: Floats, linear: Linear, scale: float) -> Curvature:
    """The covariance of all numbers, gain and albedos."""
    albedo, gain = linear
    surface, volume = problem.columns(x)
    labels, values, columns = [], [], []

    def light(at: Floats) -> Floats:
        s, v = problem.columns(at)
        return np.asarray(gain * (s[:, None] + v @ albedo) / problem.sigma)

    for k, number in enumerate(problem.names):
        step = 1e-3 * float(problem.steps[k])
        up, down = x.copy(), x.copy()
        up[k] = min(x[k] + step, problem.high[k])
        down[k] = max(x[k] - step, problem.low[k])
        labels.append(number.label)
        values.append(float(x[k]))
        columns.append(((light(up) - light(down)) / (up[k] - down[k])).ravel())
    free = list(~at_end(problem, x))
    if not problem.scale:
        labels.append("gain")
        values.append(gain)
        columns.append(((surface[:, None] + volume @ albedo) / problem.sigma).ravel())
        free.append(True)
    for m in range(len(albedo)):
        for c in range(3):
            column = np.zeros_like(problem.sigma)
            column[:, c] = gain * volume[:, m] / problem.sigma[:, c]
            labels.append(_albedo_label(problem, m, c))
            values.append(float(albedo[m, c]))
            columns.append(column.ravel())
            free.append(bool(albedo[m, c] > 0))
    return Curvature(
        labels=tuple(labels), values=np.array(values),
        covariance=covariance_of(np.stack(columns, axis=1), np.array(free), scale),
    )  # fmt: skip


def estimates_of(problem: Problem, known: Known) -> dict[str, Estimate]:
    """Label -> the number, with its interval by profile; of what is linear, by the curvature about
    every point of the profiles."""
    found: dict[str, Estimate] = {}
    for k, number in enumerate(problem.names):
        p, s = known.traced[k], number.scale
        met = [float(x[k]) for x, _ in known.met]
        found[number.label] = Estimate(
            label=number.label, value=float(known.best.x[k]) / s, low=min(p.low, *met) / s,
            high=max(p.high, *met) / s, unit=number.unit, how="profile", open_low=p.open_low,
            open_high=p.open_high,
        )  # fmt: skip
    if not problem.scale:
        found["gain"] = _told(known, "gain", lambda x, linear: linear.gain, {"gain": 1.0})
    for m in range(len(known.linear.albedo)):
        for c in range(3):
            label = _albedo_label(problem, m, c)

            def own(x: Floats, linear: Linear, m: int = m, c: int = c) -> float:
                return float(linear.albedo[m, c])

            made = _told(known, label, own, {label: 1.0})
            found[label] = replace(made, low=max(made.low, 0.0))
    return found


def _told(
    known: Known, label: str, value: Callable[[Floats, Linear], float], slopes: dict[str, float]
) -> Estimate:
    """An estimate of a function of all numbers, whose derivatives by labels are `slopes`."""
    labels = known.curvature.labels
    slope = np.zeros(len(labels))
    for name, by in slopes.items():
        slope[labels.index(name)] = by
    half = SIGMAS * math.sqrt(max(float(slope @ known.curvature.covariance @ slope), 0.0))
    at = value(known.best.x, known.linear)
    met = [value(x, linear) for x, linear in known.met]
    low, high = min(at - half, *met, at), max(at + half, *met, at)
    wider = low < at - half or high > at + half
    return Estimate(
        label=label, value=at, low=low, high=high, how="profile" if wider else "curvature"
    )


def products_of(
    problem: Problem, known: Known, estimates: dict[str, Estimate]
) -> tuple[list[Estimate], list[str]]:
    """The products that are told where numbers are not, and the words that say so."""
    products: list[Estimate] = []
    notes: list[str] = []
    names = list(problem.template.threads)
    said: set[str] = set()
    for m, k in enumerate(worn(problem.template)):
        thread = names[k]
        albedos = [_albedo_label(problem, m, c) for c in range(3)]
        group = [f"{thread} gv", f"{thread} kd"]
        if _joined(known, estimates, group, [*group, *albedos]):
            said |= {*group, *albedos}
            _say(
                products, notes, estimates, f"{thread} gv, kd and A", group,
                [_volume(problem, known, m, c) for c in range(3)], albedos,
                level_formula(problem.template.model_of(problem.template.thread_list[k])),
            )  # fmt: skip
        group = [f"{thread} eta", f"{thread} gs"]
        if _joined(known, estimates, group, group):
            said |= set(group)
            _say(
                products, notes, estimates, f"{thread} eta and gs", group,
                [_highlight(problem, known, thread)], [f"{thread} gs"], HIGHLIGHT,
            )  # fmt: skip
    labels = known.curvature.labels
    correlation = known.curvature.correlation
    for i in range(len(labels)):
        for j in range(i):
            if abs(correlation[i, j]) > CORRELATED and not {labels[i], labels[j]} <= said:
                notes.append(
                    f"{labels[j]} and {labels[i]} are hardly told apart "
                    f"(correlation {correlation[i, j]:.2f})"
                )
    return products, notes


def _joined(
    known: Known, estimates: dict[str, Estimate], group: list[str], others: list[str]
) -> bool:
    """Whether numbers of a group are not told from others: by correlation, or by wide intervals."""
    labels = known.curvature.labels
    correlation = np.abs(known.curvature.correlation)
    own = [labels.index(name) for name in group]
    all_ = [labels.index(name) for name in others]
    return (
        max(float(correlation[i, j]) for i in own for j in all_ if i != j) > CORRELATED
        or max(estimates[name].spread for name in group) > WIDE
        or any(estimates[name].open_low or estimates[name].open_high for name in group)
    )


def _say(
    products: list[Estimate], notes: list[str], estimates: dict[str, Estimate], what: str,
    group: list[str], told: list[Estimate], instead_of: list[str], formula: str,
) -> None:  # fmt: skip
    """Add the products, if they are told better than what they stand for, and the words."""
    fits = " and ".join(
        f"{name.rpartition(' ')[2]} from {e.low:.3g} to {e.high:.3g} {e.unit}".rstrip()
        for name, e in ((name, estimates[name]) for name in group)
    )
    better = [
        p.spread < TELLING * estimates[name].spread
        for p, name in zip(told, instead_of, strict=True)
        if p.value > 0
    ]
    if better and all(better):
        products += told
        notes.append(
            f"{what} cannot be told apart by these wraps: {fits} all fit; their product can, "
            f"{formula}"
        )
    else:
        notes.append(f"{what} are hardly told apart by these wraps: {fits} all fit")


def _volume(problem: Problem, known: Known, m: int, c: int) -> Estimate:
    """A of one channel times `volume_level`."""
    k = worn(problem.template)[m]
    thread = list(problem.template.threads)[k]
    model = problem.template.model_of(problem.template.thread_list[k])
    labels = [n.label for n in problem.names]
    at = [labels.index(f"{thread} {what}") for what in ("gv", "kd")]

    def value(x: Floats, linear: Linear) -> float:
        return float(linear.albedo[m, c]) * volume_level(model, float(x[at[0]]), float(x[at[1]]))

    slopes = _slopes(problem, known, at, value)
    slopes[_albedo_label(problem, m, c)] = volume_level(
        model, float(known.best.x[at[0]]), float(known.best.x[at[1]])
    )
    label = f"{thread} {level_formula(model)} {CHANNELS[c]}"
    return _told(known, label, value, slopes)


HIGHLIGHT = "((eta - 1)/(eta + 1))^2/gs"
"""The surface's light on the mirror's cone, near face on and but for a factor."""


def _highlight(problem: Problem, known: Known, thread: str) -> Estimate:
    """HIGHLIGHT of a thread [1/degree]."""
    labels = [n.label for n in problem.names]
    at = [labels.index(f"{thread} {what}") for what in ("eta", "gs")]

    def value(x: Floats, linear: Linear) -> float:
        ior, width = (float(x[i]) / problem.names[i].scale for i in at)
        return float(((ior - 1.0) / (ior + 1.0)) ** 2 / width)

    slopes = _slopes(problem, known, at, value)
    return replace(_told(known, f"{thread} {HIGHLIGHT}", value, slopes), unit="1/degree")


def _slopes(
    problem: Problem, known: Known, at: list[int], value: Callable[[Floats, Linear], float]
) -> dict[str, float]:
    """Label -> derivative of `value` by the numbers `at`."""
    found = {}
    for i in at:
        step = 1e-4 * float(problem.steps[i])
        up, down = known.best.x.copy(), known.best.x.copy()
        up[i], down[i] = up[i] + step, down[i] - step
        rise = value(up, known.linear) - value(down, known.linear)
        found[problem.names[i].label] = rise / (2 * step)
    return found
