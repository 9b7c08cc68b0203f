"""`new`: yarn counts, weight, and cloth that closes."""

from __future__ import annotations

import json

import pytest

from fabricusd.schema import check, load
from fabricusd.weaves.cloth import OUNCE_PER_YARD, weight
from fabricusd.weaves.yarn import parse_count
from tests.cli.commands import run


def made(capsys, tmp_path, *arguments):
    """(fabric, stderr) of `new`."""
    out = tmp_path / "cloth.usda"
    status, _, err = run(capsys, "new", *arguments, "-o", str(out))
    assert status == 0, err
    return load(out), err


def gaps(tmp_path):
    return [f for f in check(tmp_path / "cloth.usda") if f.rule == "GapIsAskedFor"]


def test_the_donor_of_the_scattering_gives_no_size(capsys, tmp_path):
    fabric, err = made(
        capsys, tmp_path, "--weave", "satin 8", "--thread", "polyester_satin_charmeuse:Flat"
    )
    assert {thread.thickness for thread in fabric.thread_list} == {0.0}
    assert fabric.thread_list[0].ior == load("polyester_satin_charmeuse").threads["Flat"].ior
    assert "is open" not in err
    assert not gaps(tmp_path)


def test_a_yarn_count_gives_the_thickness_by_peirce_and_says_so(capsys, tmp_path):
    fabric, err = made(capsys, tmp_path, "--weave", "plain", "--yarn", "Ne 30")
    assert fabric.thread_list[0].thickness == pytest.approx(0.1658e-3, rel=1e-3)
    assert fabric.thread_list[0].linear_density == pytest.approx(parse_count("Ne 30"))
    assert "by Peirce, of cotton, 1.52 g/cm3, at a packing of 0.6" in err


def test_fibre_and_packing_change_the_thickness_and_not_the_count(capsys, tmp_path):
    cotton, _ = made(capsys, tmp_path, "--weave", "plain", "--yarn", "20 tex")
    wool, _ = made(
        capsys, tmp_path, "--weave", "plain", "--yarn", "20 tex", "--fibre", "wool",
        "--packing", "0.4",
    )  # fmt: skip
    assert wool.thread_list[0].thickness > cotton.thread_list[0].thickness
    assert wool.thread_list[0].linear_density == cotton.thread_list[0].linear_density


def test_a_thickness_precedes_a_yarn_count(capsys, tmp_path):
    fabric, _ = made(capsys, tmp_path, "--weave", "plain", "--yarn", "Ne 30", "--thickness", "0.5")
    assert fabric.thread_list[0].thickness == pytest.approx(0.5e-3)


def test_densities_per_inch_are_those_per_cm(capsys, tmp_path):
    fabric, _ = made(
        capsys, tmp_path, "--weave", "plain", "--ends-per-inch", "100", "--picks-per-inch", "50"
    )
    assert fabric.warp.density * 0.0254 == pytest.approx(100)
    assert fabric.weft.density * 0.0254 == pytest.approx(50)


def test_a_weight_is_met_and_said(capsys, tmp_path):
    fabric, err = made(
        capsys, tmp_path, "--weave", "twill 3/1", "--warp-yarn", "Ne 7", "--weft-yarn", "Ne 8",
        "--ends-per-inch", "68", "--picks-per-inch", "44", "--weight", "14oz",
    )  # fmt: skip
    assert weight(fabric).total == pytest.approx(14 * OUNCE_PER_YARD)
    assert fabric.warp.density == pytest.approx(68 / 0.0254)
    assert "The yarn counts are 1.31 times" in err
    assert "the densities are kept" in err


def test_a_preset_can_be_asked_for_a_weight(capsys, tmp_path):
    fabric, _ = made(capsys, tmp_path, "--preset", "linen_plain", "--weight", "200gsm")
    assert weight(fabric).total == pytest.approx(0.2)


def test_a_gap_that_nobody_asked_for_is_told_by_new_and_found_by_check(capsys, tmp_path):
    _, err = made(capsys, tmp_path, "--weave", "plain", "--thickness", "0.2")
    assert "The cloth is open, 36 % of it gap: warp of 0.2 mm at a pitch of 0.5" in err
    (finding,) = gaps(tmp_path)
    assert finding.severity == "warning"
    status, _, _ = run(capsys, "check", "--strict", str(tmp_path / "cloth.usda"))
    assert status == 1


def test_a_gap_that_was_asked_for_is_not(capsys, tmp_path):
    fabric, err = made(capsys, tmp_path, "--weave", "plain", "--thickness", "0.2", "--open")
    assert "is open" not in err
    assert fabric.warp.coverage == pytest.approx(0.32, abs=0.2)
    assert not gaps(tmp_path)


def test_cat_tells_weight_count_and_crimp(capsys, tmp_path):
    made(capsys, tmp_path, "--weave", "plain", "--yarn", "20 tex")
    path = str(tmp_path / "cloth.usda")
    _, out, _ = run(capsys, "cat", path, "--no-draft")
    assert "weight: 81.7 g/m2, 2.41 oz/yd2" in out
    assert "crimp of the curves 2.09 and 2.09 %" in out
    assert "yarn: 20 tex, Ne 29.5, Nm 50, 180 denier" in out
    _, out, _ = run(capsys, "cat", path, "--json")
    told = json.loads(out)
    assert told["weight"]["total"] == pytest.approx(0.0817, abs=1e-4)
    assert told["threads"]["Thread"]["linear_density"] == pytest.approx(20e-6)


def test_cat_says_what_a_count_that_is_not_known_rests_on(capsys):
    _, out, _ = run(capsys, "cat", "linen_plain", "--no-draft")
    assert "Peirce's cotton yarn (1.52 g/cm3, packing 0.6)" in out
    assert "yarn: (55.4 tex" in out
    _, out, _ = run(capsys, "cat", "velvet", "--no-draft")
    assert "weight: not known" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--yarn", "30"), "--yarn is '30'; write a count and its unit"),
        (("--weft-yarn", "Ne x"), "--weft-yarn is 'Ne x'"),
        (("--thread", "linen_plain", "--fibre", "wool"), "--fibre needs a yarn count"),
        (("--fibre", "hemp"), "--fibre is 'hemp'; it must be one of cotton"),
        (("--packing", "0.5"), "--packing needs a yarn count"),
        (("--yarn", "Ne 30", "--fibre", "hemp"), "--fibre is 'hemp'; it must be one of cotton"),
        (("--weight", "heavy"), "--weight is 'heavy'; write it as in 14oz"),
        (("--ends-per-cm", "9", "--ends-per-inch", "9"), "not allowed with argument --ends-per-cm"),
    ],
)
def test_a_slip_is_refused_and_nothing_is_written(capsys, tmp_path, arguments, said):
    out = tmp_path / "out.usda"
    status, _, err = run(capsys, "new", "--weave", "plain", *arguments, "-o", str(out))
    assert status == 2
    assert said in err
    assert len(err.splitlines()) == 1
    assert not out.exists()
