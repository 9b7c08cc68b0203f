"""Functions chosen by number, and tuples written out, as kernels use them."""

import numpy as np
from numba import njit

from fabricusd.kernels.choice import by_number, for_each, specialised
from fabricusd.kernels.real import INLINE, KERNEL
from fabricusd.kernels.unrolled import sum_of_products, tuple_of, tuple_reader

R = np.float64


@njit(**INLINE)
def _double(R, x):
    return R(2) * x


@njit(**INLINE)
def _square(R, x):
    return x * x


@njit(**INLINE)
def _note(R, number, out):
    out[number] += R(number + 1)


_chosen = by_number({0: _double, 3: _square, 5: _double})
_noted = specialised(_note, (1, 2))
_noted_all = for_each(_note, (0, 2, 3))
_read = tuple_reader(3, stride=2)
_dot = sum_of_products(3)


@njit(**INLINE)
def _power(R, k, x):
    return x**k


_powers = tuple_of(_power, 3)


@njit(**KERNEL)
def _polynomial(R, x):
    return _dot(_powers(R, x), (1.0, 2.0, 3.0))


@njit(**KERNEL)
def _apply(R, number, x):
    return _chosen(R, number, x)


@njit(**KERNEL)
def _note_one(R, number, out):
    _noted(R, number, out)


@njit(**KERNEL)
def _note_all(R, out):
    _noted_all(R, out)


@njit(**KERNEL)
def _sum(numbers, first):
    a, b, c = _read(numbers, first)
    return a + 10 * b + 100 * c


def test_each_number_calls_its_own_function():
    assert [_apply(R, k, 7.0) for k in (0, 3, 5)] == [14.0, 49.0, 14.0]


def test_a_loop_is_specialised_for_each_of_its_numbers():
    out = np.zeros(4)
    _note_one(R, 2, out)
    _note_one(R, 1, out)
    assert out.tolist() == [0, 2, 3, 0]


def test_for_each_runs_all_numbers_once():
    out = np.zeros(4)
    _note_all(R, out)
    assert out.tolist() == [1, 0, 3, 4]


def test_a_tuple_is_read_from_an_array_in_strides():
    assert _sum(np.arange(10), 1) == 1 + 30 + 500


def test_a_tuple_is_made_of_numbered_entries():
    assert _polynomial(R, 2.0) == 1 + 4 + 12
