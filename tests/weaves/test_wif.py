"""WIF drafts: reading what programs write."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fabricusd.weaves import parse_wif, read_wif, to_fabric, wif_text
from fabricusd.weaves.color import palette_from_codes
from tests.wif_samples import TWILL, TWILL_CELLS, changed, slow_cells


def test_tie_up_and_treadling_make_the_drawdown() -> None:
    draft = parse_wif(TWILL)
    assert np.array_equal(draft.weave.cells, TWILL_CELLS)
    assert np.array_equal(slow_cells(TWILL), TWILL_CELLS)
    assert draft.title == draft.weave.name == "Twill; two over two"
    assert draft.author == "A. Weaver"
    assert draft.notes == "first line; with a semicolon\nsecond line"
    assert (draft.warp_spacing, draft.weft_thickness) == (0.0005, 0.0008)
    assert draft.warp_colors == (0, 0, 0, 0)
    assert draft.warnings == ()


TREADLING = "[TREADLING]\n1=1\n2=2\n3=3\n4=4\n5=1"
LIFTPLAN = changed(
    ("[TIEUP]", "[UNUSED]"),
    (TREADLING, "[LIFTPLAN]\n1=1,2\n2=2,3\n3=3,4\n4=4,1\n5=1,2"),
)
SAME_DRAWDOWN = {
    "lift plan": LIFTPLAN,
    "sinking shed": changed(
        ("Rising Shed=true", "Rising Shed=off"),
        ("1=1,2\n2=2,3\n3=3,4\n4=1,4", "1=3,4\n2=1,4\n3=1,2\n4=2,3"),
    ),
    "sinking lift plan": LIFTPLAN.replace("Rising Shed=true", "Rising Shed=no").replace(
        "1=1,2\n2=2,3\n3=3,4\n4=4,1\n5=1,2", "1=3,4\n2=1,4\n3=1,2\n4=2,3\n5=3,4"
    ),
    "several treadles a pick": changed(
        ("1=1,2\n2=2,3\n3=3,4\n4=1,4", "1=1\n2=2\n3=3\n4=4"),
        (TREADLING, "[TREADLING]\n1=1,2\n2=2,3,2\n3=3,4\n4=4,1\n5=2,1"),
    ),
    "several shafts an end": changed(
        ("[TIEUP]\n1=1,2\n2=2,3\n3=3,4\n4=1,4", "[TIEUP]\n1=1\n2=2\n3=3\n4=4"),
        ("[THREADING]\n1=1\n2=2\n3=3\n4=4", "[THREADING]\n1=1,4\n2=1,2\n3=2,3\n4=3,4"),
    ),
    "zeros that mean none": changed(("1=1,2", "1=1,0,2"), ("5=1\n", "5=1,0\n")),
    "blanks everywhere": changed(("=", " = "), (",", " , "), ("[WARP]", "  [ warp ]\t")),
    "other cases": TWILL.replace("Threads", "THREADS").replace("[THREADING]", "[Threading]"),
    "comments": changed(
        ("1=1,2\n", "1=1,2 ; the first\n; a line\n"), ("Threads=4", "Threads=4;ends")
    ),
    "windows line ends": TWILL.replace("\n", "\r\n"),
    "old mac line ends": TWILL.replace("\n", "\r"),
    "blank lines": TWILL.replace("\n", "\n\n"),
    "leading zeros": changed(("2=2,3", "02=002,03")),
    "trailing comma": changed(("2=2,3", "2=2,3,")),
    "a key twice, the last one counts": changed(("2=2,3\n", "2=1,4\n2=2,3\n")),
    "a section in two parts": changed(("3=3,4\n4=1,4\n", "[TEXT]\n[TIEUP]\n3=3,4\n4=1,4\n")),
    "private sections": TWILL + "[PRIVATE MINE THINGS]\nfoo bar baz\n1=1,2,x\n[!]\n=\n%(x)s=%\n",
    "contents that lie": changed(("COLOR PALETTE=true", "LIFTPLAN=true\nWARP=false\nTIEUP")),
    "text before the first section": "; made by hand\nhello\n\n" + TWILL,
    "no counts": changed(("Shafts=4\nTreadles=4\n", "")),
    "shafts of zero": changed(("Treadles=4\n", "Treadles=0\n")),
    "both, with the tie-up counting": TWILL + "[LIFTPLAN]\n1=1\n",
    "no thread counts": changed(("Threads=4\n", ""), ("Threads=5\n", "")),
    "a default section": TWILL + "[DEFAULT]\n1=1\n",
}  # fmt: skip


@pytest.mark.parametrize("case", SAME_DRAWDOWN)
def test_every_way_to_write_a_draft_makes_the_same_drawdown(case: str) -> None:
    assert np.array_equal(parse_wif(SAME_DRAWDOWN[case]).weave.cells, TWILL_CELLS)


ENCODINGS = {
    "utf-8": "utf-8",
    "utf-8 with a mark": "utf-8-sig",
    "latin-1": "latin-1",
    "windows": "cp1252",
    "utf-16": "utf-16",
    "utf-16, big end first": "utf-16-be",
}


@pytest.mark.parametrize("case", ENCODINGS)
def test_a_title_is_read_in_every_usual_encoding(tmp_path: Path, case: str) -> None:
    text = changed(("Title=Twill; two over two", "Title=Köper für Åse"))
    mark = b"\xfe\xff" if case == "utf-16, big end first" else b""
    (tmp_path / "x.wif").write_bytes(mark + text.encode(ENCODINGS[case]))
    draft = read_wif(tmp_path / "x.wif")
    assert draft.title == "Köper für Åse"
    assert np.array_equal(draft.weave.cells, TWILL_CELLS)


def test_threads_that_nothing_lifts_stay_down() -> None:
    draft = parse_wif(changed(("[THREADING]\n1=1\n2=2\n", "[THREADING]\n1=0\n2=\n"), ("5=1\n", "")))
    assert np.array_equal(
        draft.weave.cells, TWILL_CELLS & np.array([0, 0, 1, 1])[:, None] & [1, 1, 1, 1, 0]
    )


def test_a_lift_plan_that_differs_from_the_tie_up_is_reported() -> None:
    assert (
        "LIFTPLAN] differs"
        in parse_wif(SAME_DRAWDOWN["both, with the tie-up counting"]).warnings[0]
    )
    agreeing = TWILL + "[LIFTPLAN]\n1=1,2\n2=2,3\n3=3,4\n4=4,1\n5=1,2\n"
    assert parse_wif(agreeing).warnings == ()


def test_a_shed_that_is_not_stated_rises_and_is_reported() -> None:
    draft = parse_wif(changed(("Rising Shed=true\n", "")))
    assert np.array_equal(draft.weave.cells, TWILL_CELLS)
    assert "taken to rise" in draft.warnings[0]


@pytest.mark.parametrize(
    ("palette", "codes", "low", "high"),
    [
        ("[COLOR PALETTE]\nRange=0,999\n", "999,0,500", 0, 999),
        ("[COLOR PALETTE]\nForm=rgb\nRange = 0 , 65535\n", "65535,0,256", 0, 65535),
        ("[COLOR PALETTE]\nRange=999\n", "999,0,500", 0, 999),
        ("[COLOR PALETTE]\nRange=100,200\n", "200,100,150", 100, 200),
        ("[COLOR PALETTE]\nEntries=1\n", "999,0,500", 0, 999),
        ("", "255,0,128", 0, 255),
        ("", "1000,0,128", 0, 65535),
    ],
)
def test_colours_are_read_in_any_range(palette: str, codes: str, low: int, high: int) -> None:
    head, tail = TWILL.split("[COLOR PALETTE]")
    text = (
        f"{head}{palette}[COLOR TABLE]\n1={codes}\n2=150,150,150\n[WEAVING]"
        + tail.split("[WEAVING]")[1]
    )
    draft = parse_wif(text)
    numbers = [int(c) for c in codes.split(",")]
    assert draft.color_range == (low, high)
    assert draft.palette[0] == palette_from_codes([numbers], low, high)[0]
    assert ("has no Range" in " ".join(draft.warnings)) == ("Range" not in palette)
    assert parse_wif(wif_text(draft)) == draft


def test_threads_take_their_own_colour_or_the_default_of_their_set() -> None:
    draft = parse_wif(TWILL + "[WARP COLORS]\n3=2\n[WEFT COLORS]\n1=1\n2=\n5=1,0,0,0\n")
    assert draft.warp_colors == (0, 0, 1, 0)
    assert draft.weft_colors == (0, 1, 1, 1, 0)


def test_a_table_may_number_its_colours_as_it_likes() -> None:
    draft = parse_wif(
        changed(
            ("1=0,0,0\n2=255,255,255", "0=255,255,255\n7=0,0,0"),
            ("Color=1", "Color=7"),
            ("Color=2", "Color=0"),
        )
    )
    assert draft.palette[draft.warp_colors[0]] == (0, 0, 0)
    assert draft.palette[draft.weft_colors[0]] == (1, 1, 1)


def test_missing_colours_mean_the_first_of_the_table_and_are_reported() -> None:
    draft = parse_wif(changed(("Color=1\n", "")))
    assert draft.warp_colors == (0, 0, 0, 0)
    assert "4 warp thread(s) have no colour" in draft.warnings[0]


def test_a_draft_without_a_table_has_no_colours_and_says_so() -> None:
    head, rest = TWILL.split("[COLOR TABLE]")
    draft = parse_wif(head + rest[rest.index("[WEAVING]") :])
    assert not draft.colored
    assert "no [COLOR TABLE]" in draft.warnings[0]
    assert parse_wif(wif_text(draft)) == draft


@pytest.mark.parametrize(
    ("unit", "written", "metres"),
    [
        ("Centimeters", "0.0185", 0.000185),
        ("Inches", "0.05", 0.00127),
        ("Decipoints", "72", 0.00254),
        ("INCHES ; each", "5e-2", 0.00127),
        ("cm", "0,0185", 0.000185),
    ],
)
def test_lengths_are_read_in_the_units_of_their_set(unit: str, written: str, metres: float) -> None:
    draft = parse_wif(
        changed(("Units=Centimeters\nSpacing=0.05", f"Units={unit}\nSpacing={written}"))
    )
    assert draft.warp_spacing == pytest.approx(metres, rel=1e-15)
    assert draft.weft_spacing == 0.001
    assert parse_wif(wif_text(draft)) == draft


def test_spacing_and_thickness_are_read_thread_by_thread() -> None:
    draft = parse_wif(
        TWILL
        + "[WARP SPACING]\n2=0.1\n[WARP THICKNESS]\n"
        + "[WEFT SPACING]\n1=\n[WEFT THICKNESS]\n1=0.2\n5=0\n"
    )
    assert draft.warp_spacings == (0.0005, 0.001, 0.0005, 0.0005)
    assert draft.weft_thicknesses == (0.002, 0.0008, 0.0008, 0.0008, 0.0)
    assert draft.weft_spacings == draft.warp_thicknesses == ()
    assert parse_wif(wif_text(draft)) == draft


def test_a_thread_of_spacing_zero_is_hidden() -> None:
    draft = parse_wif(TWILL + "[WARP SPACING]\n2=0\n")
    assert draft.warp_spacings == (0.0005, 0.0, 0.0005, 0.0005)
    assert to_fabric(draft).weave.ends == 3


def test_threads_without_a_spacing_take_the_mean_of_the_others() -> None:
    draft = parse_wif(changed(("Spacing=0.05\n", "")) + "[WARP SPACING]\n1=0.1\n2=0.3\n")
    assert draft.warp_spacings == (0.001, 0.003, 0.002, 0.002)


def test_a_set_whose_threads_are_all_alike_has_one_spacing() -> None:
    draft = parse_wif(TWILL + "[WARP SPACING]\n" + "".join(f"{k}=0.2\n" for k in range(1, 5)))
    assert (draft.warp_spacing, draft.warp_spacings) == (0.002, ())


def test_spacing_without_a_unit_or_of_zero_is_not_used_and_reported() -> None:
    assert parse_wif(changed(("Spacing=0.05", "Spacing=0"))).warp_spacing is None
    draft = parse_wif(changed(("Units=Centimeters\nSpacing=0.05", "Spacing=0.05")))
    assert draft.warp_spacing is draft.warp_thickness is None
    assert "[WARP] Units is missing; the spacing is not used." in draft.warnings[0]
