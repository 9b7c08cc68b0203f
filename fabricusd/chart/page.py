"""The pages of charts: what to choose, and for each panel its picture and its front."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from fabricusd.chart.advice import Advice, advice, bounds_of
from fabricusd.chart.bounds_page import bounds_page
from fabricusd.chart.figures import Charts
from fabricusd.chart.panel import Panel, Row, relative_costs
from fabricusd.chart.words import number

BOUNDS, SHEETS = "max-error", "thesis"
"""Names of the pages that are no panel's."""

LONG = 60
"""Rows of a front beyond which each group gets one line."""


@dataclass(frozen=True, kw_only=True)
class Pages:
    """What the pages are made of.

    sheets : name -> caption; notes : name of a panel -> what a reader must know of its figures
    folder : of the panels' pages, seen from the first page; images, deeper : of the pictures, seen
        from the first page and from the panels' pages
    command : that measures and writes all of it
    """

    charts: Charts
    sheets: Mapping[str, str] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    folder: str = "charts/"
    images: str = ""
    deeper: str = "../"
    command: str = "fabricusd chart"

    def texts(self) -> dict[str, str]:
        """Name of each page -> its text; the first page is named ""."""
        found = {"": self._first(), BOUNDS: bounds_page()}
        for name, (panel, rows) in self.charts.items():
            found[name] = self._panel(name, panel, rows)
        if self.sheets:
            found[SHEETS] = self._sheets()
        return found

    def _first(self) -> str:
        lines = [
            "# Speed against accuracy\n",
            "## What to choose\n",
            "For each question and each bound on the error: the method that is the cheapest within "
            "the bound on most of what was measured. *Cost* is its median cost over that of the "
            "cheapest method, which may err more. *Holds on* counts where it is the choice, out of "
            "where any method meets the bound.\n",
            "| question | error at most | choose | cost | holds on |",
            "|---|---:|---|---:|---|",
        ]
        for name, (panel, rows) in self.charts.items():
            link, last = f"[{panel.title}]({self.folder}{name}.md)", None
            for one in advice(rows, bounds_of(panel.error)):
                title = "" if one.case == last else ", ".join(filter(None, (link, one.case)))
                lines.append(_choice(title, one))
                last = one.case
        lines += [
            "",
            f"`fabricusd render --max-error` chooses by itself: [what it takes]({self.folder}"
            f"{BOUNDS}.md) for each preset and bound.\n",
            "## The fronts\n",
            "Each page shows its methods in a picture, and those on the front in a table: methods "
            "that no other dominates. A method is dominated when another is no dearer and no "
            "worse, and is better in cost or error by more than both spreads. The dominated ones "
            "are in the JSON beside the pictures.\n",
        ]
        for name, (panel, _) in self.charts.items():
            lines.append(f"- [{panel.title}]({self.folder}{name}.md): {_lower(panel.error)}")
        if self.sheets:
            lines.append(f"- [The thesis's pictures]({self.folder}{SHEETS}.md), remade")
        lines += [
            "",
            f"`{self.command}` measures all of it, in one process on one machine, in turns, and "
            "writes these pages. Costs are multiples of the cheapest method's, because only ratios "
            "carry over to other machines; `charts.csv` and `charts.json` hold the absolute ones. "
            "With `--from charts.json` the pages are written from figures that were measured "
            "before.\n",
        ]
        return "\n".join(lines)

    def _panel(self, name: str, panel: Panel, rows: Sequence[Row]) -> str:
        # The text of a panel links to pages beside the first one.
        about = re.sub(r"\]\((\w+\.md)", r"](../\1", panel.about)
        lines = [
            f"# {panel.title}\n",
            f"![{panel.title}]({self.deeper}{name}.png)\n",
            *([f"**{self.notes[name]}**\n"] if name in self.notes else []),
            f"{about}\n",
            f"Cost: {panel.cost}, over that of the cheapest method. Error: {panel.error}. The "
            "figure after ± is half the range between the quartiles over repeats.\n",
            "## The front\n",
            *_front(rows),
        ]
        beaten = sum(not row.on_front for row in rows)
        if beaten:
            lines.append(
                f"\n{beaten} dominated methods: "
                f"[{name}.dominated.json]({self.deeper}{name}.dominated.json)."
            )
        return "\n".join([*lines, ""])

    def _sheets(self) -> str:
        lines = ["# The thesis's pictures\n"]
        for name, about in self.sheets.items():
            lines += [f"{about}.\n", f"![{name}]({self.deeper}{name}.png)\n"]
        return "\n".join(lines)


def _choice(title: str, one: Advice) -> str:
    return (
        f"| {title} | {one.bound:g} | {one.method} | {number(one.cost)}× | "
        f"{one.chosen} of {one.within}"
        + (f"; {one.groups - one.within} never" if one.within < one.groups else "")
        + " |"
    )


def _front(rows: Sequence[Row]) -> list[str]:
    """The front as a table, in which a group is a line where there are many."""
    on = [(row, cost) for row, cost in zip(rows, relative_costs(rows), strict=True) if row.on_front]
    if len(on) > LONG:
        groups: dict[str, list[str]] = {}
        for row, cost in on:
            said = f"{row.method} ({number(cost)}×, {number(row.error)})"
            groups.setdefault(row.group, []).append(said)
        return [
            "| measured on | methods on the front (cost, error) |",
            "|---|---|",
            *(f"| {group} | {'; '.join(methods)} |" for group, methods in groups.items()),
        ]
    lines = ["| measured on | method | cost | error |", "|---|---|---|---|"]
    last = ""
    for row, cost in on:
        spread = row.cost_spread / row.cost * cost if row.cost else 0.0
        group = "" if row.group == last else row.group
        last = row.group
        lines.append(
            f"| {group} | {row.method} | {number(cost)} ± {number(spread)} "
            f"| {number(row.error)} ± {number(row.error_spread)} |"
        )
    return lines


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:]
