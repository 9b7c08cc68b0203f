"""`fabricusd chart`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from fabricusd.errors import FabricError
from fabricusd.files import require_writable

EPILOG = """Writes charts.csv, charts.json, charts.md with a page for each panel, and a PNG and
an SVG of each panel into DIR.
Sheets remake the pictures of the thesis; they are left out with --quick and with --panel.

example:
  fabricusd chart -o charts --quick
  fabricusd chart -o charts --panel zoom --panel shadows
  fabricusd chart -o charts --sheet cylinders
  fabricusd chart --from docs/images/charts/charts.json --page docs/charts.md"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where to write, and what to measure."""
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for the charts (no default)")
    parser.add_argument(
        "--quick", action="store_true", help="measure fewer presets and methods, less often"
    )
    parser.add_argument(
        "--panel",
        action="append",
        metavar="NAME",
        help="measure only this panel (repeatable; default: all)",
    )
    parser.add_argument(
        "--sheet",
        action="append",
        metavar="NAME",
        help="draw only this sheet (repeatable; default: all)",
    )
    parser.add_argument(
        "--list-panels", action="store_true", help="list the panels and sheets, and exit"
    )
    parser.add_argument(
        "--stability",
        metavar="MD",
        help="write the page on where formulas fail instead (default: charts)",
    )
    parser.add_argument(
        "--choice",
        metavar="JSON",
        help="measure the table that render --max-error reads instead, on this machine (default: "
        "charts)",
    )
    parser.add_argument(
        "--page",
        metavar="MD",
        help="file for the first page; the others lie in a folder beside it (default: "
        "DIR/charts.md)",
    )
    parser.add_argument(
        "--from",
        dest="figures",
        metavar="JSON",
        help="write the pages from a charts.json that was measured before, and measure nothing "
        "(default: measure)",
    )


def run(options: argparse.Namespace) -> int:
    """Measure, and print the names of the files."""
    # Check now: measuring may take hours before the first file is written.
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
    if options.figures:
        from fabricusd.chart.make import remake_pages

        if options.output or options.quick or options.panel or options.sheet:
            raise FabricError("--from", "measures nothing; it takes --page alone")
        figures = Path(options.figures)
        for path in remake_pages(figures, Path(options.page or figures.with_name("charts.md"))):
            print(path)
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
