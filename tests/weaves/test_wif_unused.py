"""Lines of a WIF file that nothing uses: a warning each, and the drawdown that the others make."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.weaves import parse_wif, read_wif
from tests.wif_samples import SMALL, TWILL, TWILL_CELLS, changed

CASES = Path(__file__).parents[1] / "cases" / "wif_extra_lines"


@pytest.mark.parametrize(
    ("file", "warning"),
    [
        (
            "extra_treadles.wif",
            "[TIEUP] has 2 line(s) for treadles outside 1 to 4, such as '5'",
        ),
        (
            "end_zero.wif",
            "[TREADLING] has 1 line(s) for picks outside 1 to 4, such as '5'",
        ),
        ("default_colour.wif", "[WARP] Color is '0'; it must be a colour of [COLOR TABLE]"),
    ],
)
def test_lines_beyond_what_the_draft_has_leave_its_drawdown(file: str, warning: str) -> None:
    base, draft = read_wif(CASES / "base.wif"), read_wif(CASES / file)
    assert base.warnings == ()
    assert np.array_equal(draft.weave.cells, base.weave.cells)
    assert np.array_equal(draft.weave.cells, TWILL_CELLS[:, :4])
    assert len(draft.warnings) == 1
    assert warning in draft.warnings[0]


UNUSED = {
    "end beyond the warp": (("4=4\n[TIEUP]", "4=4\n9=1\n[TIEUP]"), "[THREADING] has 1 line(s) for"),
    "end zero": (("[THREADING]\n", "[THREADING]\n0=1\n"), "ends outside 1 to 4, such as '0'"),
    "end in words": (("[THREADING]\n", "[THREADING]\nfirst=x\n"), "such as 'first'"),
    "end of nonsense": (("[THREADING]\n", "[THREADING]\n-1=1\n1.5=1\n９=1\n"), "has 3 line(s) for"),
    "end beyond integers": (("[THREADING]\n", f"[THREADING]\n{'9' * 5000}=1\n"), "such as '9999"),
    "pick beyond the weft": (("5=1\n", "5=1\n6=1\n7=99\n8=no\n"), "[TREADLING] has 3 line(s) for"),
    "treadle beyond the loom": (("4=1,4\n", "4=1,4\n5=1\n6=99\n"), "[TIEUP] has 2 line(s) for"),
    "treadle zero": (("4=1,4\n", "4=1,4\n0=1\n"), "[TIEUP] has 1 line(s) for treadles outside"),
    "wrong treadle that no pick presses": (
        ("Treadles=4", "Treadles=9\n"),
        ("4=1,4\n", "4=1,4\n5=7\n6=x\n"),
        "2 treadle(s) are wrong, but no pick uses them: d.wif [TIEUP] 5 names 7",
    ),
    "lift plan beside a tie-up, wrong": (
        ("[NOTES]", "[LIFTPLAN]\n1=99\n[NOTES]"),
        "[LIFTPLAN] is not used, since there is a tie-up with a treadling: d.wif [LIFTPLAN] 1 ",
    ),
    "colour that no thread has, wrong": (
        ("2=255,255,255\n", "2=255,255,255\n3=1,2\n4=0,0,256\n5=x\n"),
        "3 colour(s) are wrong, but no thread uses them: d.wif [COLOR TABLE] 3 is '1,2'",
    ),
    "colour in words": (("1=0,0,0\n", "1=0,0,0\nblack=0,0,0\n"), "[COLOR TABLE] has 1 line(s) for"),
    "default colour while each end has its own": (
        ("Color=1", "Color=17"),
        ("[TIEUP]", "[WARP COLORS]\n1=1\n2=1\n3=1\n4=1\n[TIEUP]"),
        "it must be a colour of [COLOR TABLE], whose numbers are from 1 to 2; it is not",
    ),
    "default colour zero": (("Color=1", "Color=0"), "4 warp thread(s) have no colour"),
    "colour of no end": (("[TIEUP]", "[WARP COLORS]\n5=99\n[TIEUP]"), "[WARP COLORS] has 1 line"),
    "colour of no pick": (("[TIEUP]", "[WEFT COLORS]\n0=x\n[TIEUP]"), "[WEFT COLORS] has 1 line"),
    "spacing of no end": (("[TIEUP]", "[WARP SPACING]\n5=x\n[TIEUP]"), "[WARP SPACING] has 1 line"),
    "thickness of no pick": (
        ("[TIEUP]", "[WEFT THICKNESS]\n6=0.1\n[TIEUP]"),
        "[WEFT THICKNESS] has 1 line(s) for picks outside 1 to 5, such as '6'",
    ),
    "default spacing while each end has its own": (
        ("Spacing=0.05", "Spacing=wide"),
        ("[TIEUP]", "[WARP SPACING]\n1=0.1\n2=0.2\n3=0.1\n4=0.2\n[TIEUP]"),
        "[WARP] Spacing is 'wide'; it must be 0, or a number from",
    ),
    "lines before the first section": (
        ("[WIF]", "MHWeave 3\nVersion=2\n[WIF]"),
        "2 line(s) before the first section are not used, such as 'MHWeave 3'",
    ),
    "a section before [WIF]": (("[WIF]", "[HELLO]\n1=1\n[WIF]"), "are not part of WIF and are"),
    "lines without =": (
        ("[THREADING]\n", "[THREADING]\nthe threading\n1\n=3\n"),
        "3 line(s) are not KEY=VALUE and are not used, such as 'the threading'",
    ),
    "a section without its end": (("[NOTES]", "[FOO\n[NOTES]"), "such as '[FOO'"),
    "notes without a number": (
        ("[NOTES]\n", "[NOTES]\nsee also=x\n"),
        "[NOTES] has 1 line(s) for notes outside 0 to 1000000, such as 'see also'",
    ),
    "unknown sections": (
        ("[NOTES]", "[THREADS]\n1=x\n[NOTES]"),
        "1 section(s) are not part of WIF and are not used, such as 'THREADS'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", UNUSED)
def test_what_nothing_uses_is_a_warning_and_changes_nothing(case: str) -> None:
    *changes, warning = UNUSED[case]
    draft = parse_wif(changed(*changes), "d.wif")
    assert np.array_equal(draft.weave.cells, TWILL_CELLS)
    assert warning in " ".join(draft.warnings)
    assert all(len(line) < 400 and line.isprintable() for line in draft.warnings)


SILENT = {
    "sections that WIF has and cloth does not": "[WARP SYMBOLS]\n1=x\n[TRANSLATIONS]\n[CONTENTS]\n",
    "private sections": "[PRIVATE MINE THINGS]\nfoo bar\n=\n1=x\n",
    "comments": "; a line\n# another\n[TEXT]\n;1=1\n#2\n",
    "keys that say nothing of the cloth": "[WARP]\nSymbol=x\nThickness Zoom=9\n[TEXT]\nEMail=x\n",
}


@pytest.mark.parametrize("case", SILENT)
def test_what_a_draft_may_hold_beside_its_cloth_is_not_warned_of(case: str) -> None:
    assert parse_wif(TWILL + SILENT[case]) == parse_wif(TWILL)
    assert parse_wif(TWILL + SILENT[case]).warnings == ()


USED = {
    "treadle that a pick presses": (("2=2,3\n", "2=9\n"), "[TIEUP] 2 names 9; it must be from 0"),
    "pick of a treadle that there is not": (("5=1\n", "5=9\n"), "[TREADLING] 5 names 9"),
    "colour that a thread has": (("1=0,0,0", "1=0,0,256"), "[COLOR TABLE] 1 is 0,0,256"),
    "default colour that an end needs": (
        ("Color=1", "Color=17"),
        ("[TIEUP]", "[WARP COLORS]\n1=1\n2=1\n3=1\n[TIEUP]"),
        "[WARP] Color is '17'; it must be a colour of [COLOR TABLE], whose numbers are from 1 to 2",
    ),
    "default spacing that an end needs": (
        ("Spacing=0.05", "Spacing=wide"),
        ("[TIEUP]", "[WARP SPACING]\n1=0.1\n2=0.2\n3=0.1\n[TIEUP]"),
        "[WARP] Spacing is 'wide'; it must be 0, or a number from",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", USED)
def test_the_same_fault_in_a_line_that_is_used_is_an_error(case: str) -> None:
    *changes, message = USED[case]
    with pytest.raises(FabricError) as caught:
        parse_wif(changed(*changes), "d.wif")
    assert str(caught.value).startswith(f"d.wif {message}")


def test_a_treadling_of_no_pick_leaves_the_lift_plan() -> None:
    text = SMALL.replace("[TREADLING]\n1=1\n2=2", "[TREADLING]\n9=1\n[LIFTPLAN]\n1=2\n2=1")
    assert parse_wif(text).weave.cells.tolist() == [[False, True], [True, False]]
