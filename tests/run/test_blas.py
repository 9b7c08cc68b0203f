"""Linear algebra has one thread while any context asks for it, and its own again after the last."""

from __future__ import annotations

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from fabricusd.run.blas import one_blas_thread
from fabricusd.run.spread import spread


def threads() -> set[int]:
    np.linalg.inv(np.eye(3))
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def seen(_: None, __: int) -> set[int]:
    return threads()


@pytest.fixture(autouse=True)
def two():
    with threadpool_limits(2, "blas"):
        if threads() != {2}:
            pytest.skip("this BLAS has one thread")
        yield


def test_contexts_that_overlap_end_in_any_order():
    first, second = one_blas_thread(), one_blas_thread()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert threads() == {1}
    second.__exit__(None, None, None)
    assert threads() == {2}


def test_an_error_ends_a_context():
    with pytest.raises(ValueError), one_blas_thread():
        raise ValueError
    assert threads() == {2}


@pytest.mark.parametrize("place", [1, 2])
def test_parts_of_a_step_have_one(place):
    assert spread("parts", seen, None, [0, 1, 2], place) == [{1}] * 3
    assert threads() == {2}
