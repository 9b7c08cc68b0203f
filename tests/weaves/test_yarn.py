"""Yarn counts in every unit, and the diameter by Peirce."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.errors import FabricError
from fabricusd.weaves.yarn import (
    TEX,
    count_words,
    diameter,
    fibre_density,
    linear_density,
    parse_count,
)
from tests import fuzz


@pytest.mark.parametrize(
    ("text", "tex"),
    [
        ("20 tex", 20),
        ("20tex", 20),
        ("tex 20", 20),
        ("330 dtex", 33),
        ("150 den", 150 / 9),
        ("150D", 150 / 9),
        ("Td 150", 150 / 9),
        ("Ne 30", 590.54 / 30),
        ("30Ne", 590.54 / 30),
        ("Ne 30/2", 590.54 / 15),
        ("Ne30/2", 590.54 / 15),
        ("Nm 60", 1000 / 60),
        ("Nm 2/60", 2000 / 60),
        ("60/2 Nm", 2000 / 60),
        ("20 tex x 2", 40),
        ("20 x 2 tex", 40),
        ("20x2tex", 40),
    ],
)
def test_a_count_is_read_in_its_unit(text: str, tex: float) -> None:
    assert parse_count(text) / TEX == pytest.approx(tex, rel=1e-5)


@pytest.mark.parametrize(
    "text",
    ["", "20", "tex", "20 foo", "tex 20 tex", "20 tex/2", "Ne 30 x 2", "Ne 0", "-5 tex", "1e3 tex",
     "200000 tex", "0.001 tex", "Ne 30/1.5", "Ne 30/2/2", "9" * 400 + " tex", "٣ tex"],
)  # fmt: skip
def test_what_is_no_count_is_refused_with_its_place(text: str) -> None:
    with pytest.raises(FabricError, match=r"^--yarn is '"):
        parse_count(text, "--yarn")


@given(st.text(st.sampled_from("0123456789 ./x*NETtexdnm\0é"), max_size=16))
@settings(max_examples=fuzz.examples(100, 20_000))
def test_any_text_is_a_count_or_one_line_of_error(text: str) -> None:
    fuzz.refusal(parse_count, text)


@pytest.mark.parametrize("ne", [5, 20, 40, 100])
def test_the_diameter_of_cotton_is_that_of_peirce(ne: float) -> None:
    """Peirce (1937): 1 / (28 sqrt(Ne)) inch, which he rounds."""
    assert diameter(parse_count(f"Ne {ne}")) == pytest.approx(
        0.0254 / (28 * math.sqrt(ne)), rel=0.003
    )


@given(st.floats(1e-5, 1e-2), st.floats(900, 2600), st.floats(0.3, 0.9))
def test_a_diameter_is_that_of_its_linear_density(thick: float, fibre: float, packing: float):
    assert diameter(linear_density(thick, fibre, packing), fibre, packing) == pytest.approx(thick)


def test_a_lighter_fibre_makes_a_thicker_yarn() -> None:
    count = parse_count("20 tex")
    assert diameter(count, fibre_density("nylon")) > diameter(count, fibre_density("cotton"))


def test_a_fibre_that_is_not_known_is_refused() -> None:
    with pytest.raises(FabricError, match="--fibre is 'hemp'; it must be one of cotton, linen"):
        fibre_density("hemp")


def test_a_count_is_told_in_every_unit() -> None:
    assert count_words(20 * TEX) == "20 tex, Ne 29.5, Nm 50, 180 denier"
