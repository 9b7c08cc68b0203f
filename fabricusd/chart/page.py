"""Writing panels as CSV, JSON and Markdown."""

from __future__ import annotations

import csv
import json
import math
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path

import fabricusd
from fabricusd.appearance.weave.footprint import DEFAULT
from fabricusd.chart.panel import Panel, Row, relative_costs
from fabricusd.files import whole_file
from fabricusd.reference.choice import BOUNDS as LEVEL_BOUNDS
from fabricusd.reference.choice import cheapest, choose_limits, read_limits, read_table

Charts = Mapping[str, tuple[Panel, Sequence[Row]]]


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """One line a row; further figures are columns of their own."""
    lines = [
        {**row.as_dict(), "relative_cost": relative}
        for row, relative in zip(rows, relative_costs(rows), strict=True)
    ]
    names = list(dict.fromkeys(name for line in lines for name in line))
    with whole_file(path) as temporary, temporary.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, names)
        writer.writeheader()
        writer.writerows(lines)


def write_json(path: Path, charts: Charts, seconds: float, quick: bool) -> None:
    """Write every panel with its axes and rows, and the software and machine of the measurement."""
    content = {
        "software": f"fabricusd {fabricusd.__version__}",
        "python": platform.python_version(),
        "machine": platform.machine(),
        "seconds": round(seconds, 1),
        "quick": quick,
        "panels": {
            name: {
                "title": panel.title,
                "cost": panel.cost,
                "error": panel.error,
                "rows": [row.as_dict() for row in rows],
            }
            for name, (panel, rows) in charts.items()
        },
    }
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")


def markdown(charts: Charts, sheets: Mapping[str, str], images: str, command: str) -> str:
    """The page: for each panel a picture, the front, and the dominated methods; then the sheets."""
    parts = [
        "# Speed against accuracy\n",
        f"`{command}` makes this page. It runs every method in one process on one machine, in "
        "turns. The cost of a method is a multiple of the cost of the cheapest method in its "
        "group. The figure after ± is half the range between the quartiles over repeats. A method "
        "is dominated when another method is no dearer and no worse, and is better in cost or "
        "error by more than both spreads. `charts.csv` and `charts.json` hold every figure, "
        "including absolute costs.\n",
        "## What --max-error takes\n",
        *_choices(),
        *_limits(),
    ]
    for name, (panel, rows) in charts.items():
        parts += [
            f"## {panel.title}\n",
            f"{panel.about}\n",
            f"Cost: {panel.cost}. Error: {panel.error}.\n",
            f"![{panel.title}]({images}{name}.png)\n",
            *_tables(rows),
        ]
    if sheets:
        parts.append("## The thesis's pictures\n")
    for name, about in sheets.items():
        parts += [f"{about}.\n", f"![{name}]({images}{name}.png)\n"]
    return "\n".join(parts)


def _tables(rows: Sequence[Row]) -> list[str]:
    """The rows of the front as a table, and the other rows as a list with a line per group."""
    relative = relative_costs(rows)
    lines = [
        "<details><summary>The front</summary>\n",
        "| measured on | method on the front | cost | error |",
        "|---|---|---|---|",
    ]
    beaten: dict[str, list[str]] = {}
    last = ""
    for row, cost in zip(rows, relative, strict=True):
        if row.on_front:
            spread = row.cost_spread / row.cost * cost if row.cost else 0.0
            group = "" if row.group == last else row.group
            last = row.group
            lines.append(
                f"| {group} | {row.method} | {number(cost)} ± {number(spread)} "
                f"| {number(row.error)} ± {number(row.error_spread)} |"
            )
        else:
            beaten.setdefault(row.group, []).append(f"{row.method} (by {row.dominated_by})")
    lines.append("\n</details>\n")
    if beaten:
        lines.append("<details><summary>Dominated</summary>\n")
        lines += [f"- {group}: {'; '.join(methods)}" for group, methods in beaten.items()]
        lines.append("\n</details>\n")
    return lines


BOUNDS = (1.0, 0.5, 0.3, 0.1, 0.05, 0.01)


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


def number(x: float) -> str:
    """Two significant digits, without an exponent for numbers of moderate size."""
    return (
        "0"
        if x == 0
        else f"{x:.2g}"
        if 1e-3 <= abs(x) < 100
        else f"{x:.0f}"
        if x >= 100
        else f"{x:.1e}"
    )
