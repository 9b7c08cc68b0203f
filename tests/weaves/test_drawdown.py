"""Drafts drawn in a terminal."""

from __future__ import annotations

import re
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fabricusd.fabric import Fabric, Weave
from fabricusd.weaves import Draft, draw, parse_weave, read_wif, to_fabric
from fabricusd.weaves.drawdown import MOST_SHAFTS, draw_draft
from fabricusd.weaves.loom import thread_loom
from tests.draft_strategies import drafts
from tests.strategies import fabrics

HALVES = {" ": (0, 0), "▀": (1, 0), "▄": (0, 1), "█": (1, 1)}
ESCAPE = re.compile(r"\x1b\[[0-9;]*m")


def squares(lines: list[str], width: int) -> np.ndarray:
    """(2 len(lines), width) bool: the squares that half blocks fill."""
    out = np.zeros((2 * len(lines), width), bool)
    for y, line in enumerate(lines):
        for x, mark in enumerate(line):
            out[2 * y : 2 * y + 2, x] = HALVES[mark]
    return out


def test_a_twill_is_drawn_as_weavers_draw_it() -> None:
    assert draw(to_fabric(parse_weave("twill 2/1 S")), ascii_only=True).splitlines() == [
        "..#..#..# .##",
        ".#..#..#. #.#",
        "#..#..#.. ##.",
        "",
        ".##.##.## ..#",
        "#.##.##.# .#.",
        "##.##.##. #..",
        ".##.##.## ..#",
        "#.##.##.# .#.",
        "##.##.##. #..",
        ".##.##.## ..#",
        "#.##.##.# .#.",
        "##.##.##. #..",
        "twill 2/1 S: 3 ends x 3 picks, 3 shafts, 3 treadles",
        "end 1 at the left, pick 1 at the bottom; filled: warp on top",
    ]


@given(drafts(largest=12))
def test_half_blocks_and_letters_draw_the_same_squares(draft: Draft) -> None:
    letters = draw_draft(draft, None, None, ascii_only=True).splitlines()[:-2]
    blocks = draw_draft(draft, None, None).splitlines()[:-2]
    width = max(map(len, letters))
    expected = np.array([[c == "#" for c in line.ljust(width)] for line in letters])
    assert np.array_equal(squares(blocks, width)[-len(letters) :], expected)


@given(drafts(largest=12))
def test_threading_tie_up_and_treadling_make_the_drawdown(draft: Draft) -> None:
    loom = thread_loom(draft.weave.cells)
    made = loom.tie_up[np.ix_(loom.treadling, loom.threading)].T
    assert np.array_equal(made, draft.weave.cells)
    assert loom.shafts == len(np.unique(draft.weave.cells, axis=0))
    assert loom.treadles == len(np.unique(draft.weave.cells, axis=1).T)


@pytest.mark.parametrize("name", ["2229", "8452"])
def test_a_real_draft_is_drawn_whole(shared_data: Path, name: str) -> None:
    draft = read_wif(shared_data / f"{name}.wif")
    loom = thread_loom(draft.weave.cells)
    m, n = draft.weave.cells.shape
    lines = draw(to_fabric(draft), width=None, height=None, ascii_only=True).splitlines()[:-2]
    grid = np.array([[c == "#" for c in line.ljust(m + 1 + loom.treadles)] for line in lines])
    assert grid.shape == (loom.shafts + 1 + n, m + 1 + loom.treadles)
    assert np.array_equal(grid[loom.shafts + 1 :, :m].T[:, ::-1], draft.weave.cells)
    # Each end on one shaft, each pick by one treadle.
    assert (grid[: loom.shafts, :m].sum(0) == 1).all()
    assert (grid[loom.shafts + 1 :, m + 1 :].sum(1) == 1).all()


@given(fabrics(), st.integers(1, 60), st.integers(1, 30), st.booleans(), st.booleans())
def test_a_drawing_fits_the_space_it_is_given(
    fabric: Fabric, width: int, height: int, color: bool, ascii_only: bool
) -> None:
    lines = [
        ESCAPE.sub("", line) for line in draw(fabric, width, height, color, ascii_only).split("\n")
    ]
    drawn = next(k for k, line in enumerate(lines) if line.startswith("end 1 at")) - 1
    assert all(len(line) <= max(width, 8) for line in lines[: drawn - 1])
    assert drawn <= max(height, 8 + 3)


def test_what_does_not_fit_is_counted() -> None:
    cells = np.random.default_rng(0).random((100, 200)) < 0.5
    text = draw(Fabric(weave=Weave(cells, "noise")), width=30, height=13)
    assert "… and 70 ends, 180 picks more" in text
    # The first ends and picks are those that are shown.
    shown = squares(text.splitlines()[:10], 30)
    assert np.array_equal(shown[::-1].T, cells[:30, :20])


def test_a_jacquard_is_drawn_without_its_loom() -> None:
    eye = np.eye(MOST_SHAFTS + 1, dtype=bool)
    text = draw(Fabric(weave=Weave(eye, "eye")), width=500, height=500)
    assert "shafts" not in text
    assert "shafts" in draw(Fabric(weave=Weave(eye[1:, 1:], "eye")), width=500, height=500)


def test_colours_are_those_of_the_thread_on_top() -> None:
    text = draw(to_fabric(parse_weave("houndstooth")), color=True)
    assert "\x1b[0;48;2;39;39;39m" in text
    assert "\x1b[0;48;2;231;231;231m" in text
    assert all(line.endswith("\x1b[0m") for line in text.splitlines()[:-2])


def test_without_colour_there_are_no_escapes() -> None:
    assert "\x1b" not in draw(to_fabric(parse_weave("houndstooth")))
    assert draw(to_fabric(parse_weave("houndstooth")), ascii_only=True).isascii()


def test_a_large_jacquard_is_drawn_at_once() -> None:
    cells = np.random.default_rng(0).random((4096, 4096)) < 0.5
    fabric = Fabric(weave=Weave(cells, "jacquard"))
    start = time.process_time()
    draw(fabric)
    assert time.process_time() - start < 2  # measured 0.15 s
