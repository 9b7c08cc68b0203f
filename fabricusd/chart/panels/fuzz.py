"""Panel: the fuzz of hairy threads, against fibres that stand off tubes."""

from __future__ import annotations

from functools import lru_cache, partial

import numba
import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import surface
from fabricusd.appearance.fuzz import bald
from fabricusd.chart.panel import Panel, Row
from fabricusd.chart.timing import in_turns, typical
from fabricusd.geometry import fibres, paths, tubes
from fabricusd.schema import load

Floats = NDArray[np.float64]

PRESETS = ("denim", "cotton_poplin", "chambray", "worsted_twill")
QUICK_PRESETS = PRESETS[:1]

GRAZING = 60.0
"""Angle of the view from the normal that parts the groups [degrees]."""
STEEPEST = 82.0

THREADS = (24, 24)
PAIRS, PATHS, QUICK_PATHS = 160, 1 << 14, 1 << 11


def run(quick: bool) -> list[Row]:
    """Groups of rows for each preset: views from above, and grazing ones."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        names = QUICK_PRESETS if quick else PRESETS
        return [row for n in names for part in (0, 1) for row in _rows(n, part, quick)]
    finally:
        numba.set_num_threads(before)


@lru_cache(maxsize=8)
def measured(name: str, count: int) -> tuple[Floats, Floats, Floats, Floats]:
    """(wi, wo, radiance, its standard error), each (PAIRS, 3), of tubes with fibres."""
    rng = np.random.default_rng(3)
    wi, wo = (_directions(rng) for _ in range(2))
    found = fibres.reflectance(fibres.hairy_tubes(load(name), THREADS), wo, wi, count=count)
    return wi, wo, found.value, found.error


def without_fibres(name: str, count: int) -> Floats:
    """(PAIRS, 3) radiance of the same tubes without fibres."""
    wi, wo, _, _ = measured(name, count)
    return paths.reflectance(tubes(bald(load(name))), wo, wi, count=count).value


def _directions(rng: np.random.Generator) -> Floats:
    theta, phi = np.radians(rng.uniform(0, STEEPEST, PAIRS)), rng.uniform(0, 2 * np.pi, PAIRS)
    return np.stack(
        (np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), axis=-1
    )


def _rows(name: str, part: int, quick: bool) -> list[Row]:
    count = QUICK_PATHS if quick else PATHS
    wi, wo, true, noise = measured(name, count)
    chosen = (wo[:, 2] < np.cos(np.radians(GRAZING))) == bool(part)
    hairy = load(name)
    copies = 10 if quick else 100
    many_i, many_o = (np.tile(w, (copies, 1)) for w in (wi, wo))
    fabrics = {"fuzz": hairy, "none": bald(hairy)}
    runs = {
        method: partial(surface.evaluate, fabric, many_i, many_o)
        for method, fabric in fabrics.items()
    }
    group = f"{name}, views {'beyond' if part else 'up to'} {GRAZING:.0f} degrees"
    scale = true[chosen].mean()
    rows = []
    for method, seconds in in_turns(runs, 3 if quick else 7).items():
        cost, spread = typical(np.array(seconds) / len(many_i) * 1e9)
        miss = (surface.evaluate(fabrics[method], wi, wo) - true)[chosen]
        rows.append(
            Row(
                group=group, method=method, cost=cost, cost_spread=spread,
                error=float(np.abs(miss).mean() / scale),
                error_spread=float(noise[chosen].mean() / scale),
                figures={"bias": float(miss.mean() / scale)},
            )
        )  # fmt: skip
    return rows


PANEL = Panel(
    name="fuzz",
    title="Fuzz of hairy threads",
    cost="ns an evaluation, one worker",
    error="mean error over mean value, against tubes with fibres",
    about=(
        f"Level `far` of hairy presets, with fuzz and without, for {PAIRS} pairs of directions up "
        f"to {STEEPEST:.0f} degrees. The reference is the repeat as tubes from which straight "
        "fibres stand, traced with all bounces; `error_spread` is its noise. The error contains "
        "that of the law for cloth without fibres, see docs/fuzz.md."
    ),
    run=run,
)
