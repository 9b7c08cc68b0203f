"""What a bound chooses, and that the shipped table is one to choose from."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import pytest

from fabricusd.chart.panels.shadows import WOVEN
from fabricusd.chart.scenes import one_cylinder
from fabricusd.cli.main import main
from fabricusd.errors import FabricError
from fabricusd.reference.choice import cheapest, choose_shadow, front_of, presets_in, read_table
from fabricusd.schema import load

FRONT = {"none": (10.0, 0.5), "horizon": (12.0, 0.1), "traced": (50.0, 0.01)}


@pytest.mark.parametrize(
    ("bound", "method"),
    [(1.0, "none"), (0.5, "none"), (0.49, "horizon"), (0.05, "traced"), (0.001, "traced")],
)
def test_the_cheapest_within_the_bound_is_taken_and_else_the_nearest(bound, method):
    assert cheapest(FRONT, bound).method == method


def test_the_reason_names_what_was_cheaper_and_what_is_missed():
    assert "none 0.5" in cheapest(FRONT, 0.2).why
    assert "no method is within 0.001" in cheapest(FRONT, 0.001).why


def test_cloth_that_is_no_preset_is_as_hard_as_the_hardest():
    front = front_of("", {"a": {"none": (1, 0.1)}, "b": {"none": (2, 0.05)}})
    assert front == {"none": (2, 0.1)}


@pytest.mark.parametrize("name", [*WOVEN, "velvet"])
def test_every_preset_has_a_front_and_its_choice_gets_nearer_with_the_bound(name):
    assert set(read_table()[name]) == {"none", "peak", "horizon", "traced"}
    errors = [choose_shadow([name], bound).error for bound in (1.0, 0.2, 0.05)]
    assert errors == sorted(errors, reverse=True)
    assert choose_shadow(["velvet"], 0.01).error == 0.0


def test_a_changed_preset_is_no_preset():
    fabric = load("linen_plain")
    assert presets_in(one_cylinder(fabric)) == ("linen_plain",)
    assert presets_in(one_cylinder(replace(fabric, masking_width=0.1))) == ("",)


def test_a_bound_or_a_table_that_is_none_is_refused(tmp_path):
    with pytest.raises(FabricError, match="above 0"):
        choose_shadow(["velvet"], 0.0)
    (tmp_path / "a.json").write_text(json.dumps({"shadows": [1]}))
    with pytest.raises(FabricError, match="not a table"):
        read_table(tmp_path / "a.json")


def test_a_dry_run_says_what_would_be_chosen_and_why(capsys, tmp_path):
    mesh = tmp_path / "square.obj"
    mesh.write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
    )
    out = str(tmp_path / "o.png")
    arguments = ["render", str(mesh), "--fabric", "velvet", "-o", out, "-n", "--max-error", "0.05"]
    assert main(arguments) == 0
    said = capsys.readouterr().err
    # On pile no method errs, and what `none` and `horizon` cost differs by the noise of a clock.
    assert re.search("shadow (none|horizon): error 0, 1 times the cheapest", said)
    assert "noise 0.05" in said
    assert not (tmp_path / "o.png").exists()
