"""What `cat` says of a weave."""

from __future__ import annotations

import numpy as np
from hypothesis import given

from fabricusd.schema import load
from fabricusd.schema.describe import curve_words, in_words
from fabricusd.weaves.floats import longest_float
from tests.strategies import weaves


def runs_by_walking(line):
    """Longest run of True round a ring, None if it never ends; by walking it twice."""
    if all(line):
        return None
    longest = run = 0
    for value in [*line, *line]:
        run = run + 1 if value else 0
        longest = max(longest, run)
    return longest


@given(weaves())
def test_the_longest_float_is_the_one_found_by_walking_every_thread(weave):
    for axis, lines in ((1, weave.cells), (0, ~weave.cells.T)):
        found = [runs_by_walking(line) for line in lines]
        expected = None if None in found else max(found)
        assert longest_float(weave.cells, axis) == expected


def test_floats_are_told_across_the_border_of_the_repeat():
    cells = np.array([[True, False, False, True]])
    assert longest_float(cells, 1) == 2


def test_a_curve_is_told_with_its_jumps():
    assert curve_words(load("velvet").threads["Pile2"].curve) == "curve -90 -55 | 55 90 degrees"
    assert curve_words(load("silk_shot").threads["Red"].curve) == "straight"


def test_a_color_order_is_told_as_weavers_write_it():
    words = in_words(load("polyester_satin_charmeuse"))
    assert "100 ends/cm (254/inch)" in words
    assert "covers 90 %; Flat" in words
