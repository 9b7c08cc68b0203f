"""Panel: surface laws against explicit threads."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numba
import numpy as np

from fabricusd.appearance import laws, surface
from fabricusd.chart.panel import Panel, Row
from fabricusd.chart.timing import in_turns, typical
from fabricusd.geometry.judge import judge
from fabricusd.geometry.tables import PAIRS, table
from fabricusd.schema import load

PRESETS = ("linen_plain", "silk_crepe_de_chine", "polyester_satin_charmeuse", "silk_shot")
QUICK_PRESETS = PRESETS[::2]

SHADOWS = ("horizon", "none")


def run(quick: bool) -> list[Row]:
    """A group of rows for each preset: every law, with and without a shadow."""
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        return [row for name in (QUICK_PRESETS if quick else PRESETS) for row in _rows(name, quick)]
    finally:
        numba.set_num_threads(before)


def _rows(name: str, quick: bool) -> list[Row]:
    found, preset = table(name), load(name)
    copies = 10 if quick else 100
    wi, wo = (np.tile(w, (copies, 1)).astype(np.float64) for w in (found.wi, found.wo))
    runs, errors = {}, {}
    for law, one in laws.REGISTRY.items():
        fabric = replace(preset, surface_law=law)
        # The law `masked` holds its shadow in its mask.
        for shadow in SHADOWS if one.absolute else SHADOWS[1:]:
            method = f"{law}, {shadow}" if one.absolute else law
            value = surface.evaluate(fabric, found.wi, found.wo, shadow=shadow)
            errors[method] = judge(found, value)
            runs[method] = partial(surface.evaluate, fabric, wi, wo, shadow=shadow)
    rows = []
    for method, seconds in in_turns(runs, 3 if quick else 7).items():
        cost, spread = typical(np.array(seconds) / len(wi) * 1e9)
        rows.append(
            Row(
                group=name, method=method, cost=cost, cost_spread=spread,
                error=errors[method].error, error_spread=errors[method].noise,
                figures={"delta_e": errors[method].delta_e, "bias": errors[method].bias},
            )
        )  # fmt: skip
    return rows


PANEL = Panel(
    name="laws",
    title="Surface laws",
    cost="ns an evaluation, one worker",
    error="mean error over mean value, against traced threads",
    about=(
        f"Level `far` of the preset under each law, on the third of {PAIRS} pairs of directions "
        "that nothing is fitted to. The reference is the repeat as tubes, traced; what it says is "
        "itself uncertain by .05 to .4, see docs/geometry.md. `horizon` is the mean of that "
        "shadow, which laws that do not mask need."
    ),
    run=run,
)
