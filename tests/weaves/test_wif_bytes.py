"""Bytes that are no tidy text: a draft all the same, or one line of what the file is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.weaves import parse_wif, read_wif
from tests.wif_samples import TWILL, TWILL_CELLS

HOSTILE = Path(__file__).parents[1] / "cases" / "hostile"

SAME = {
    "utf-8 mark": TWILL.encode("utf-8-sig"),
    "utf-16 with its mark": TWILL.encode("utf-16"),
    "utf-16 little end first, no mark": TWILL.encode("utf-16-le"),
    "utf-16 big end first, no mark": TWILL.encode("utf-16-be"),
    "utf-32 with its mark": TWILL.encode("utf-32"),
    "mixed line ends": b"".join(
        line.encode() + (b"\n", b"\r\n", b"\r", b"\n\r")[k % 4]
        for k, line in enumerate(TWILL.splitlines())
    ),
    "zeros at the end of lines": TWILL.replace("\n", "\0\n").encode(),
    "zeros at the end of the file": TWILL.encode() + b"\0" * 500,
    "a mark in the middle": TWILL.replace("[WARP]", "\ufeff[WARP]").encode(),
    "the mark twice": b"\xef\xbb\xbf" + TWILL.encode("utf-8-sig"),
    "no line end at the end": TWILL.rstrip().encode(),
    "the end of a DOS file": TWILL.encode() + b"\x1a",
    "hard blanks": TWILL.replace("=", "\xa0=\xa0").replace("[", "\xa0[").encode(),
    "hard blanks of windows": TWILL.replace("=", "\xa0=\xa0").encode("cp1252"),
    "separators of ASCII before lines": TWILL.replace("\n", "\n\x1f").encode(),
    "wide blanks before lines": TWILL.replace("\n", "\n\u2003\u3000").encode(),
}  # fmt: skip


@pytest.mark.parametrize("case", SAME)
def test_a_draft_is_read_from_untidy_bytes(tmp_path: Path, case: str) -> None:
    (tmp_path / "d.wif").write_bytes(SAME[case])
    assert np.array_equal(read_wif(tmp_path / "d.wif").weave.cells, TWILL_CELLS)


def test_a_value_does_not_go_on_in_an_indented_line() -> None:
    """An INI parser joins the two and loses the second treadle."""
    text = TWILL.replace("2=2,3\n", "\u20032=2,3\n")
    assert np.array_equal(parse_wif(text).weave.cells, TWILL_CELLS)


REFUSED = {
    "three odd lines": (HOSTILE / "wif_attributeerror_min.wif").read_bytes(),
    "a key, and a separator that looks like an indentation": b"[WIF]\ny\n\x1f_e",
    "zeros": b"\0" * 1000,
    "a mark and nothing": b"\xff\xfe",
    "half a character": b"\xff\xfe[",
    "all bytes": bytes(range(256)) * 4,
    "utf-16 cut in the middle": TWILL.encode("utf-16")[:101],
    "brackets": b"[" * 3000 + b"]" * 3000,
    "the section alone": b"[WIF]",
}


@pytest.mark.parametrize("case", REFUSED)
def test_bytes_that_are_no_draft_are_refused_in_one_line(tmp_path: Path, case: str) -> None:
    (tmp_path / "d.wif").write_bytes(REFUSED[case])
    with pytest.raises(FabricError) as caught:
        read_wif(tmp_path / "d.wif")
    assert str(caught.value).startswith(f"{tmp_path / 'd.wif'} ")
    assert str(caught.value).isprintable()


DTX = b"@@StartDTX\r\n%%version 1\r\n\r\n@@Info\r\n%%shafts 4\r\n\r\n@@Threading\r\n1 2 3 4\r\n"
OTHERS = {
    "a draft of Fiberworks": ("a.dtx", DTX, "is a .dtx draft (Fiberworks); export it as WIF"),
    "the same in capitals": ("A.DTX", DTX, "is a .dtx draft (Fiberworks); export it as WIF"),
    "the same under WIF's name": ("a.wif", DTX, "is a .dtx draft (Fiberworks); export it as WIF"),
    "the same with a mark": ("a.wif", b"\xef\xbb\xbf" + DTX, "is a .dtx draft (Fiberworks)"),
    "the same in UTF-16": ("a.wif", DTX.decode().encode("utf-16"), "is a .dtx draft (Fiberworks)"),
    "the same after empty lines": ("a.wif", b"\r\n\r\n" + DTX, "is a .dtx draft (Fiberworks)"),
    "known by its name alone": ("a.dtx", b"hello", "is a .dtx draft (Fiberworks), judging by"),
    "a draft of WeavePoint": ("a.wpo", b"\x7b\0\1\2\3\4", "is a .wpo draft (WeavePoint)"),
    "a draft of TempoWeave": ("a.wif", b"PK\3\4\x14\0\0", "is a ZIP archive, as TempoWeave's .twa"),
    "a picture": ("a.wif", b"\x89PNG\r\n\x1a\n\0\0", "is a PNG picture; read it with --image"),
    "a USD layer": ("a.wif", b"#usda 1.0\n(\n)\n", "is a USD layer; it must be a WIF draft"),
}  # fmt: skip


@pytest.mark.parametrize("case", OTHERS)
def test_a_file_of_another_kind_is_called_what_it_is(tmp_path: Path, case: str) -> None:
    name, data, message = OTHERS[case]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(FabricError) as caught:
        read_wif(tmp_path / name)
    assert str(caught.value).startswith(f"{tmp_path / name} {message}")


def test_a_wif_draft_under_another_name_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.dtx").write_text(TWILL)
    assert np.array_equal(read_wif(tmp_path / "a.dtx").weave.cells, TWILL_CELLS)
