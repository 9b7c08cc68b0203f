"""Corners that share their values are found exactly."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from fabricusd.bake.layout.equal_rows import numbered_rows

FEW = st.sampled_from([0.0, -0.0, 1.0, 2.5, -1e-30, 1e30])


@given(arrays(np.float32, array_shapes(min_dims=2, max_dims=2, max_side=12), elements=FEW))
def test_rows_have_one_number_exactly_where_they_are_equal(rows):
    first, number = numbered_rows(rows.T)
    assert np.array_equal(rows[first][number], rows)
    assert len(first) == len(np.unique(rows, axis=0))
    # Counted as they come: the first of each kind, in the order of the rows.
    assert np.array_equal(first, np.sort(first))
    assert np.array_equal(first, [int(np.argmax(number == k)) for k in range(len(first))])


def test_rows_that_a_sum_or_an_exclusive_or_would_confuse_are_told_apart():
    places = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    rows = np.concatenate((places, places[::-1], places[:, ::-1]))
    first, number = numbered_rows(rows.T)
    assert len(first) == 8
    assert np.array_equal(number[:8], number[8:16][::-1])
