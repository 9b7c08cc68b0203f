"""The command: the quick charts, whole."""

from __future__ import annotations

import json

import pytest

from fabricusd.chart.panels.registry import PANELS
from fabricusd.cli.main import main


@pytest.mark.exhaustive
@pytest.mark.slow
def test_the_quick_chart_is_whole(capsys, tmp_path):
    assert main(["chart", "-o", str(tmp_path / "charts"), "--quick", "-q"]) == 0
    content = json.loads((tmp_path / "charts" / "charts.json").read_text())
    page = (tmp_path / "charts" / "charts.md").read_text()
    assert set(content["panels"]) == {panel.name for panel in PANELS}
    for panel in PANELS:
        rows = content["panels"][panel.name]["rows"]
        assert any(row["on_front"] for row in rows)
        assert all(row["cost"] >= 0 and row["error"] >= 0 for row in rows)
        assert f"(charts/{panel.name}.md)" in page
        one = (tmp_path / "charts" / "charts" / f"{panel.name}.md").read_text()
        assert f"](../{panel.name}.png)" in one
        for suffix in (".png", ".svg"):
            assert (tmp_path / "charts" / f"{panel.name}{suffix}").stat().st_size > 1000


@pytest.mark.parametrize(
    "arguments",
    [["chart"], ["chart", "-o", "x", "--panel", "nothing"], ["chart", "-o", "x", "--sheet", "no"]],
)
def test_bad_arguments_write_nothing(arguments, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert not list(tmp_path.iterdir())
    assert capsys.readouterr().err.startswith("fabricusd: ")
