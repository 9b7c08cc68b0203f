"""Colours in `new`, `set` and `cat`."""

from __future__ import annotations

import json

import pytest

from fabricusd import load
from fabricusd.cli.main import main


def new(tmp_path, *options: str):
    path = tmp_path / "cloth.usda"
    assert main(["new", "--weave", "plain", *options, "-o", str(path)]) == 0
    return path


def test_new_makes_conserving_cloth_that_remembers_its_colour(tmp_path, capsys):
    path = new(tmp_path, "--warp-color", "lab(50, 20, -30)", "--weft-color", "#e0e0e0")
    fabric = load(path)
    assert fabric.model == "conserving"
    assert [t.target_basis for t in fabric.thread_list] == ["opaque", "opaque"]
    assert main(["check", "--strict", str(path)]) == 0
    capsys.readouterr()
    assert main(["cat", str(path), "--no-draft"]) == 0
    told = capsys.readouterr().out
    assert told.count("delta E 2000 0.00") == 2
    assert "mixed, #" in told
    assert main(["cat", str(path), "--json"]) == 0
    target = json.loads(capsys.readouterr().out)["threads"]["Color1"]["target"]
    assert target["reached"] == pytest.approx(target["color"], abs=1e-6)


def test_albedo_gives_raw_numbers(tmp_path):
    fabric = load(new(tmp_path, "--albedo", "--warp-color", "0.2,0.3,0.4"))
    assert fabric.threads["Color1"].albedo == (0.2, 0.3, 0.4)
    assert fabric.threads["Color1"].target_basis == "none"


def test_a_fibre_gives_the_surface_of_its_published_fit(tmp_path):
    thread = load(new(tmp_path, "--fibre", "silk", "--warp-color", "#806040")).thread_list[0]
    assert thread.ior == 1.345
    assert "Sadeghi2013" in thread.documentation


def test_a_donor_gives_its_scattering_and_the_colour_is_solved_through_it(tmp_path, capsys):
    fabric = load(new(tmp_path, "--thread", "silk_crepe_de_chine", "--warp-color", "#8a90a0"))
    assert fabric.model == "conserving"
    assert fabric.threads["Color1"].ior == 1.345
    assert fabric.threads["Color1"].target_basis == "opaque"
    # Without a colour the threads are the donor's.
    plain = load(new(tmp_path, "--thread", "silk_crepe_de_chine")).thread_list[0]
    donor = load("silk_crepe_de_chine").thread_list[0]
    assert (plain.albedo, plain.target_basis) == (donor.albedo, "none")
    capsys.readouterr()
    assert main(["new", "--weave", "plain", "--thread", "velvet", "--albedo"]) == 2
    assert "--albedo needs a colour" in capsys.readouterr().err


def test_set_solves_again_what_a_change_makes_wrong(tmp_path, capsys):
    path = new(tmp_path, "--warp-color", "#8a90a0", "--weft-color", "#8a90a0")
    before = load(path).threads["Color1"]
    capsys.readouterr()
    assert main(["set", str(path), "ior=1.8", "roughness=0.9"]) == 0
    assert "solved for its colour" in capsys.readouterr().err
    after = load(path).threads["Color1"]
    assert after.target_color == before.target_color
    assert after.albedo != pytest.approx(before.albedo, abs=1e-3)
    assert main(["set", str(path), "colour=teal"]) == 0
    assert load(path).threads["Color1"].albedo != after.albedo
    assert main(["set", str(path), "albedo=0.5,0.5,0.5"]) == 0
    thread = load(path).threads["Color1"]
    assert (thread.albedo, thread.target_basis) == ((0.5, 0.5, 0.5), "none")
    # Nothing to solve: no line.
    capsys.readouterr()
    assert main(["set", str(path), "thickness=0.4"]) == 0
    assert "solved" not in capsys.readouterr().err


def test_set_solves_the_colour_of_a_thread_that_is_named_by_its_prim(tmp_path):
    path = new(tmp_path, "--warp-color", "#8a90a0", "--weft-color", "#e0e0e0")
    assert main(["set", f"{path}:/cloth/Color1", "colour=#40a080"]) == 0
    one, other = load(path).thread_list
    assert main(["set", str(path), "warp.colour=#40a080"]) == 0
    assert load(path).thread_list == (one, other)


def test_pile_is_dyed_by_tracing_its_facets(tmp_path, capsys):
    path = new(tmp_path, "--thread", "velvet", "--warp-color", "0.1,0.05,0.15")
    capsys.readouterr()
    assert main(["cat", str(path), "--no-draft"]) == 0
    assert "reached, delta E 2000 0.00" in capsys.readouterr().out
