"""`fabricusd chart`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

EPILOG = """writes charts.csv, charts.json, charts.md, and a PNG and an SVG of each panel into DIR;
sheets are the thesis's pictures remade, and part of a chart that is neither quick nor partial

example:
  fabricusd chart -o charts --quick
  fabricusd chart -o charts --panel zoom --panel shadows
  fabricusd chart -o charts --sheet cylinders"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where to, and how much."""
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for the charts")
    parser.add_argument("--quick", action="store_true", help="fewer presets, methods and repeats")
    parser.add_argument("--panel", action="append", metavar="NAME", help="this one alone, or these")
    parser.add_argument("--sheet", action="append", metavar="NAME", help="this sheet, or these")
    parser.add_argument("--list-panels", action="store_true", help="print their names and stop")
    parser.add_argument("--page", metavar="MD", help="write the page here instead")


def run(options: argparse.Namespace) -> int:
    """Measure; print the names of the files."""
    from fabricusd.chart.make import make_charts
    from fabricusd.chart.registry import PANELS
    from fabricusd.chart.sheets import SHEETS
    from fabricusd.errors import FabricError

    if options.list_panels:
        for panel in PANELS:
            print(f"{panel.name:12} {panel.title}")
        for name, (title, _) in SHEETS.items():
            print(f"{name:12} (sheet) {title}")
        return 0
    if not options.output:
        raise FabricError("chart", "needs -o DIR; see 'fabricusd chart --help'")

    def say(line: str) -> None:
        if not options.quiet:
            print(f"fabricusd: {line}", file=sys.stderr)

    page = Path(options.page) if options.page else None
    for path in make_charts(
        Path(options.output), quick=options.quick, names=options.panel, sheets=options.sheet,
        page=page, say=say,
    ):  # fmt: skip
        print(path)
    return 0
