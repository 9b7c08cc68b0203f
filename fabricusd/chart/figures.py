"""The figures of charts as CSV and JSON, and back."""

from __future__ import annotations

import csv
import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import fabricusd
from fabricusd.chart.panel import Panel, Row, relative_costs
from fabricusd.chart.panels.registry import PANELS
from fabricusd.errors import FabricError, reads
from fabricusd.files import readable_file, whole_file

Charts = Mapping[str, tuple[Panel, Sequence[Row]]]
"""Name of a panel -> the panel and its rows."""


def write_csv(path: Path, charts: Charts) -> None:
    """One line a row of each panel; further figures are columns of their own."""
    lines = [
        {"panel": name, **row.as_dict(), "relative_cost": relative}
        for name, (_, rows) in charts.items()
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
    _write(path, json.dumps(content, indent=1))


def write_dominated(path: Path, panel: Panel, rows: Sequence[Row]) -> None:
    """Write the methods of a panel that no page shows: those that another dominates."""
    beaten = [row.as_dict() for row in rows if not row.on_front]
    content = {"title": panel.title, "cost": panel.cost, "error": panel.error, "rows": beaten}
    _write(path, json.dumps(content, indent=1))


@reads("the figures of charts")
def read_json(path: Path) -> tuple[Charts, dict[str, str]]:
    """What `write_json` wrote: the charts, and the notes that their panels carry, by name.

    Raises FabricError for another file, and for a panel that is unknown.
    """
    content = json.loads(readable_file(path).read_text(encoding="utf-8"))
    known = {panel.name: panel for panel in PANELS}
    charts: dict[str, tuple[Panel, list[Row]]] = {}
    notes: dict[str, str] = {}
    for name, said in content["panels"].items():
        if name not in known:
            raise FabricError(
                f"{path} panel '{name}'", f"is unknown; it must be one of {', '.join(known)}"
            )
        charts[name] = (known[name], [_row(one) for one in said["rows"]])
        if "note" in said:
            notes[name] = said["note"]
    return charts, notes


def _row(said: dict[str, Any]) -> Row:
    """The inverse of `Row.as_dict`."""
    own = {f.name for f in fields(Row)} - {"figures"}
    figures = {k: v for k, v in said.items() if k not in own | {"on_front"}}
    return Row(**{k: v for k, v in said.items() if k in own}, figures=figures)


def _write(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
