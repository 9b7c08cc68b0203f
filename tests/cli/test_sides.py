"""`fabricusd sides`: what it writes is what a fabric states once it is sublayered."""

from __future__ import annotations

import pytest

from fabricusd.cli.main import main
from fabricusd.schema import load
from fabricusd.sides import Sides

FEW = ("--paths", "64")
CLOTH = """#usda 1.0
(
    subLayers = [@./sides.usda@]
)
def Scope "Cloth"
{
    def WovenFabric "Plain"
    {
        double fabric:warp:coverage = 0.4
        double fabric:weft:coverage = 0.4
        def WovenThread "Yarn"
        {
            double[] thread:curve:angles = [-20, 20]
        }
    }
}
"""


def test_a_fabric_states_what_was_measured(tmp_path, capsys):
    layer = tmp_path / "cloth.usda"
    layer.write_text(CLOTH.replace("    subLayers = [@./sides.usda@]\n", ""))
    written = tmp_path / "sides.usda"
    assert main(["sides", f"{layer}:/Cloth/Plain", *FEW, "-o", str(written)]) == 0
    assert load(f"{layer}:/Cloth/Plain").sides == Sides()
    layer.write_text(CLOTH)
    sides = load(f"{layer}:/Cloth/Plain").sides
    assert len(sides.gap) == len(sides.forward) == 45
    assert sides.gap[0] == pytest.approx(0.2, abs=1e-3)
    assert capsys.readouterr().out == ""


def test_without_a_file_the_layer_is_printed(capsys):
    assert main(["sides", "linen_plain", *FEW]) == 0
    out = capsys.readouterr().out
    assert 'over "linen_plain"' in out
    assert "uniform double[] fabric:sides:gap = [0.34" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("velvet",), "fabric 'velvet' is opaque"),
        (("linen_plain", "-o", "sides.txt"), "sides.txt has another suffix than .usda"),
        (("linen_plain", "--paths", "3"), "must be a whole number from 64 to 1048576"),
    ],
)
def test_what_cannot_be_measured_or_written_is_refused_in_one_line(arguments, said, capsys):
    try:
        status = main(["sides", *arguments])
    except SystemExit as left:
        status = left.code
    assert status == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
