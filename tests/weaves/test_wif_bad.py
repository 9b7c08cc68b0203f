"""WIF files that are wrong: one line says where, what, and what would be accepted."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fabricusd.errors import FabricError
from fabricusd.weaves import parse_wif, read_wif, write_wif
from tests.wif_samples import SMALL

# What is replaced, by what, and what the message must hold.
BAD = {
    "no WIF section": ("[WIF]\nVersion=1.1\n", "", "d.wif has no section [WIF]"),
    "truncated in the tie-up": (
        SMALL[SMALL.index("[TREADLING]") :],
        "",
        "[TREADLING] is missing; a draft must have",
    ),
    "truncated in a section's name": (
        SMALL[SMALL.index("READING]") :],
        "",
        "[THREADING] does not name any shaft",
    ),
    "no threading": ("[THREADING]", "[NOTHING]", "d.wif [THREADING] does not name any shaft"),
    "threading of zeros": (
        "[THREADING]\n1=1\n2=2",
        "[THREADING]\n1=0\n2=0",
        "does not name any shaft",
    ),
    "no tie-up": (
        "[TIEUP]",
        "[NOTHING]",
        "[TIEUP] is missing; a draft must have [TIEUP] and [TREADLING], or a [LIFTPLAN]",
    ),
    "no ends": (
        "[WARP]\nThreads=2",
        "[WARP]\nThreads=0",
        "d.wif [WARP] Threads is '0'; it must be a whole number from 1 to 16384",
    ),
    "negative ends": ("[WARP]\nThreads=2", "[WARP]\nThreads=-2", "[WARP] Threads is '-2'"),
    "half an end": ("[WARP]\nThreads=2", "[WARP]\nThreads=2.5", "[WARP] Threads is '2.5'"),
    "ends in words": ("[WARP]\nThreads=2", "[WARP]\nThreads=two", "[WARP] Threads is 'two'"),
    "huge count of ends": (
        "[WARP]\nThreads=2",
        "[WARP]\nThreads=2000000000",
        "[WARP] Threads is '2000000000'",
    ),
    "count beyond integers": (
        "[WARP]\nThreads=2",
        "[WARP]\nThreads=" + "9" * 5000,
        "[WARP] Threads is '9999",
    ),
    "count of other digits": ("[WARP]\nThreads=2", "[WARP]\nThreads=２", "[WARP] Threads is '２'"),
    "huge count of picks": (
        "[WEFT]\nThreads=2",
        "[WEFT]\nThreads=16385",
        "[WEFT] Threads is '16385'",
    ),
    "huge count of shafts": ("Shafts=2", "Shafts=99999999", "[WEAVING] Shafts is '99999999'"),
    "negative treadles": ("Treadles=2", "Treadles=-1", "[WEAVING] Treadles is '-1'"),
    "shed of unknown kind": (
        "Shed=true",
        "Shed=maybe",
        "[WEAVING] Rising Shed is 'maybe'; it must be one of true, on, yes",
    ),
    "no such shaft": (
        "[THREADING]\n1=1",
        "[THREADING]\n1=3",
        "[THREADING] 1 names 3; it must be from 0 to 2, [WEAVING] Shafts",
    ),
    "shaft beyond integers": (
        "[THREADING]\n1=1",
        "[THREADING]\n1=" + "9" * 400,
        "[THREADING] 1 names ",
    ),
    "negative shaft": (
        "[THREADING]\n1=1",
        "[THREADING]\n1=-1",
        "[THREADING] 1 is '-1'; it must be whole numbers, separated by commas",
    ),
    "fractional shaft": ("[THREADING]\n1=1", "[THREADING]\n1=1.0", "[THREADING] 1 is '1.0'"),
    "shaft in words": ("[THREADING]\n1=1", "[THREADING]\n1=one", "[THREADING] 1 is 'one'"),
    "shafts without a comma": ("[THREADING]\n1=1", "[THREADING]\n1=1 2", "[THREADING] 1 is '1 2'"),
    "gap between commas": ("[TIEUP]\n1=1", "[TIEUP]\n1=1,,2", "[TIEUP] 1 is '1,,2'"),
    "comma first": ("[TIEUP]\n1=1", "[TIEUP]\n1=,2", "[TIEUP] 1 is ',2'"),
    "tie-up of no shaft": (
        "[TIEUP]\n1=1",
        "[TIEUP]\n1=9",
        "[TIEUP] 1 names 9; it must be from 0 to 2",
    ),
    "pick without a treadle": (
        "[TREADLING]\n1=1",
        "[TREADLING]\n1=5",
        "[TREADLING] 1 names 5; it must be from 0 to 2, [WEAVING] Treadles",
    ),
    "lift plan of no shaft": ("[TIEUP]", "[LIFTPLAN]\n1=4\n[X]", "[LIFTPLAN] 1 names 4"),
    "two channels": ("1=0,0,0", "1=0,0", "[COLOR TABLE] 1 is '0,0'; it must be red,green,blue"),
    "four channels": ("1=0,0,0", "1=0,0,0,0", "[COLOR TABLE] 1 is '0,0,0,0'"),
    "channel in words": ("1=0,0,0", "1=a,b,c", "[COLOR TABLE] 1 is 'a,b,c'"),
    "channel not a number": ("1=0,0,0", "1=nan,0,0", "[COLOR TABLE] 1 is 'nan,0,0'"),
    "negative channel": ("1=0,0,0", "1=-1,0,0", "[COLOR TABLE] 1 is '-1,0,0'"),
    "channel out of range": (
        "1=0,0,0",
        "1=0,256,0",
        "[COLOR TABLE] 1 is 0,256,0; each number must be from 0 to 255",
    ),
    "colour of no number": (
        "1=0,0,0",
        "black=0,0,0",
        "[WARP COLORS] 1 is '1'; it must be a colour of [COLOR TABLE], whose numbers",
    ),
    "no colour of a number": (
        "1=0,0,0\n2=255,255,255",
        "black=0,0,0",
        "[COLOR TABLE] has the key 'black'; it must be a whole number from 0 to 65535",
    ),
    "range of one": (
        "Range=0,255",
        "Range=5,5",
        "[COLOR PALETTE] Range is '5,5'; it must be two rising numbers",
    ),
    "range in words": ("Range=0,255", "Range=all", "[COLOR PALETTE] Range is 'all'"),
    "range beyond 16 bits": ("Range=0,255", "Range=0,99999", "[COLOR PALETTE] Range is '0,99999'"),
    "palette of another form": (
        "Form=RGB",
        "Form=HSV",
        "[COLOR PALETTE] Form is 'hsv'; it must be RGB",
    ),
    "no such colour": (
        "Color=1",
        "Color=3",
        "[WARP] Color is '3'; it must be a colour of [COLOR TABLE], whose numbers are from 1 to 2",
    ),
    "colour in words": ("Color=2", "Color=white", "[WEFT] Color is 'white'"),
    "thread of no colour": ("[WARP COLORS]\n1=1", "[WARP COLORS]\n1=0", "[WARP COLORS] 1 is '0'"),
    "negative spacing": (
        "Spacing=0.05",
        "Spacing=-0.05",
        "[WARP] Spacing is '-0.05'; it must be 0, or a number from",
    ),
    "spacing not a number": ("Spacing=0.05", "Spacing=nan", "[WARP] Spacing is 'nan'"),
    "endless spacing": ("Spacing=0.05", "Spacing=1e999999", "[WARP] Spacing is '1e999999'"),
    "spacing of a mile": (
        "Spacing=0.05",
        "Spacing=63360",
        "[WARP] Spacing is '63360'; it must be 0, or a number from 3.937e-05 to 39.37 of its unit",
    ),
    "spacing too small": ("Spacing=0.05", "Spacing=1e-9", "[WARP] Spacing is '1e-9'"),
    "spacing in words": ("Spacing=0.05", "Spacing=wide", "[WARP] Spacing is 'wide'"),
    "unknown unit": (
        "Units=Inches",
        "Units=Furlongs",
        "[WARP] Units is 'furlongs'; it must be Decipoints, Inches or Centimeters",
    ),
    "negative thickness": (
        "[WARP COLORS]\n1=1",
        "[WARP THICKNESS]\n2=-1",
        "[WARP THICKNESS] 2 is '-1'",
    ),
}


def broken(case: str) -> str:
    old, new, _ = BAD[case]
    assert old in SMALL
    return SMALL.replace(old, new)


def test_the_good_draft_that_the_bad_ones_come_from_is_good() -> None:
    assert parse_wif(SMALL).warnings == ()


@pytest.mark.parametrize("case", BAD)
def test_a_wrong_draft_is_refused_in_one_line(case: str) -> None:
    with pytest.raises(FabricError) as caught:
        parse_wif(broken(case), "d.wif")
    message = str(caught.value)
    assert BAD[case][2] in message
    assert message.startswith("d.wif ")
    assert len(message) < 300
    assert message.isprintable()


def test_a_warp_that_is_not_counted_is_as_long_as_its_threading() -> None:
    assert parse_wif(SMALL.replace("[WARP]\n", "[X]\n")).weave.ends == 2


FILES = ["missing", "directory", "empty", "binary", "text", "no name", "pipe"]


@pytest.mark.parametrize("kind", FILES)
def test_a_file_that_is_no_draft_is_refused_in_one_line(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "draft.wif"
    if kind == "directory":
        path.mkdir()
    elif kind == "empty":
        path.touch()
    elif kind == "binary":
        path.write_bytes(bytes(range(256)) * 40)
    elif kind == "text":
        path.write_text("Dear weaver,\nplease find = enclosed\n[\n")
    elif kind == "no name":
        path = Path("a\0b.wif")
    elif kind == "pipe":
        if not hasattr(os, "mkfifo"):
            pytest.skip("no pipes in folders here")
        os.mkfifo(path)
    with pytest.raises(FabricError) as caught:
        read_wif(path)
    assert str(caught.value).isprintable()
    assert "draft.wif" in str(caught.value) or kind == "no name"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read all")
def test_a_file_without_permission_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "draft.wif"
    path.write_text(SMALL)
    path.chmod(0)
    with pytest.raises(FabricError, match="Permission denied"):
        read_wif(path)


def test_a_draft_is_not_written_where_it_cannot_be(tmp_path: Path) -> None:
    draft = parse_wif(SMALL)
    with pytest.raises(FabricError, match="not a directory"):
        write_wif(draft, tmp_path / "none" / "d.wif")
    write_wif(draft, tmp_path / "d.wif")
    with pytest.raises(FabricError, match="exists"):
        write_wif(draft, tmp_path / "d.wif", clobber=False)
    assert [p.name for p in tmp_path.iterdir()] == ["d.wif"]
