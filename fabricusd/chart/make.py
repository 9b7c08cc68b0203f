"""The work of the command `chart`: measure the panels, write tables, pictures and the page."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from fabricusd.chart.draw import adjuster, draw_panel, pyplot
from fabricusd.chart.figures import Charts, read_json, write_csv, write_dominated, write_json
from fabricusd.chart.page import Pages
from fabricusd.chart.panel import Panel, Row, measure
from fabricusd.chart.panels.registry import PANELS
from fabricusd.chart.sheets import SHEETS
from fabricusd.errors import FabricError
from fabricusd.files import whole_file


def chosen_panels(names: Sequence[str] | None) -> list[Panel]:
    """The panels of these names, or all panels; raises FabricError for an unknown name."""
    known = {panel.name: panel for panel in PANELS}
    for name in names or ():
        if name not in known:
            raise FabricError("--panel", f"is '{name}'; it must be one of {', '.join(known)}")
    return [known[name] for name in names or known]


def chosen_sheets(names: Sequence[str] | None, everything: bool) -> list[str]:
    """The sheets of these names; without names, all or none of them."""
    for name in names or ():
        if name not in SHEETS:
            raise FabricError("--sheet", f"is '{name}'; it must be one of {', '.join(SHEETS)}")
    return list(names or (SHEETS if everything else ()))


def make_charts(
    folder: Path,
    *,
    quick: bool = False,
    names: Sequence[str] | None = None,
    sheets: Sequence[str] | None = None,
    page: Path | None = None,
    say: Callable[[str], None] = lambda _line: None,
) -> list[Path]:
    """Write the figures, `charts.md` and its pages, a PNG and an SVG per panel, and the sheets.

    names, sheets : the panels and sheets to make; without either, all panels and, unless `quick`,
        all sheets
    page : file for the first page, if not `charts.md` in `folder`; the others are in a folder
        beside it, of its name. The pictures are in `folder` anyway

    Returns the files.
    """
    drawn = chosen_sheets(sheets, everything=not (quick or names))
    panels = [] if sheets and not names else chosen_panels(names)
    pyplot()
    adjuster()
    folder.mkdir(parents=True, exist_ok=True)
    begun = time.perf_counter()
    charts: dict[str, tuple[Panel, list[Row]]] = {}
    for panel in panels:
        start = time.perf_counter()
        charts[panel.name] = (panel, measure(panel, quick))
        say(f"{panel.name}: {time.perf_counter() - start:.0f} s")
    written = []
    for name in drawn:
        start = time.perf_counter()
        written += SHEETS[name][1](folder, quick)
        say(f"{name}: {time.perf_counter() - start:.0f} s")
    if charts:
        written += _write(folder, charts, drawn, page, quick, time.perf_counter() - begun)
    return written


def remake_pages(figures: Path, page: Path) -> list[Path]:
    """Write the pages again, from figures that were measured before; pictures stay as they are.

    figures : `charts.json` of that time, in the folder of its pictures

    Returns the files. Raises FabricError for a file that holds no such figures.
    """
    charts, notes = read_json(figures)
    folder = figures.parent
    drawn = [name for name in SHEETS if (folder / f"{name}.png").exists()]
    return _write_pages(folder, charts, drawn, page, quick=False, notes=notes)


def _write(
    folder: Path, charts: Charts, sheets: Sequence[str], page: Path | None, quick: bool,
    seconds: float,
) -> list[Path]:  # fmt: skip
    """Write the figures, the pictures and the pages."""
    written = [folder / "charts.csv", folder / "charts.json"]
    write_csv(written[0], charts)
    write_json(written[1], charts, seconds, quick)
    for name, (panel, rows) in charts.items():
        written += draw_panel(panel, rows, folder / name)
    return written + _write_pages(folder, charts, sheets, page, quick=quick)


def _write_pages(
    folder: Path, charts: Charts, sheets: Sequence[str], page: Path | None, *, quick: bool,
    notes: Mapping[str, str] | None = None,
) -> list[Path]:  # fmt: skip
    """Write the first page, the folder of the other pages beside it, and the dominated methods."""
    first = page or folder / "charts.md"
    others = first.with_suffix("")
    others.mkdir(parents=True, exist_ok=True)
    command = f"fabricusd chart -o {folder.as_posix()}" + (" --quick" if quick else "")
    if page is not None:
        command += f" --page {page.as_posix()}"
    written = []
    for name, (panel, rows) in charts.items():
        if any(not row.on_front for row in rows):
            written.append(folder / f"{name}.dominated.json")
            write_dominated(written[-1], panel, rows)
    pages = Pages(
        charts=charts, sheets={name: SHEETS[name][0] for name in sheets}, notes=notes or {},
        folder=f"{others.name}/", images=_towards(folder, first.parent),
        deeper=_towards(folder, others), command=command,
    )  # fmt: skip
    for name, text in pages.texts().items():
        written.append(others / f"{name}.md" if name else first)
        with whole_file(written[-1]) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return written


def _towards(folder: Path, page: Path) -> str:
    """The folder as a link in a page of the folder `page`."""
    way = Path(os.path.relpath(folder, page)).as_posix()
    return "" if way == "." else f"{way}/"
