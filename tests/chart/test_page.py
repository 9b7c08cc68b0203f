"""The pages: they are written from figures that were measured before, and each fits on a page."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from fabricusd.chart.advice import advice
from fabricusd.chart.figures import read_json, write_json
from fabricusd.chart.make import remake_pages
from fabricusd.chart.panels.registry import PANELS
from fabricusd.cli.main import main
from fabricusd.errors import FabricError
from tests.chart.test_panel import row

DOCS = Path(__file__).resolve().parents[2] / "docs"
MOST_WORDS = 2000


@pytest.fixture(scope="module")
def remade(tmp_path_factory):
    """The pages of the figures in docs, written elsewhere."""
    docs = tmp_path_factory.mktemp("docs")
    (docs / "images").mkdir()
    shutil.copytree(DOCS / "images" / "charts", docs / "images" / "charts")
    remake_pages(docs / "images" / "charts" / "charts.json", docs / "charts.md")
    return docs


def pages(docs: Path) -> dict[str, str]:
    found = [docs / "charts.md", *sorted((docs / "charts").glob("*.md"))]
    return {path.relative_to(docs).as_posix(): path.read_text("utf-8") for path in found}


def test_the_pages_in_docs_are_those_of_its_figures(remade):
    here, written = pages(DOCS), pages(remade)
    assert set(here) == set(written)
    # The command of the first page says where the figures lie.
    command = re.compile(r"`fabricusd chart -o [^`]*`")
    for name, text in written.items():
        assert command.sub("", here[name]) == command.sub("", text), name
    for path in (remade / "images" / "charts").glob("*.dominated.json"):
        assert (DOCS / "images" / "charts" / path.name).read_text() == path.read_text()


def test_no_page_is_long_and_every_link_leads_somewhere(remade):
    shutil.copy(DOCS / "blender.md", remade / "blender.md")
    for name, text in pages(remade).items():
        assert len(text.split()) <= MOST_WORDS, name
        for target in re.findall(r"\]\(([^)#]+)\)", text):
            assert ((remade / name).parent / target).exists(), (name, target)


def test_the_front_is_on_the_page_and_the_rest_in_json(remade):
    figures = json.loads((remade / "images" / "charts" / "charts.json").read_text())
    for name, panel in figures["panels"].items():
        text = (remade / "charts" / f"{name}.md").read_text()
        assert all(one["method"] in text for one in panel["rows"] if one["on_front"])
        beaten = [one for one in panel["rows"] if not one["on_front"]]
        path = remade / "images" / "charts" / f"{name}.dominated.json"
        assert (json.loads(path.read_text())["rows"] if path.exists() else []) == beaten


def test_figures_that_are_written_and_read_are_the_same(tmp_path):
    charts = {"zoom": (next(p for p in PANELS if p.name == "zoom"), [row("a", 1, 0.5, 0.1)])}
    write_json(tmp_path / "charts.json", charts, 1.0, True)
    assert read_json(tmp_path / "charts.json") == (charts, {})


@pytest.mark.parametrize(
    ("text", "words"),
    [("{", "figures of charts"), ('{"panels": {"no": {"rows": []}}}', "panel 'no' is unknown")],
)
def test_other_files_are_refused(text, words, tmp_path):
    (tmp_path / "charts.json").write_text(text)
    with pytest.raises(FabricError, match=words):
        remake_pages(tmp_path / "charts.json", tmp_path / "charts.md")
    assert not (tmp_path / "charts.md").exists()


def test_pages_of_old_figures_measure_nothing(tmp_path, capsys):
    assert main(["chart", "--from", "charts.json", "-o", str(tmp_path)]) == 2
    assert "--from" in capsys.readouterr().err


def test_the_choice_is_the_cheapest_within_the_bound_on_most_groups():
    rows = [
        row("fast", 1, 0.2), row("good", 2, 0.05), row("best", 9, 0.001),
        row("fast", 1, 0.2, group="h"), row("good", 4, 0.05, group="h"),
        row("fast", 5, 0.02, group="i"),
    ]  # fmt: skip
    found = [(a.bound, a.method, a.cost, a.chosen, a.within) for a in advice(rows, (1, 0.1, 0.01))]
    assert found == [(1, "fast", 1, 3, 3), (0.1, "good", 3, 2, 3), (0.01, "best", 9, 1, 1)]


def test_cases_are_told_apart_where_they_are_few():
    def rows(count: int):
        return [
            row(method, cost, 0.05, group=f"cloth, {case}")
            for case in range(count)
            for method, cost in (("a", 1 + case), ("b", 2))
        ]

    assert [(a.case, a.method) for a in advice(rows(3), (0.1,))] == [
        ("0", "a"), ("1", "a"), ("2", "b"),
    ]  # fmt: skip
    assert [a.case for a in advice(rows(9), (0.1,))] == [""]
