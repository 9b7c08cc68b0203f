"""Weave expressions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.errors import FabricError
from fabricusd.weaves import parse_weave
from tests import fuzz


def slow_cells(expression: str, ends: int, picks: int) -> np.ndarray:
    """(ends, picks) bool, cell by cell with Python's own arithmetic."""
    names = {"mod": lambda a, n: a % n}
    code = compile(expression, "test", "eval")
    return np.array(
        [[bool(eval(code, names, {"i": i, "j": j})) for j in range(picks)] for i in range(ends)]
    )


def tiled(expression: str, ends: int, picks: int) -> np.ndarray:
    cells = parse_weave(expression).weave.cells
    i, j = np.arange(ends) % cells.shape[0], np.arange(picks) % cells.shape[1]
    return cells[np.ix_(i, j)]


FORMS = [
    "mod(i + j, 2) == 0",
    "mod(i + j, 4) < 2",
    "mod(2*i + j, 5) != 0",
    "mod(3*i - 2*j + 7, 10) >= 4",
    "mod(-i - j - 3, 7) <= 1",
    "mod(j - i, 6) > 3",
    "(i + 2*j) % 6 == 1",
    "not mod(i, 2) == 1",
    "mod(i, 3) == 0 and mod(j, 4) < 2 or mod(i + j, 6) == 5",
    "mod(i, 6) < mod(j, 4)",
    "1 <= mod(i + j, 5) < 3",
    "mod(mod(i + j, 12), 5) == 1",
    "mod(2*(i + 3*(j - 1)) + 0*i, 9) < 4",
    "1 == 1",
]


@pytest.mark.parametrize("expression", FORMS)
def test_the_repeat_tiles_to_what_the_expression_says(expression: str) -> None:
    assert np.array_equal(tiled(expression, 26, 31), slow_cells(expression, 26, 31))


@given(
    st.integers(-50, 50), st.integers(-50, 50), st.integers(-50, 50), st.integers(1, 24),
    st.integers(-1, 25), st.sampled_from(["==", "!=", "<", "<=", ">", ">="]),
)  # fmt: skip
def test_any_comparison_repeats_as_its_numbers_imply(
    a: int, b: int, c: int, n: int, k: int, sign: str
) -> None:
    expression = f"mod({a}*i + {b}*j + {c}, {n}) {sign} {k}"
    assert np.array_equal(tiled(expression, 26, 26), slow_cells(expression, 26, 26))


@pytest.mark.parametrize(
    ("expression", "shape"),
    [
        ("mod(i + j, 6) < 3", (6, 6)),
        ("mod(2*i + 3*j, 6) < 3", (3, 2)),
        ("mod(i, 4) == 0 or mod(j, 6) == 0", (4, 6)),
        ("mod(i, 4) == 0 and mod(i, 6) == 0", (12, 1)),
        ("scale(mod(i + j, 2) == 0, 3, 2)", (6, 4)),
        ("shift(mod(i + j, 5) == 0, 7, -2)", (5, 5)),
    ],
)
def test_the_repeat_is_the_shortest_that_the_numbers_imply(
    expression: str, shape: tuple[int, int]
) -> None:
    assert parse_weave(expression).weave.cells.shape == shape


def test_shift_moves_the_pattern_and_scale_repeats_its_cells() -> None:
    inner = "mod(2*i + j, 5) == 0"
    cells = parse_weave(inner).weave.cells
    moved = parse_weave(f"shift({inner}, 2, -1)").weave.cells
    assert np.array_equal(moved, np.roll(cells, (2, -1), (0, 1)))
    grown = parse_weave(f"scale({inner}, 3, 2)").weave.cells
    assert np.array_equal(grown, np.repeat(np.repeat(cells, 3, 0), 2, 1))
    both = parse_weave(f"scale(shift({inner}, 1, 0), 2, 1)").weave.cells
    assert np.array_equal(both, np.repeat(np.roll(cells, 1, 0), 2, 0))


@pytest.mark.parametrize(
    ("expression", "name"),
    [
        ("mod(i + j, 2) == 0", "plain"),
        ("mod(i + j, 5) == 0", "twill 1/4 S"),
        ("mod(j - i, 3) < 2", "twill 2/1 Z"),
        ("mod(2*i + j, 5) != 0", "satin 5 step 2"),
        ("mod(2*i + j, 5) == 0", "satin 5 step 2 weft"),
        ("scale(mod(i + j, 2) == 0, 2, 2)", "basket 2/2"),
        ("mod(i, 7) == 0 or mod(j, 3) == 0", "mod(i, 7) == 0 or mod(j, 3) == 0"),
    ],
)
def test_a_weave_is_called_what_it_is_whatever_it_was_written_as(
    expression: str, name: str
) -> None:
    assert parse_weave(expression).weave.name == name


def test_the_published_satin_is_reported_to_be_a_twill() -> None:
    warning = parse_weave("mod(i + j, 5) == 0").warnings
    assert len(warning) == 1
    assert "is a twill 1/4 S; a satin of 5 needs a step of 2" in warning[0]
    assert parse_weave("mod(i + j, 2) == 0").warnings == ()
    assert parse_weave("mod(2*i + j, 5) == 0").warnings == ()


LARGEST = {
    "two terms": "mod(1235*i + 17*j, 4096) < 99 and not mod(i - j, 1024) == 3",
    "as many terms as there may be": " or ".join(["mod(i + j, 4096) == 1"] * 8),
    "as deep as they may be": f"{'mod(' * 15}i + j{', 4096)' * 15} == 1",
    "scaled and shifted": "shift(scale(mod(i + j, 512) == 0, 8, 8), 999999, -999999)",
}


@pytest.mark.parametrize("case", LARGEST)
def test_the_largest_repeat_costs_no_more_than_its_cells(case: str) -> None:
    """128 MB beside the 16 of the cells, and time that does not grow with what is looked at."""
    with fuzz.guarded(seconds=10, megabytes=128):  # measured 0.1 to 0.5 s
        assert parse_weave(LARGEST[case]).weave.cells.shape == (4096, 4096)


BAD = {
    "much over a large repeat": (
        " or ".join(["mod(i + j, 4096) == 1"] * 9), "of that size it must have at most 16"
    ),
    "open bracket": ("mod(i + j, 5 == 0", "cannot be read"),
    "two equal signs missing": ("mod(i, 2) = 0", "cannot be read"),
    "number alone": ("mod(i, 3)", "is a number; it must be a comparison"),
    "truth in arithmetic": ("mod(mod(i, 2) == 0, 3) == 1", "it must be a number"),
    "number as truth": ("mod(i, 2) or mod(j, 2) == 0", "'mod(i, 2)' must be a comparison"),
    "i alone": ("i < 3", "'i' grows without end"),
    "unknown name": ("mod(k, 3) == 0", "'k' is not a sum of whole multiples of i and j"),
    "product of i and j": ("mod(i*j, 3) == 0", "'i * j' is not a sum of whole multiples"),
    "division": ("mod(i/2, 3) == 0", "'i / 2' is not a sum of whole multiples"),
    "power": ("mod(9**9**9, 3) == 0", "is not a sum of whole multiples"),
    "fraction": ("mod(i, 3) == 0.5", "'0.5' is not a sum of whole multiples"),
    "boolean": ("mod(i, 3) == True", "'True' is not a sum of whole multiples"),
    "string": ("mod(i, 3) == 'a'", "is not a sum of whole multiples"),
    "zero modulus": ("mod(i, 0) == 0", "'mod' divides by 0; the divisor must be at least 1"),
    "negative modulus": ("mod(i, -3) == 0", "'mod' divides by -3"),
    "modulus of i": ("mod(3, i) == 0", "'i' must be a whole number"),
    "scale by zero": ("scale(mod(i, 2) == 0, 0, 1)", "'scale' is by 0 x 1"),
    "too few arguments": ("mod(i) == 0", "'mod' has 1 arguments; it must have 2"),
    "keyword": ("mod(i, n=3) == 0", "'mod' has 2 arguments; it must have 2"),
    "unknown function": ("abs(i) == 0", "'abs' is not known; it must be mod, shift or scale"),
    "code": ("__import__('os').system('true') == 0", "is not known"),
    "attribute": ("(i).real == 0", "is not a sum of whole multiples"),
    "lambda": ("(lambda: i)() == 0", "is not known"),
    "comprehension": ("[i for i in (1, 2)] == 0", "is not a sum of whole multiples"),
    "membership": ("mod(i, 3) in (1, 2)", "must use =="),
    "huge number": ("mod(i, 99999999) == 0", "has a number above 1000000"),
    "huge sum": ("mod(999999*i + 999999*i, 3) == 0", "has a number above 1000000"),
    "huge repeat": ("mod(i, 4093) == 0 or mod(i, 4091) == 0", "repeats after 16744463 x 1"),
    "huge scale": ("scale(mod(i, 2) == 0, 9999, 1)", "repeats after 19998 x 1"),
    "too long": ("mod(i, 2) == 0 or " * 100, "characters long; it must be at most 1000"),
    "too deep": ("not " * 200 + "mod(i, 2) == 0", "is nested 20"),
    "too many brackets": ("(" * 400 + "i" + ")" * 400, "cannot be read"),
    "too many signs": ("-" * 900 + "i == 0", "is nested 90"),
    "too many terms": (" or ".join(["mod(i,2)==0"] * 40), "has 80 comparisons and calls"),
    "too many comparisons in a row": (
        "mod(i, 2)" + " == 1" * 40,
        "has 41 comparisons and calls; it must have at most 32",
    ),
    "null": ("mod(i, 2) == 0\0", "cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_weave_expression_is_refused_in_one_line(case: str) -> None:
    text, message = BAD[case]
    with pytest.raises(FabricError) as caught:
        parse_weave(text)
    assert str(caught.value).startswith("weave expression '")
    assert message in str(caught.value)
    assert str(caught.value).isprintable()


def woven_or_refused(text: str) -> None:
    fuzz.refusal(parse_weave, text)


@settings(max_examples=fuzz.examples(60, 20_000))
@given(st.text(st.sampled_from("ij0123 ()+-*%<>=!,modshiftcalenr"), max_size=40))
def test_any_text_is_a_weave_or_one_line_of_error(text: str) -> None:
    woven_or_refused(text)


WORDS = st.sampled_from(
    [
        *("i", "j", "k", "0", "1", "2", "3", "-1", "7", "1000000", "99999999999999999999", "0.5"),
        *("1e9", "0x10", "True", "None", "'a'", "b'a'", "f'{i}'", "mod", "shift", "scale", "abs"),
        *("(", ")", "[", "]", "{", "}", ",", "+", "-", "*", "**", "/", "//", "%", "@", "~", "^"),
        *("==", "!=", "<", "<=", ">", ">=", "=", ":=", "and", "or", "not", "in", "is", "if"),
        *("else", "lambda", ":", "for", "await", ".", "...", ";", "\n", "\t", "\\", "#", "\0", "é"),
    ]
)  # fmt: skip


@settings(max_examples=fuzz.examples(60, 20_000))
@given(st.lists(WORDS, max_size=16))
def test_any_words_of_the_language_are_a_weave_or_one_line_of_error(words: list[str]) -> None:
    woven_or_refused(" ".join(words))


@settings(max_examples=fuzz.examples(60, 50_000))
@given(fuzz.mutated([text.encode() for text in (*FORMS, *LARGEST.values())], fuzz.TOKENS))
def test_any_damaged_expression_is_a_weave_or_one_line_of_error(data: bytes) -> None:
    woven_or_refused(data.decode("latin-1"))


NUMBERS = st.integers(-12, 70) | st.sampled_from([0, 1, 4093, 4096, 10**6, 10**6 + 1, 2**63])
LINEAR = st.recursive(
    st.sampled_from(["i", "j"]) | NUMBERS.map(str),
    lambda inner: (
        st.builds("({} {} {})".format, inner, st.sampled_from("+-*"), inner)
        | st.builds("-{}".format, inner)
    ),
    max_leaves=6,
)
PERIODIC = st.recursive(
    st.builds("mod({}, {})".format, LINEAR, NUMBERS)
    | st.builds("({}) % {}".format, LINEAR, NUMBERS),
    lambda inner: st.builds("mod({}, {})".format, inner, NUMBERS),
    max_leaves=3,
)  # fmt: skip
SIGNS = st.sampled_from(["==", "!=", "<", "<=", ">", ">=", "in"])
TRUTHS = st.recursive(
    st.builds("{} {} {}".format, PERIODIC, SIGNS, NUMBERS | PERIODIC | LINEAR),
    lambda inner: (
        st.builds("({}) {} ({})".format, inner, st.sampled_from(["and", "or"]), inner)
        | st.builds("not ({})".format, inner)
        | st.builds(
            "{}({}, {}, {})".format, st.sampled_from(["shift", "scale"]), inner, NUMBERS, NUMBERS
        )
    ),
    max_leaves=5,
)


@settings(max_examples=fuzz.examples(60, 10_000))
@given(TRUTHS)
def test_any_sentence_of_the_grammar_is_a_weave_or_one_line_of_error(text: str) -> None:
    woven_or_refused(text)


def test_the_grammar_of_the_fuzzer_weaves_more_often_than_not() -> None:
    counts = [0, 0]

    @settings(max_examples=200)
    @given(TRUTHS)
    def try_one(text: str) -> None:
        counts[bool(fuzz.refusal(parse_weave, text))] += 1

    try_one()
    assert counts[0] > 30, counts
