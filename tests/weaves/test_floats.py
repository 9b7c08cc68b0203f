"""Floats, on both sides of the cloth, and how they are kept short."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fabricusd.weaves import parse_weave
from fabricusd.weaves.floats import Floats, bound_floats, describe_floats, floats, long_float_words


@pytest.mark.parametrize(
    ("weave", "lengths"),
    [
        ("plain", (1, 1, 1, 1)),
        ("twill 3/1", (3, 1, 1, 3)),
        ("satin 8", (7, 1, 1, 7)),
        ("satin 8 weft", (1, 7, 7, 1)),
    ],
)
def test_the_floats_of_a_named_weave(weave: str, lengths: tuple[int, ...]) -> None:
    found = floats(parse_weave(weave).weave.cells)
    assert found == Floats(*lengths)
    assert found.longest == max(lengths)


def test_a_thread_without_a_crossing_floats_without_end() -> None:
    cells = np.array([[True, True], [True, False]])
    assert floats(cells).warp_face is None
    assert floats(cells).longest is None
    assert "past all picks" in long_float_words(cells)


def test_floats_are_described_by_the_longer_side() -> None:
    words = describe_floats(Floats(7, 1, 1, 7))
    assert words == "warp over up to 7 picks, weft over up to 7 ends"


def test_short_floats_are_left_as_they_are() -> None:
    cells = parse_weave("satin 8").weave.cells
    bounded, ties = bound_floats(cells, 7)
    assert ties == 0
    assert np.array_equal(bounded, cells)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(4, 12), st.sampled_from((0.02, 0.5, 0.98)))
def test_blocks_of_any_size_are_tied_within_the_bound(
    seed: int, longest: int, share: float
) -> None:
    rng = np.random.default_rng(seed)
    blocks = rng.random((6, 5)) < share
    cells = np.kron(blocks, np.ones((9, 11), bool))
    bounded, ties = bound_floats(cells, longest)
    assert floats(bounded).longest is not None
    assert floats(bounded).longest <= longest
    assert ties == np.count_nonzero(bounded != cells)


def test_a_uniform_side_is_tied_too() -> None:
    bounded, _ = bound_floats(np.ones((40, 40), bool), 8)
    assert floats(bounded).longest <= 8
