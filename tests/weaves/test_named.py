"""Weaves by name, and the names of weaves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.errors import FabricError
from fabricusd.weaves import parse_color, parse_weave
from fabricusd.weaves.named import DARK, LIGHT, WEAVES
from fabricusd.weaves.recognise import recognise, shortest_repeat
from tests import fuzz


def picture(text: str) -> list[str]:
    """The drawdown as weavers draw it: last pick on top, `#` where the warp is."""
    cells = parse_weave(text).weave.cells
    return ["".join(".#"[int(c)] for c in row) for row in cells.T[::-1]]


PICTURES = {
    "plain": [".#", "#."],
    "basket 2/1": ["..##", "##.."],
    "basket 2": ["..##", "..##", "##..", "##.."],
    # Z rises to the right, S falls.
    "twill 1/2 Z": ["..#", ".#.", "#.."],
    "twill 1/2 S": [".#.", "..#", "#.."],
    "twill 2/2": ["..##", ".##.", "##..", "#..#"],
    "twill 3/1/1/3": [
        "...#.###", "..#.###.", ".#.###..", "#.###...", ".###...#", "###...#.", "##...#.#",
        "#...#.##",
    ],
    # mod(2 i + j, 5) == 0: the tie goes two picks down from end to end.
    "satin 5 step 2 weft": ["...#.", ".#...", "....#", "..#..", "#...."],
    "satin 5 step 2": ["###.#", "#.###", "####.", "##.##", ".####"],
    "herringbone 2/2 4": ["..##..##", ".##.#..#", "##..##..", "#..#.##."],
    "point 1/3 4": ["...#..", "..#.#.", ".#...#", "#....."],
    "houndstooth": ["..##", ".##.", "##..", "#..#"],
    "ripstop 5": [".#.##", ".#.##", "#.#..", ".#.##", "#.#.."],
    "ripstop 4/2": [
        ".#..#.##", ".#..#.##", "#.##.#..", ".#..#.##", "#.##.#..", "#.##.#..", ".#..#.##",
        "#.##.#..",
    ],
}  # fmt: skip


@pytest.mark.parametrize("text", PICTURES)
def test_a_named_weave_is_the_one_that_weavers_draw(text: str) -> None:
    assert picture(text) == PICTURES[text]


def test_a_diamond_is_the_same_from_all_four_sides() -> None:
    cells = parse_weave("diamond 2/2 5").weave.cells
    assert cells.shape == (8, 8)
    assert np.array_equal(np.roll(cells[::-1], 1, 0), cells)
    assert np.array_equal(np.roll(cells[:, ::-1], 1, 1), cells)


def test_every_registered_weave_is_made_by_its_own_example() -> None:
    for name, entry in WEAVES.items():
        draft = parse_weave(entry.form)
        assert draft.weave.name.split()[0] == name
        assert draft.title == draft.weave.name


@pytest.mark.parametrize("count", range(5, 41))
def test_a_satin_has_one_tie_an_end_and_none_beside_another(count: int) -> None:
    for step in range(2, count - 1):
        text = f"satin {count} step {step} weft"
        if math.gcd(step, count) > 1:
            with pytest.raises(FabricError, match=f"step is {step}|has no possible step"):
                parse_weave(text)
            continue
        tie = parse_weave(text).weave.cells
        assert (tie.sum(0) == 1).all()
        assert (tie.sum(1) == 1).all()
        assert not (tie & np.roll(tie, (1, 1), (0, 1))).any()
        assert not (tie & np.roll(tie, (1, -1), (0, 1))).any()
        assert np.array_equal(parse_weave(f"satin {count}/{step}").weave.cells, ~tie)


def test_a_twill_would_fail_the_test_of_a_satin() -> None:
    tie = parse_weave("twill 1/4 S").weave.cells
    assert (tie & np.roll(tie, (1, -1), (0, 1))).any()


@given(st.lists(st.integers(1, 5), min_size=2, max_size=6).filter(lambda r: len(r) % 2 == 0))
def test_a_twill_moves_one_pick_from_end_to_end(runs: list[int]) -> None:
    text = "/".join(map(str, runs))
    for hand, step in (("Z", 1), ("S", -1)):
        cells = parse_weave(f"twill {text} {hand}").weave.cells
        assert cells.shape == (sum(runs), sum(runs))
        for i in range(len(cells)):
            assert np.array_equal(np.roll(cells[i], step), cells[(i + 1) % len(cells)])
        end = [over for k, run in enumerate(runs) for over in [k % 2 == 0] * run]
        assert cells[0].tolist() == end


def test_a_herringbone_breaks_where_its_stripes_meet() -> None:
    cells = parse_weave("herringbone 2/2 8").weave.cells
    assert np.array_equal(cells[7], ~cells[8])
    assert np.array_equal(cells[15], ~cells[0])
    assert np.array_equal(cells[:8], np.tile(parse_weave("twill 2/2 Z").weave.cells, (2, 1)))


def test_a_point_twill_does_not_break() -> None:
    cells = parse_weave("point 2/2 8").weave.cells
    assert np.array_equal(cells[6], cells[8])
    assert not any(np.array_equal(cells[k], ~cells[(k + 1) % 14]) for k in range(14))


def test_houndstooth_has_four_dark_and_four_light_threads_both_ways() -> None:
    draft = parse_weave("Houndstooth")
    assert draft.palette == (DARK, LIGHT)
    assert draft.warp_colors == draft.weft_colors == (0, 0, 0, 0, 1, 1, 1, 1)


BAD = {
    "nothing": ("", "weave '' is not known"),
    "a knit": ("single jersey", "weave 'single jersey' is knitted, not woven"),
    "a rib, which is woven too": ("rib", "weave 'rib' is not known"),
    "a ripstop without room": (
        "ripstop 5/4",
        "cords of 4 in 5 threads; that number must be from 2",
    ),
    "a ripstop of three numbers": ("ripstop 8/2/2", "has 3 numbers; it must have 2, threads/cord"),
    "unknown": ("velvet", "weave 'velvet' is not known; it must be one of plain"),
    "misspelt": ("twil 2/1", "did you mean 'twill'"),
    "extra word": ("plain 2", "'2' is not expected here"),
    "one run": ("twill 2", "pairs of over and under"),
    "zero run": ("twill 2/0", "'0' is not a whole number of at least 1"),
    "negative run": ("twill 2/-1", "'-1' is not a whole number"),
    "fraction": ("twill 1.5/2", "'1.5' is not a whole number"),
    "no numbers": ("twill", "is incomplete; write it as in twill 2/1 S"),
    "wrong hand": ("twill 2/1 X", "'x' is not expected here"),
    "three blocks": ("basket 1/2/3", "has 3 numbers; it must have 2"),
    "huge block": ("basket 999999", "at most 4096"),
    "huge run": ("twill 4096/1", "'4096/1' is 4097 threads; it must be at most 4096"),
    "huge width": ("herringbone 2/2 4000", "repeat is 8000 x 4; it must be at most 4096"),
    "satin of nothing": ("satin", "is missing its number of threads"),
    "satin without a step": ("satin 6", "has no possible step; a satin must have 5, 7 or more"),
    "satin too small": ("satin 4", "has no possible step"),
    "satin step not prime": ("satin 8 step 2", "step is 2; with 8 threads it must be 3, 5"),
    "satin step 1": ("satin 5 step 1", "step is 1; with 5 threads it must be 2, 3"),
    "satin step missing": ("satin 5 step", "must be one number"),
    "satin step twice": ("satin 5/2 step 3", "must be one number"),
    "satin face unknown": ("satin 5 step 2 both", "'both' is not expected here"),
    "point too narrow": ("point 2/2 1", "turns every 1 ends; that number must be at least 2"),
    "unprintable": ("twill \x1b[2J", "'twill ?"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_names_no_weave_is_refused_in_one_line(case: str) -> None:
    text, message = BAD[case]
    with pytest.raises(FabricError) as caught:
        parse_weave(text)
    assert message in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "text",
    [
        "plain", "basket 2/2", "basket 1/3", "twill 2/1 S", "twill 1/3 Z", "twill 3/1/1/3 S",
        "twill 2/2 Z", "satin 5 step 2", "satin 5 step 3 weft", "satin 8 step 5",
        "satin 7 step 4 weft",
    ],
)  # fmt: skip
@pytest.mark.parametrize("shift", [(0, 0), (1, 0), (2, 3)])
@pytest.mark.parametrize("copies", [(1, 1), (2, 3)])
def test_a_weave_is_recognised_wherever_its_repeat_starts(
    text: str, shift: tuple[int, int], copies: tuple[int, int]
) -> None:
    cells = np.roll(np.tile(parse_weave(text).weave.cells, copies), shift, (0, 1))
    assert recognise(cells) == text


def test_what_has_no_name_is_not_given_one() -> None:
    assert recognise(parse_weave("herringbone 2/2 8").weave.cells) == ""
    assert recognise(parse_weave("point 2/2 5").weave.cells) == ""
    assert recognise(np.zeros((100, 100), bool)) == ""
    assert recognise(np.ones((3, 3), bool)) == "warp only"
    assert recognise(np.zeros((3, 2), bool)) == "weft only"


@given(st.integers(0, 2**12 - 1), st.integers(1, 3), st.integers(1, 3))
def test_the_shortest_repeat_makes_the_whole_again(bits: int, a: int, b: int) -> None:
    part = np.array([bool(bits >> k & 1) for k in range(12)]).reshape(3, 4)
    whole = np.tile(part, (a, b))
    small = shortest_repeat(whole)
    assert small.shape[0] <= 3
    assert small.shape[1] <= 4
    copies = (whole.shape[0] // small.shape[0], whole.shape[1] // small.shape[1])
    assert np.array_equal(np.tile(small, copies), whole)


WORDS = st.sampled_from(
    [
        *WEAVES,
        *("S", "Z", "step", "weft", "warp", "x", "", "é", "\0", "/", "-", "2/2", "3/1/1/3", "8/3"),
        *("1/0", "0/1", "9999/9999", "4096", "4097", "1/" * 400 + "1", "9" * 5000, "-1", "2.5"),
    ]
)


@settings(max_examples=fuzz.examples(100, 20_000))
@given(st.sampled_from(list(WEAVES)), st.lists(WORDS | st.integers(0, 99).map(str), max_size=5))
def test_any_words_after_a_name_are_a_weave_or_one_line_of_error(
    name: str, words: list[str]
) -> None:
    fuzz.refusal(parse_weave, " ".join([name, *words]))


@settings(max_examples=fuzz.examples(100, 20_000))
@given(st.text(st.sampled_from("#0123456789abcdefgnif.,- +e\0٣"), max_size=12))
def test_any_text_is_a_colour_or_one_line_of_error(text: str) -> None:
    fuzz.refusal(parse_color, text)
