"""Rows, fronts, and what the page makes of them."""

from __future__ import annotations

import csv

from fabricusd.chart.figures import write_csv
from fabricusd.chart.panel import Panel, Row, mark, measure, relative_costs


def row(method: str, cost: float, error: float, spread: float = 0.0, group: str = "g") -> Row:
    return Row(
        group=group, method=method, cost=cost, error=error, cost_spread=spread, error_spread=0.0
    )


def rivals(*rows: Row) -> dict[str, str]:
    return {r.method: r.dominated_by for r in mark(rows)}


def test_what_is_dearer_and_worse_is_dominated_and_its_rival_named():
    found = rivals(row("cheap", 1, 0.5), row("good", 2, 0.1), row("bad", 3, 0.2))
    assert found == {"cheap": "", "good": "", "bad": "good"}


def test_what_differs_by_less_than_the_spreads_stays_on_the_front():
    assert rivals(row("a", 1.0, 0.1, 0.1), row("b", 1.15, 0.1, 0.1)) == {"a": "", "b": ""}
    assert rivals(row("a", 1.0, 0.1, 0.1), row("b", 1.25, 0.1, 0.1)) == {"a": "", "b": "a"}


def test_equal_rows_do_not_dominate_each_other():
    assert rivals(row("a", 1, 1), row("b", 1, 1)) == {"a": "", "b": ""}


def test_groups_are_judged_apart():
    rows = [row("slow", 9, 0.5, group="h"), row("fast", 1, 0.1), row("slow", 2, 0.5)]
    panel = Panel(name="p", title="P", cost="s", error="e", about="", run=lambda _quick: rows)
    found = [(r.group, r.method, r.dominated_by) for r in measure(panel, True)]
    assert found == [("h", "slow", ""), ("g", "fast", ""), ("g", "slow", "fast")]
    assert relative_costs(rows) == [1.0, 1.0, 2.0]


def panel_of(name: str, *rows: Row) -> tuple[Panel, list[Row]]:
    made = list(rows)
    return Panel(name=name, title="", cost="s", error="e", about="", run=lambda _: made), made


def written(path, *panels: tuple[Panel, list[Row]]) -> list[dict[str, str]]:
    write_csv(path, {panel.name: (panel, rows) for panel, rows in panels})
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_further_figures_are_columns(tmp_path):
    one = Row(group="g", method="m", cost=1, error=1, figures={"megabytes": 3.0})
    lines = written(tmp_path / "a.csv", panel_of("p", row("n", 2, 1), one))
    assert [line["megabytes"] for line in lines] == ["", "3.0"]
    assert [line["relative_cost"] for line in lines] == ["2.0", "1.0"]


def test_groups_of_the_same_name_in_two_panels_are_apart(tmp_path):
    panels = panel_of("p", row("n", 2, 1)), panel_of("q", row("m", 1, 1))
    lines = written(tmp_path / "a.csv", *panels)
    assert [line["panel"] for line in lines] == ["p", "q"]
    assert [line["relative_cost"] for line in lines] == ["1.0", "1.0"]
