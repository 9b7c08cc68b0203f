"""Kernels that are called without numba's look at the arguments' types."""

from __future__ import annotations

from collections import namedtuple

import numpy as np
import pytest
from numba import njit

from fabricusd.kernels.calls import Calls

Pair = namedtuple("Pair", "a b")


@njit
def total(pair, more):
    return pair.a.sum() + pair.b.sum() + more


def test_a_call_returns_what_the_kernel_does():
    call = Calls()
    for n in (3, 5, 0):
        pair = Pair(np.arange(n), np.full(n, 0.5))
        assert call(total, pair, n) == total(pair, n)


def test_each_object_chooses_for_its_own_arguments():
    whole, real = Calls(), Calls()
    for _ in range(2):
        assert whole(total, Pair(np.arange(3), np.arange(3)), 1) == 7
        assert real(total, Pair(np.full(3, 0.5), np.full(3, 0.25)), 1) == 3.25


def test_errors_of_a_kernel_are_raised():
    @njit
    def first(values):
        if values.size == 0:
            raise ValueError("is empty")
        return values[0]

    call = Calls()
    assert call(first, np.ones(2)) == 1.0
    with pytest.raises(ValueError, match="is empty"):
        call(first, np.ones(0))


@pytest.mark.parametrize(
    "other",
    [np.ones(6, np.float32), np.ones(12)[::2], np.ones((2, 3))],
    ids=["type", "stride", "dimensions"],
)
def test_other_types_are_found_where_calls_are_tested(monkeypatch, other):
    monkeypatch.setattr(Calls, "tested", True)
    call = Calls()
    call(total, Pair(np.ones(3), np.ones(3)), 1)
    with pytest.raises(TypeError, match="total was called with"):
        call(total, Pair(np.ones(3), other), 1)


def test_a_function_that_is_not_compiled_is_called_as_it_is():
    assert Calls()(len, [1, 2]) == 2
