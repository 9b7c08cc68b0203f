"""Panels of a chart: rows of method, cost and error, and which of the methods are dominated."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Row:
    """The measurement of one method.

    group : what it was measured on; only rows of one group are compared
    cost, error : in the units of the panel's axes
    cost_spread, error_spread : half the range between the quartiles over repeats
    figures : further numbers, by name
    dominated_by : a method of the same group that is cheaper and more accurate; "" on the front
    """

    group: str
    method: str
    cost: float
    error: float
    cost_spread: float = 0.0
    error_spread: float = 0.0
    figures: dict[str, float] = field(default_factory=dict)
    dominated_by: str = ""

    @property
    def on_front(self) -> bool:
        """Whether no method of the group beats it by more than their spreads."""
        return not self.dominated_by

    def as_dict(self) -> dict[str, Any]:
        """Flat, for CSV and JSON."""
        return {
            "group": self.group,
            "method": self.method,
            "cost": self.cost,
            "cost_spread": self.cost_spread,
            "error": self.error,
            "error_spread": self.error_spread,
            "on_front": self.on_front,
            "dominated_by": self.dominated_by,
            **self.figures,
        }


@dataclass(frozen=True, kw_only=True)
class Panel:
    """One chart.

    cost, error : labels of the axes, with units
    about : what is measured and against which reference, in a sentence or two
    run : quick -> all rows; `measure` marks the dominated ones
    draw : (figure, rows) -> None, for a panel that the usual scatter plot does not suit
    """

    name: str
    title: str
    cost: str
    error: str
    about: str
    run: Callable[[bool], list[Row]]
    draw: Callable[[Any, Sequence[Row]], None] | None = None


def measure(panel: Panel, quick: bool) -> list[Row]:
    """The panel's rows, the dominated ones marked, cheapest first within each group."""
    rows = panel.run(quick)
    found: list[Row] = []
    for group in dict.fromkeys(row.group for row in rows):
        found += mark(sorted((r for r in rows if r.group == group), key=lambda r: r.cost))
    return found


def mark(rows: Sequence[Row]) -> list[Row]:
    """Rows of one group with `dominated_by` filled in.

    A method is dominated by another that costs no more and errs no more, and that is better in
    either by more than both spreads together. A difference within the noise does not count.
    """
    return [replace(row, dominated_by=_rival(row, rows)) for row in rows]


def _rival(row: Row, rows: Sequence[Row]) -> str:
    better = [
        r
        for r in rows
        if r.cost <= row.cost
        and r.error <= row.error
        and (
            row.cost - r.cost > row.cost_spread + r.cost_spread
            or row.error - r.error > row.error_spread + r.error_spread
        )
    ]
    # Of several, take the one with the smallest product of cost and error.
    return (
        min(better, key=lambda r: (r.cost * max(r.error, 1e-300), r.cost)).method if better else ""
    )


def relative_costs(rows: Sequence[Row]) -> list[float]:
    """Cost of each row, relative to the cheapest row of its group."""
    least: dict[str, float] = {}
    for row in rows:
        least[row.group] = min(row.cost, least.get(row.group, math.inf))
    return [row.cost / least[row.group] if least[row.group] > 0 else 1.0 for row in rows]
