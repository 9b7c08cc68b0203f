"""The page of what `render --max-error` takes, from the tables in use."""

from __future__ import annotations

import math

from fabricusd.appearance.weave.footprint import DEFAULT
from fabricusd.chart.words import number
from fabricusd.reference.choice import BOUNDS as LEVEL_BOUNDS
from fabricusd.reference.choice import cheapest, choose_limits, read_limits, read_table

BOUNDS = (1.0, 0.5, 0.3, 0.1, 0.05, 0.01)


def bounds_page() -> str:
    """The page, whole."""
    return "\n".join(["# What --max-error takes\n", *_choices(), *_limits()])


def _choices() -> list[str]:
    """The shadowing that each preset gets at some bounds, from the table in use."""
    table = read_table()
    lines = [
        "`fabricusd render --max-error` chooses the cheapest shadowing whose error is within the "
        "bound. If there is none, it chooses the one with the least error (*). In brackets: the "
        "cost over that of the cheapest method, and the error. "
        "`fabricusd chart --choice fabricusd/reference/choice.json` remakes the table. "
        "`fabricusd render -n` prints the choice and the reason.\n",
        "| preset | " + " | ".join(f"{b:g}" for b in BOUNDS) + " |",
        "|---|" + "---|" * len(BOUNDS),
    ]
    for name, front in table.items():
        least = min(cost for cost, _ in front.values())
        cells = []
        for bound in BOUNDS:
            c = cheapest(front, bound)
            star = "*" if c.error > bound else ""
            cells.append(f"{c.method}{star} ({number(c.cost / least)}×, {number(c.error)})")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def _limits() -> list[str]:
    """Where level `auto` changes for each preset at some bounds, from the table in use."""
    lines = [
        "The next table is for level `auto` with a bound. A cell holds two limits. `auto` uses "
        "`far` when a pixel spans at least as many repeats as the first limit, and `thread` when a "
        "thread spans at least as many pixels as the second limit. Between them it uses `weave`. "
        "At its limit and at every wider pixel, a level is within the bound of a filtered "
        "`thread`. This error is the rms over the pixels, over the cloth's mean, for the worst of "
        "three lights, without shadows. Without a bound, the levels change gradually around "
        f"{DEFAULT.repeats:g} / {DEFAULT.pixels:g}.\n",
        "| preset | " + " | ".join(f"{b:g}" for b in LEVEL_BOUNDS) + " |",
        "|---|" + "---|" * len(LEVEL_BOUNDS),
    ]
    for name in read_limits():
        found = [choose_limits([name], bound)[0] for bound in LEVEL_BOUNDS]
        cells = [
            f"{number(x.repeats) if x.repeats < math.inf else 'never'} / {number(x.pixels)}"
            for x in found
        ]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return [*lines, ""]
