"""Display codes and linear colours."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.errors import FabricError
from fabricusd.srgb import linear_from_srgb, srgb_from_linear
from fabricusd.weaves.color import (
    codes_from_palette,
    palette_from_codes,
    parse_color,
)


def test_transfer_functions_are_those_of_colour_science() -> None:
    colour = pytest.importorskip("colour")
    v = np.linspace(0, 1, 4097)
    assert np.allclose(linear_from_srgb(v), colour.eotf(v, "sRGB"), rtol=1e-12, atol=1e-15)
    assert np.allclose(srgb_from_linear(v), colour.eotf_inverse(v, "sRGB"), rtol=1e-12, atol=1e-15)


def test_a_plain_power_is_told_apart_from_the_transfer_function() -> None:
    v = np.linspace(0, 1, 257)
    assert np.abs(linear_from_srgb(v) - v**2.2).max() > 5e-3


@pytest.mark.parametrize("high", [255, 999, 65535])
def test_every_display_code_survives_being_linear(high: int) -> None:
    codes = np.arange(3 * (high // 3 + 1)).reshape(-1, 3).clip(max=high)
    assert np.array_equal(codes_from_palette(palette_from_codes(codes, 0, high), 0, high), codes)


def test_a_range_that_does_not_start_at_zero_is_shifted() -> None:
    assert palette_from_codes([[10, 110, 60]], 10, 110)[0] == pytest.approx((0, 1, 0.21404114))
    assert codes_from_palette(palette_from_codes([[10, 110, 60]], 10, 110), 10, 110).tolist() == [
        [10, 110, 60]
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("#ffffff", (1, 1, 1)),
        ("#000", (0, 0, 0)),
        ("#F00", (1, 0, 0)),
        ("#808080", (0.21586050,) * 3),
        ("0.2,0.8,1", (0.2, 0.8, 1)),
        (" 0, 0 ,2.5 ", (0, 0, 2.5)),
    ],
)
def test_a_colour_is_read_from_display_hex_or_linear_numbers(
    text: str, expected: tuple[float, ...]
) -> None:
    assert parse_color(text) == pytest.approx(expected)


@pytest.mark.parametrize(
    "text",
    ["", "#12345", "redd", "lab(50,0)", "lab(150,0,0)", "1,2", "nan,0,0", "inf,0,0", "-1,0,0", "#"],
)
def test_what_is_no_colour_is_refused_with_its_place(text: str) -> None:
    with pytest.raises(
        FabricError, match=r"--warp-color is .*(must be #rrggbb|must have three numbers)"
    ):
        parse_color(text, "--warp-color")
