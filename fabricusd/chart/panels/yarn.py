"""Panel: uneven yarn, and what is lost by leaving it out."""

from __future__ import annotations

from functools import partial

import numba
import numpy as np

from fabricusd.appearance import surface
from fabricusd.appearance.weave.coverage import true_repeat
from fabricusd.chart.panel import Panel, Row
from fabricusd.chart.panels.reflectance import places
from fabricusd.chart.timing import in_turns, typical
from fabricusd.fabric import even
from fabricusd.schema import load

PRESETS = ("linen_plain", "polyester_satin_charmeuse", "silk_shot", "denim")
QUICK_PRESETS = PRESETS[:1]

REPEATS = 32
"""Repeats along each axis among which the places lie: a window that holds many threads."""

WI, WO = (0.48, 0.36, 0.8), (0.0, -0.28, 0.96)


def run(quick: bool) -> list[Row]:
    """A group of rows for each preset and level."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        names = QUICK_PRESETS if quick else PRESETS
        return [row for n in names for lv in ("weave", "thread") for row in _rows(n, lv, quick)]
    finally:
        numba.set_num_threads(before)


def _rows(name: str, level: str, quick: bool) -> list[Row]:
    uneven = load(name)
    uv = places(uneven, 2_000 if quick else 50_000)
    rng = np.random.default_rng(0)
    uv = uv + rng.integers(0, REPEATS, uv.shape) * np.array(true_repeat(uneven))
    wi = np.repeat([WI], len(uv), axis=0)
    runs = {
        method: partial(surface.evaluate, fabric, wi, WO, uv, level, "horizon")
        for method, fabric in (("even", even(uneven)), ("uneven", uneven))
    }
    values = {method: run() for method, run in runs.items()}
    true = values["uneven"]
    rows = []
    for method, seconds in in_turns(runs, 3 if quick else 7).items():
        cost, spread = typical(np.array(seconds) / len(uv) * 1e9)
        miss = values[method] - true
        rows.append(
            Row(
                group=f"{name}, {level}", method=method, cost=cost, cost_spread=spread,
                error=float(np.sqrt((miss * miss).mean()) / true.mean()),
                figures={"mean_off": float(miss.mean() / true.mean())},
            )
        )  # fmt: skip
    return rows


PANEL = Panel(
    name="yarn",
    title="Uneven yarn",
    cost="ns an evaluation with its lookup, one worker",
    error="rms difference over mean value",
    about=(
        f"Places spread over {REPEATS} by {REPEATS} repeats, one pair of directions, shadow "
        "`horizon`. The error is what even threads differ by, place by place; their mean is that "
        "of uneven ones (`mean_off`), so level `far` needs no unevenness."
    ),
    run=run,
)
