"""Colours in the order of threads, `4*#111 4*#eee`: how tartans and stripes are written."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.errors import FabricError
from fabricusd.weaves.color import color_order
from tests import fuzz


def test_counts_repeat_the_colour_that_follows() -> None:
    assert color_order(["2*#000", "#fff"], "--warp-color") == ((0, 0, 0), (0, 0, 0), (1, 1, 1))


@pytest.mark.parametrize("count", ["0", "-1", "16385", "9" * 5000, "x", "1.5", "\0", "٣٣٣٣٣٣٣٣٣٣"])
def test_a_count_that_is_none_is_refused_in_one_line(count: str) -> None:
    with pytest.raises(FabricError, match=r"--warp-color has the count '.*from 1 to 16384") as said:
        color_order([f"{count}*#fff"], "--warp-color")
    assert str(said.value).isprintable()
    assert len(str(said.value)) < 200


@settings(max_examples=fuzz.examples(100, 20_000))
@given(st.lists(st.text(st.sampled_from("#0123456789abcdef*,.- e\0é"), max_size=12), max_size=4))
def test_any_order_is_a_list_of_colours_or_one_line_of_error(items: list[str]) -> None:
    fuzz.refusal(color_order, items, "--warp-color")
