"""Functions compiled as parts of kernels, and called by Python after all."""

from __future__ import annotations

import pytest
from numba import njit

from fabricusd.kernels.internals import use_internals
from fabricusd.kernels.parts import PartCompiler, _PartLibrary

pytestmark = pytest.mark.skipif(not use_internals(), reason="this run uses numba as it is")


@njit(pipeline_class=PartCompiler)
def square(x):
    return x * x


@njit(pipeline_class=PartCompiler)
def alone(x):
    return x * x + 1.0


@njit
def twice_the_square(x):
    return 2.0 * square(x)


def test_a_part_is_made_for_its_callers_and_still_answers_python():
    assert twice_the_square(3.0) == 18.0
    (made,) = square.overloads.values()
    assert isinstance(made.library, _PartLibrary)
    assert square(3.0) == 9.0
    assert twice_the_square(4.0) == 32.0


def test_a_part_that_python_calls_first_is_compiled_as_ever():
    assert alone(3.0) == 10.0
