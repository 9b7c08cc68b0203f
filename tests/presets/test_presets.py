"""The derived presets: what is shipped is what the table of rows makes, and is what it says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fabricusd.appearance.weave.coverage import coverage
from fabricusd.appearance.weave.lookup import back_of
from fabricusd.dye import cloth_color, reached
from fabricusd.dye.difference import difference, lab
from fabricusd.errors import FabricError
from fabricusd.presets.__main__ import main, measured
from fabricusd.presets.make import made, woven
from fabricusd.presets.rows import ROWS, Row
from fabricusd.presets.spinning import SPINNING
from fabricusd.schema import load, preset_names, published_names
from fabricusd.schema.rules.closed import MOST_GAP
from fabricusd.schema.source import TRADE, preset_path
from fabricusd.schema.write import usd_text
from fabricusd.weaves.cloth import GRAM, weight

EACH = pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)


def test_every_row_is_shipped_and_nothing_else():
    assert {row.name for row in ROWS} == {path.stem for path in TRADE.glob("*.usda")}
    assert {row.name for row in ROWS} | set(published_names()) == set(preset_names())
    assert not {row.name for row in ROWS} & set(published_names())


@EACH
def test_the_layer_is_the_text_that_its_row_makes(row: Row):
    shipped = preset_path(row.name).read_text(encoding="utf-8")
    assert usd_text(made(row, load(row.name).sides)) == shipped


@pytest.mark.slow
@pytest.mark.parametrize(
    "row",
    [
        row if row.name == "cotton_poplin" else pytest.param(row, marks=pytest.mark.exhaustive)
        for row in ROWS
    ],
    ids=lambda row: row.name,
)
def test_the_shares_by_side_are_those_that_tracing_finds(row: Row):
    found, stated = measured(row), load(row.name).sides
    for name in ("gap", "surface", "reflected", "transmitted", "forward"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(stated, name), atol=0.0015, err_msg=name
        )


@EACH
def test_it_weighs_what_such_cloth_weighs_in_the_trade(row: Row):
    found = weight(load(row.name))
    assert found is not None
    low, high = row.trade
    assert low <= found.total / GRAM <= high
    assert f"{low:g} to {high:g} g/m2" in " ".join(load(row.name).documentation.split())


@EACH
def test_it_closes_unless_such_cloth_is_open(row: Row):
    gap = float(coverage(load(row.name)).gap)
    assert (gap > MOST_GAP) == row.is_open


@EACH
def test_a_thread_alone_has_the_colour_asked_for(row: Row):
    fabric = load(row.name)
    for name, thread in fabric.threads.items():
        assert thread.target_basis == "opaque"
        assert float(difference(reached(fabric, name), np.array(thread.target_color))) < 0.1


@EACH
def test_it_is_uneven_as_its_yarn_is_spun(row: Row):
    fabric = load(row.name)
    for which, yarn in (("warp", row.warp), ("weft", row.weft)):
        thread = fabric.thread_list[getattr(fabric, which).sequence[0]]
        assert thread.is_uneven
        assert thread.unevenness_cv == SPINNING[yarn.spun].cv
        assert thread.plies == SPINNING[yarn.spun].plies


def test_the_back_of_denim_is_pale():
    face, back = (lab(cloth_color(f))[0] for f in (load("denim"), back_of(load("denim"))))
    assert face < 45
    assert back > face + 20


def test_the_back_of_poplin_has_the_colour_of_its_face():
    poplin = load("cotton_poplin")
    assert float(difference(cloth_color(back_of(poplin)), cloth_color(poplin))) < 0.1


def test_a_colour_that_such_cloth_cannot_have_makes_no_preset():
    row = replace(ROWS[0], warp=replace(ROWS[0].warp, color="black"))
    with pytest.raises(FabricError, match=r"preset 'cotton_poplin' has another colour: .* nearest"):
        made(row)


def test_counts_and_densities_are_those_of_the_row():
    row = next(row for row in ROWS if row.name == "denim")
    fabric = woven(row)
    assert fabric.warp.density == pytest.approx(72 / 0.0254)
    assert fabric.threads["Warp"].linear_density == pytest.approx(84.4e-6, rel=1e-3)
    assert fabric.threads["Weft"].linear_density == pytest.approx(59.05e-6, rel=1e-3)


def test_the_command_writes_the_presets_that_are_named(tmp_path, capsys):
    arguments = ["--only", "gauze", "--keep-sides", "-o", str(tmp_path)]
    assert main(arguments) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["gauze.usda"]
    assert (tmp_path / "gauze.usda").read_bytes() == preset_path("gauze").read_bytes()
    assert main(["--only", "gauz", "-o", str(tmp_path)]) == 2
    assert "did you mean 'gauze'" in capsys.readouterr().err
