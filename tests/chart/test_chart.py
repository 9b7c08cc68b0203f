"""The command: the quick charts, whole, in time."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from fabricusd.chart.panels.registry import PANELS
from fabricusd.cli.main import main

SECONDS = 60.0
"""Of the processor: the quick chart stays below, kernels already compiled."""


def quick_chart(folder: Path) -> float:
    """Processor seconds of the command."""
    start = time.process_time()
    assert main(["chart", "-o", str(folder), "--quick", "-q"]) == 0
    return time.process_time() - start


@pytest.mark.exhaustive
@pytest.mark.slow
def test_the_quick_chart_is_whole_and_takes_less_than_a_minute(capsys, tmp_path):
    if quick_chart(tmp_path / "charts") > SECONDS:
        # It compiled kernels, which are on disk now.
        assert quick_chart(tmp_path / "again") < SECONDS
    content = json.loads((tmp_path / "charts" / "charts.json").read_text())
    page = (tmp_path / "charts" / "charts.md").read_text()
    assert set(content["panels"]) == {panel.name for panel in PANELS}
    for panel in PANELS:
        rows = content["panels"][panel.name]["rows"]
        assert any(row["on_front"] for row in rows)
        assert all(row["cost"] >= 0 and row["error"] >= 0 for row in rows)
        assert f"]({panel.name}.png)" in page
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
