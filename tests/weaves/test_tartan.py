"""Threadcounts: the order of colours that each kind of threadcount stands for."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.errors import FabricError
from fabricusd.weaves.color import parse_color
from fabricusd.weaves.draft import LIMIT
from fabricusd.weaves.tartan import CODES, parse_codes, parse_threadcount
from tests import fuzz

NAMED = {"B": (0.0, 0.0, 1.0), "W": (1.0, 1.0, 1.0), "R": (1.0, 0.0, 0.0)}


def order(text: str) -> str:
    """The threads of a threadcount as letters."""
    letters = {color: code for code, color in NAMED.items()}
    return "".join(letters[color] for color in parse_threadcount(text, NAMED))


@pytest.mark.parametrize(
    ("text", "threads"),
    [
        ("B3 W1 R2", "BBBWRRW"),
        ("B/3 W1 R/2", "BBBWRRW"),
        ("B3W1R/2", "BBBWRRW"),
        ("b3, w1, r2", "BBBWRRW"),
        ("...B3 W1 R2...", "BBBWRR"),
        ("…B3 W1 R2", "BBBWRR"),
        ("B3 W2", "BBBWW"),
        ("B3", "BBB"),
    ],
)
def test_a_threadcount_is_woven_as_weavers_read_it(text: str, threads: str) -> None:
    assert order(text) == threads


@given(st.lists(st.tuples(st.sampled_from("BWR"), st.integers(1, 9)), min_size=1, max_size=6))
def test_a_sett_with_pivots_reads_the_same_backwards_from_the_middle_of_a_pivot(stripes) -> None:
    text = " ".join(f"{code}{count}" for code, count in stripes)
    threads = parse_threadcount(text, NAMED)
    half = stripes[0][1]
    turned = threads[:half] + threads[half:][::-1]
    assert turned == threads


def test_a_code_without_a_given_colour_has_the_shade_of_the_table() -> None:
    assert parse_threadcount("LB2") == (parse_color(CODES["LB"]),) * 2


def test_a_given_colour_precedes_that_of_the_table() -> None:
    colors = parse_codes(["lb=#ffffff"])
    assert parse_threadcount("LB1 K1", colors)[0] == (1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty"),
        ("B24 4", "has '4'"),
        ("B24 W", "has 'W'"),
        ("B24 ?W4", r"has '\?W4'"),
        ("Q4", "has the colour 'Q'; it must be one of"),
        ("B0 W1", "has 'B0'; a count must be from 1 to 16384"),
        ("B99999999 W1", "a count must be from 1 to 16384"),
        ("B2 W/2 R2", "marks 'W/2' as a pivot"),
        ("...B/2 W2", "marks 'B/2' as a pivot"),
        (f"B{LIMIT} W1", f"repeats after {LIMIT + 1} threads"),
    ],
)
def test_what_is_no_threadcount_is_refused_with_the_stripe(text: str, said: str) -> None:
    with pytest.raises(FabricError, match=said) as refusal:
        parse_threadcount(text, None, "--tartan")
    assert str(refusal.value).startswith("--tartan ")


@pytest.mark.parametrize("item", ["B", "B:#fff", "4=#fff", "=#fff", "B=#ff", "B="])
def test_a_palette_that_is_none_is_refused(item: str) -> None:
    with pytest.raises(FabricError, match="--palette"):
        parse_codes([item])


@settings(max_examples=fuzz.examples(100, 20_000))
@given(st.text(st.sampled_from("BWRQ0123456789/. ,…\0é"), max_size=24))
def test_any_text_is_a_threadcount_or_one_line_of_error(text: str) -> None:
    fuzz.refusal(parse_threadcount, text)
