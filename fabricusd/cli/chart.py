"""`fabricusd chart`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from fabricusd.errors import FabricError
from fabricusd.files import require_writable

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
    parser.add_argument("--stability", metavar="MD", help="where formulas fail, instead of charts")
    parser.add_argument(
        "--choice", metavar="JSON", help="make this machine's table that render --max-error reads"
    )
    parser.add_argument("--page", metavar="MD", help="write the page here instead")


def run(options: argparse.Namespace) -> int:
    """Measure; print the names of the files."""
    # Hours of measuring lie between here and the first file.
    for target in filter(None, (options.choice, options.stability, options.page)):
        require_writable(target)
    from fabricusd.chart.make import make_charts
    from fabricusd.chart.panels.registry import PANELS
    from fabricusd.chart.sheets import SHEETS

    if options.choice:
        from fabricusd.chart.choice import write_table

        write_table(Path(options.choice), options.quick)
        print(options.choice)
        return 0
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

    if options.stability:
        from fabricusd.chart.stability import write_stability

        Path(options.output).mkdir(parents=True, exist_ok=True)
        for path in write_stability(Path(options.stability), Path(options.output)):
            print(path)
        return 0
    page = Path(options.page) if options.page else None
    for path in make_charts(
        Path(options.output), quick=options.quick, names=options.panel, sheets=options.sheet,
        page=page, say=say,
    ):  # fmt: skip
        print(path)
    return 0
