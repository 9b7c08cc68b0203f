"""WIF drafts: writing what programs read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.fabric import Weave
from fabricusd.weaves import (
    Draft,
    from_fabric,
    parse_wif,
    read_wif,
    to_fabric,
    wif_text,
    write_wif,
)
from fabricusd.weaves.color import palette_from_codes
from fabricusd.weaves.wif.write import MOST_SHAFTS
from tests.draft_strategies import drafts
from tests.wif_samples import TWILL, TWILL_CELLS, changed, plain_ini, slow_cells


@pytest.mark.parametrize("name", ["2229", "8452"])
def test_a_real_draft_comes_in_and_goes_out_as_it_is(
    shared_data: Path, tmp_path: Path, name: str
) -> None:
    path = shared_data / f"{name}.wif"
    draft = read_wif(path)
    text = path.read_text()
    assert np.array_equal(draft.weave.cells, slow_cells(text))
    wif = plain_ini(text)
    assert draft.weave.cells.shape == (int(wif["WARP"]["threads"]), int(wif["WEFT"]["threads"]))
    assert draft.palette == palette_from_codes([[0, 101, 0], [255, 255, 255]])
    assert set(draft.warp_colors) == {0}
    assert set(draft.weft_colors) == {1}
    assert draft.warp_spacing == draft.weft_spacing == 0.000185
    assert draft.warp_thickness == 0.000213
    assert draft.title == name
    assert draft.warnings == ()
    write_wif(draft, tmp_path / f"{name}.wif")
    again = read_wif(tmp_path / f"{name}.wif")
    assert again == draft
    assert np.array_equal(slow_cells((tmp_path / f"{name}.wif").read_text()), draft.weave.cells)
    # Through the fabric, too: the same drawdown, the same colours, code for code.
    woven = plain_ini(wif_text(from_fabric(to_fabric(draft))))
    assert woven["COLOR TABLE"] == wif["COLOR TABLE"]
    assert woven["COLOR PALETTE"]["range"] == "0,255"
    assert woven["WARP COLORS"] == wif["WARP COLORS"]
    assert woven["WEFT COLORS"] == wif["WEFT COLORS"]


@given(drafts())
def test_what_is_written_reads_back_equal(draft: Draft) -> None:
    text = wif_text(draft)
    again = parse_wif(text)
    assert again == draft
    assert np.array_equal(slow_cells(text), draft.weave.cells)
    assert wif_text(again) == text


@given(st.integers(0, 3), st.integers(1, 6))
def test_colours_of_another_length_than_the_weave_are_written_in_full(a: int, k: int) -> None:
    draft = parse_wif(TWILL)
    colors = tuple((a + n) % 2 for n in range(k))
    again = parse_wif(wif_text(Draft(
        weave=draft.weave, palette=draft.palette, warp_colors=colors, weft_colors=(0,)
    )))  # fmt: skip
    assert again.weave.ends == np.lcm(4, k)
    assert again.warp_colors == colors * (again.weave.ends // k)
    assert np.array_equal(again.weave.cells, np.tile(TWILL_CELLS, (again.weave.ends // 4, 1)))


@pytest.mark.parametrize(("ends", "plan"), [(MOST_SHAFTS, False), (MOST_SHAFTS + 1, True)])
def test_a_draft_of_many_shafts_is_written_as_a_lift_plan(ends: int, plan: bool) -> None:
    draft = Draft(weave=Weave(np.eye(ends, dtype=bool), "eye"), title="eye")
    text = wif_text(draft)
    assert ("[LIFTPLAN]" in text) == plan
    assert ("[TIEUP]" in text) == (not plan)
    assert parse_wif(text) == draft


def test_equal_ends_share_a_shaft_and_equal_picks_a_treadle() -> None:
    wif = plain_ini(wif_text(parse_wif(TWILL)))
    assert (wif["WEAVING"]["shafts"], wif["WEAVING"]["treadles"]) == ("4", "4")
    assert list(wif["TREADLING"].values()) == ["1", "2", "3", "4", "1"]


def test_the_contents_of_a_written_draft_are_true() -> None:
    wif = plain_ini(wif_text(parse_wif(TWILL)))
    assert {name.upper() for name in wif["CONTENTS"]} == set(wif) - {"WIF", "CONTENTS"}


def test_colours_that_went_through_single_precision_keep_their_codes() -> None:
    draft = parse_wif(changed(("1=0,0,0", "1=1,101,254")))
    single = tuple(tuple(float(np.float32(x)) for x in color) for color in draft.palette)
    wif = plain_ini(wif_text(Draft(
        weave=draft.weave, palette=single, warp_colors=(0,), weft_colors=(1,)
    )))  # fmt: skip
    assert wif["COLOR TABLE"] == {"1": "1,101,254", "2": "255,255,255"}


def test_colours_of_no_range_are_written_in_sixteen_bits() -> None:
    draft = parse_wif(TWILL)
    odd = ((0.123456, 0.5, 0.9), (1.0, 1.0, 1.0))
    text = wif_text(Draft(weave=draft.weave, palette=odd, warp_colors=(0,), weft_colors=(1,)))
    again = parse_wif(text)
    assert again.color_range == (0, 65535)
    assert np.allclose(again.palette, odd, atol=3e-5)
