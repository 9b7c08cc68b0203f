"""WIF files that are damaged: a draft or one line of error, in bounded time."""

from __future__ import annotations

import re
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wif_samples import SMALL

from fabricusd.errors import FabricError
from fabricusd.schema.weaves import draw, parse_wif, read_wif, to_fabric, wif_text
from fabricusd.schema.weaves.draft import LIMIT


def test_a_small_file_that_asks_for_the_largest_cloth_gets_it_in_bounded_time() -> None:
    start = time.perf_counter()
    text = re.sub("Threads=2", "Threads=1024", SMALL, count=1)
    text = re.sub("Threads=2", f"Threads={LIMIT}", text, count=1)
    assert parse_wif(text).weave.cells.shape == (1024, LIMIT)
    assert time.perf_counter() - start < 20


LINES = SMALL.splitlines()
JUNK = st.sampled_from(
    [
        *("", "[", "]", "=", "1", "0", "-1", "1,2", "9999", ";", "nan", "é", "\0", "1=1", "1=2,1"),
        *("[WARP]", "[LIFTPLAN]", "[WEFT SPACING]", "Threads=", "Threads=3", "Range=0,999"),
        "Rising Shed=0",
    ]
)


@st.composite
def mutations(draw: st.DrawFn) -> str:
    """SMALL with a few lines dropped, doubled, swapped, cut, joined or replaced."""
    lines = list(LINES)
    for _ in range(draw(st.integers(1, 6))):
        if not lines:
            break
        k = draw(st.integers(0, len(lines) - 1))
        at = draw(st.integers(0, len(lines[k])))
        other = draw(st.integers(0, len(lines) - 1))
        junk = draw(JUNK)
        kind = draw(st.integers(0, 6))
        if kind == 0:
            del lines[k]
        elif kind == 1:
            lines.insert(other, lines[k])
        elif kind == 2:
            lines[k], lines[other] = lines[other], lines[k]
        elif kind == 3:
            lines[k] = lines[k][:at]
        elif kind == 4:
            lines[k] = lines[k][:at] + junk + lines[k][at:]
        elif kind == 5:
            lines[k] = junk
        else:
            del lines[k:]
    return "\n".join(lines)


def drawn_or_refused(data: bytes, path: Path) -> str:
    """The message of a refusal, or "" for a draft that can be woven, drawn and written again."""
    path.write_bytes(data)
    start = time.perf_counter()
    try:
        draft = read_wif(path)
    except FabricError as error:
        return str(error)
    finally:
        assert time.perf_counter() - start < 5
    assert parse_wif(wif_text(draft), str(path)).weave == draft.weave
    try:
        draw(to_fabric(draft))
    except FabricError as error:
        return str(error)
    return ""


@settings(max_examples=400)
@given(mutations(), st.sampled_from(["utf-8", "latin-1", "utf-16"]))
def test_a_damaged_draft_is_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, text: str, encoding: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.wif"
    assert drawn_or_refused(text.encode(encoding, "replace"), path).isprintable()


@settings(max_examples=200)
@given(st.binary(max_size=300), st.integers(0, len(SMALL)), st.integers(0, 40))
def test_bytes_thrown_into_a_draft_are_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, junk: bytes, at: int, drop: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "junk.wif"
    good = SMALL.encode()
    assert drawn_or_refused(good[:at] + junk + good[at + drop :], path).isprintable()
