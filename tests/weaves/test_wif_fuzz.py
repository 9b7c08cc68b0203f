"""WIF files that are damaged: a draft or one line of error, in bounded time and memory."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.weaves import draw, parse_wif, read_wif, to_fabric, wif_text
from fabricusd.weaves.draft import LIMIT
from fabricusd.weaves.wif.lines import KEYS, NUMBERED
from tests import fuzz
from tests.wif_samples import SMALL, TWILL


def test_a_small_file_that_asks_for_the_largest_cloth_gets_it_in_bounded_time() -> None:
    text = re.sub("Threads=2", "Threads=1024", SMALL, count=1)
    text = re.sub("Threads=2", f"Threads={LIMIT}", text, count=1)
    with fuzz.guarded(seconds=10, megabytes=100):  # measured 0.1 s; the cells are 16 MB
        assert parse_wif(text).weave.cells.shape == (1024, LIMIT)


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


LINE = st.builds(
    "{}={}".format,
    st.integers(-1, 6) | st.sampled_from(["Threads", "Color", "Shafts", "Spacing", "Units", "x"]),
    st.lists(st.integers(-1, 5), max_size=4).map(lambda n: ",".join(map(str, n)))
    | st.sampled_from(["", "true", "inches", "0.05", "1e999", "nan", "999999", "x", "1 2", "0,5"]),
)
NAMES = st.sampled_from([*KEYS, *NUMBERED, "PRIVATE X Y", "DEFAULT", "CONTENTS", ""])


@st.composite
def grammar(draw: st.DrawFn) -> str:
    """A file of WIF's sections with lines of its form, most of them of no sense."""
    whole = [SMALL] if draw(st.booleans()) else ["[WIF]"]
    for _ in range(draw(st.integers(0, 6))):
        name, lines = draw(NAMES), draw(st.lists(LINE, max_size=5))
        whole.append("\n".join([f"[{name}]", *lines]))
    return "\n".join(whole)


def drawn_or_refused(data: bytes, path: Path) -> None:
    """Fail where a draft is neither refused in one line nor woven, written and read again."""
    path.write_bytes(data)
    drafts = []
    if fuzz.refusal(lambda: drafts.append(read_wif(path))):
        return
    draft = drafts[0]
    if draft.weave.cells.size > 10**6:  # what follows is not the reader's
        return
    assert parse_wif(wif_text(draft), str(path)).weave == draft.weave
    fuzz.refusal(lambda: draw(to_fabric(draft)))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "damaged.wif"


@settings(max_examples=fuzz.examples(300, 10_000))
@given(mutations(), st.sampled_from(["utf-8", "latin-1", "utf-16"]))
def test_a_damaged_draft_is_read_or_refused_in_one_line(
    path: Path, text: str, encoding: str
) -> None:
    drawn_or_refused(text.encode(encoding, "replace"), path)


@settings(max_examples=fuzz.examples(150, 10_000))
@given(grammar())
def test_sections_in_any_order_and_of_any_sense_are_read_or_refused(path: Path, text: str) -> None:
    drawn_or_refused(text.encode(), path)


@settings(max_examples=fuzz.examples(150, 80_000))
@given(fuzz.mutated([SMALL.encode(), TWILL.encode(), SMALL.encode("utf-16")]))
def test_bytes_thrown_into_a_draft_are_read_or_refused_in_one_line(path: Path, data: bytes) -> None:
    drawn_or_refused(data, path)
