"""Drawing panels. This needs matplotlib, which only the extra `docs` installs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fabricusd.chart.panel import Panel, Row
from fabricusd.errors import FabricError
from fabricusd.files import whole_file

COLUMNS = 3

WIDE, NARROW = 40.0, 6.0
"""Ratios of an axis's ends beyond which only powers of ten are written, and up to which all numbers
between them are; else PLAIN are."""

PLAIN = (2, 3, 5)


def pyplot() -> Any:
    """matplotlib's pyplot, without a display; raises FabricError if it is not installed."""
    try:
        import matplotlib
    except ImportError:
        raise FabricError(
            "matplotlib", "is not installed; to draw charts, run pip install 'fabricusd[docs]'"
        ) from None
    matplotlib.use("Agg")
    # Makes the same drawing produce the same file.
    matplotlib.rcParams["svg.hashsalt"] = "fabricusd"
    import matplotlib.pyplot

    return matplotlib.pyplot


def adjuster() -> Any:
    """The module adjustText, which the extra `docs` installs along with matplotlib."""
    try:
        import adjustText
    except ImportError:
        raise FabricError(
            "adjustText", "is not installed; to draw charts, run pip install 'fabricusd[docs]'"
        ) from None
    return adjustText


def draw_panel(panel: Panel, rows: Sequence[Row], stem: Path) -> list[Path]:
    """Draw a panel's rows as `<stem>.png` and `<stem>.svg`; return the files."""
    plt = pyplot()
    groups = list(dict.fromkeys(row.group for row in rows))
    lines = 2 if panel.draw else -(-len(groups) // COLUMNS)
    figure = plt.figure(figsize=(13, 0.6 + 3.6 * lines), layout="constrained")
    figure.suptitle(panel.title)
    if panel.draw:
        panel.draw(figure, rows)
    else:
        _scatter(figure, panel, rows, groups, lines)
    return save(figure, stem)


def save(figure: Any, stem: Path, suffixes: Sequence[str] = (".png", ".svg")) -> list[Path]:
    """Write a figure in each format, whole or not at all, and close it; return the files."""
    written = []
    for suffix in suffixes:
        path = stem.with_suffix(suffix)
        metadata = {"Date": None} if suffix == ".svg" else None
        with whole_file(path) as temporary:
            figure.savefig(temporary, dpi=90, metadata=metadata)
        written.append(path)
    pyplot().close(figure)
    return written


def _scatter(
    figure: Any, panel: Panel, rows: Sequence[Row], groups: Sequence[str], lines: int
) -> None:
    """Plot error against cost, logarithmic, one small plot per group, the front joined by lines."""
    plots = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
    names = []
    for axes, group in zip(plots, groups, strict=False):
        texts: list[Any] = []
        names.append((axes, texts))
        mine = [row for row in rows if row.group == group]
        for front, color in ((True, "C0"), (False, "0.65")):
            some = [row for row in mine if row.on_front == front]
            axes.errorbar(
                [r.cost for r in some], [max(r.error, 1e-9) for r in some],
                xerr=[r.cost_spread for r in some], yerr=[_below(r) for r in some],
                fmt="o", ms=4, lw=0.8, color=color,
            )  # fmt: skip
            for row in some:
                place, ink = (row.cost, max(row.error, 1e-9)), "k" if front else "0.45"
                texts.append(axes.text(*place, row.method, fontsize=6, color=ink))
        front_rows = sorted((r for r in mine if r.on_front), key=lambda r: r.cost)
        axes.step(
            [r.cost for r in front_rows], [max(r.error, 1e-9) for r in front_rows],
            where="post", lw=0.8,
        )  # fmt: skip
        axes.set(xscale="log", yscale="log", xlabel=panel.cost, ylabel=panel.error)
        axes.margins(x=0.25)
        _small_numbers(axes)
        axes.set_title(group, fontsize=8)
        axes.grid(alpha=0.3)
    for axes in plots[len(groups) :]:
        axes.set_axis_off()
    _part(figure, names)


def _small_numbers(axes: Any) -> None:
    """Write numbers between powers of ten plainly, small, and no more than there is room for."""
    low, high = axes.get_xlim()
    axes.xaxis.set_minor_formatter("{x:g}" if high <= WIDE * low else "")
    if high > NARROW * low:
        axes.xaxis.set_minor_locator(pyplot().LogLocator(subs=PLAIN))
    axes.tick_params(axis="x", which="minor", labelsize=6)


def _part(figure: Any, names: Sequence[tuple[Any, list[Any]]]) -> None:
    """Move the names in each plot apart and off the points, and draw lines to the points."""
    # The places of names on paper are known only once the layout of the plots is fixed, so freeze
    # the layout: the figure is drawn again for every plot.
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes, texts in names:
        adjuster().adjust_text(
            texts, ax=axes, expand=(1.05, 1.3), iter_lim=60,
            arrowprops={"arrowstyle": "-", "color": "0.7", "lw": 0.4},
        )  # fmt: skip


def _below(row: Row) -> float:
    # A bar down to 0 cannot be drawn on a logarithmic axis.
    return min(row.error_spread, 0.9 * max(row.error, 1e-9))
