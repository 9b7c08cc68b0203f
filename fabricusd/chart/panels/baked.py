"""Panels: error of baked BTFs against their size, and against the time to bake them."""

from __future__ import annotations

import tempfile
import time
from functools import lru_cache
from pathlib import Path

from fabricusd.bake.btf.write import FORMS, write_btf
from fabricusd.chart.panel import Panel, Row
from fabricusd.chart.timing import typical
from fabricusd.schema import load

PRESETS = ("linen_plain", "polyester_satin_charmeuse")
BOUNDS = (4.0, 1.0, 0.5)
QUICK_BOUNDS = (4.0, 1.0)
QUICK_FORMS = ("factored", "ubo-joint")


@lru_cache(maxsize=2)
def bakes(quick: bool) -> tuple[Row, ...]:
    """A row for each preset, form and bound; its cost is the size in megabytes."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for preset in PRESETS[:1] if quick else PRESETS:
            for form in QUICK_FORMS if quick else FORMS:
                for bound in QUICK_BOUNDS if quick else BOUNDS:
                    rows.append(_bake(Path(name), preset, form, bound, quick))
    return tuple(rows)


def _bake(folder: Path, preset: str, form: str, bound: float, quick: bool) -> Row:
    fabric, seconds = load(preset), []
    for _ in range(1 if quick else 2):
        start = time.process_time()
        record = write_btf(fabric, folder, (form,), max_error=bound, per_thread=4 if quick else 8)[
            0
        ]
        seconds.append(time.process_time() - start)
    taken, spread = typical(seconds)
    return Row(
        group=preset,
        method=f"{form}, --max-error {bound:g}",
        cost=record["megabytes"],
        error=record["delta_e_between"],
        figures={
            "seconds": taken,
            "seconds_spread": spread,
            "delta_e_on_table": record["delta_e"],
            "rank": float(max(record["rank"])),
        },
    )


def by_time(quick: bool) -> list[Row]:
    """The same rows; their cost is the time in seconds."""
    return [
        Row(
            group=row.group, method=row.method, cost=row.figures["seconds"],
            cost_spread=row.figures["seconds_spread"], error=row.error,
            figures={"megabytes": row.cost},
        )
        for row in bakes(quick)
    ]  # fmt: skip


_ABOUT = (
    "Each form holds the BTF of one repeat, for 151 directions, with the rank that the bound "
    "chooses. "
    "The error is the mean delta E 2000 against level `weave` at places and directions between "
    "those of the table, so it includes the interpolation. The spacing of the table's directions "
    "limits it, whatever the rank."
)

PANELS = (
    Panel(
        name="baked-size",
        title="Baked forms: size",
        cost="megabytes",
        error="mean delta E 2000",
        about=_ABOUT,
        run=lambda quick: list(bakes(quick)),
    ),
    Panel(
        name="baked-time",
        title="Baked forms: time",
        cost="processor seconds",
        error="mean delta E 2000",
        about="This panel shows the same bakes by the time they take, including the time for the "
        "table.",
        run=by_time,
    ),
)
