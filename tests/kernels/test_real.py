"""Elementary functions in both precisions against NumPy and SciPy in float64."""

import re

import numpy as np
import pytest
from numba import njit
from scipy import special

from fabricusd.kernels import real

UNCACHED = {**real.KERNEL, "cache": False}


@njit(**UNCACHED)
def _map(R, x, out, row):
    for k in range(x.size):
        out[k] = (
            real.exp(R, x[k])
            if row == 0
            else real.log(R, x[k])
            if row == 1
            else real.sin(R, x[k])
            if row == 2
            else real.cos(R, x[k])
            if row == 3
            else real.asin(R, x[k])
            if row == 4
            else real.acos(R, x[k])
            if row == 5
            else real.erf(R, x[k])
            if row == 6
            else real.erfinv(R, x[k])
            if row == 7
            else real.i0e(R, x[k])
        )


BESSEL_ARGUMENTS = np.concatenate((np.linspace(0, 60, 100_001), np.geomspace(60, 1e12, 999)))
ERF_ARGUMENTS = np.linspace(-3.7, 3.7, 200_001)
# name: (row, reference, arguments, float32 bound relative, absolute, float64 bound relative)
FUNCTIONS = {
    "exp": (0, np.exp, np.linspace(-87.0, 88.0, 400_001), 2e-7, 0.0, 4e-16),
    "log": (1, np.log, np.exp(np.linspace(-80.0, 80.0, 400_001)), 2e-7, 1e-7, 4e-16),
    "sin": (2, np.sin, np.linspace(-100.0, 100.0, 400_001), 0.0, 2e-7, 4e-16),
    "cos": (3, np.cos, np.linspace(-100.0, 100.0, 400_001), 0.0, 2e-7, 4e-16),
    "asin": (4, np.arcsin, np.linspace(-1.0, 1.0, 400_001), 4e-7, 0.0, 4e-16),
    "acos": (5, np.arccos, np.linspace(-1.0, 1.0, 400_001), 4e-7, 0.0, 4e-16),
    "erf": (6, special.erf, np.linspace(-6.0, 6.0, 400_001), 4e-7, 2e-7, 8e-16),
    "i0e": (8, special.i0e, BESSEL_ARGUMENTS, 4e-7, 0.0, 4e-15),
}


def _apply(R, row, x):
    x = np.ascontiguousarray(x, R)
    out = np.empty_like(x)
    _map(R, x, out, row)
    return x.astype(np.float64), out.astype(np.float64)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_stays_within_its_bound_in_float32(name):
    row, reference, arguments, relative, absolute, _ = FUNCTIONS[name]
    x, got = _apply(np.float32, row, arguments)
    want = reference(x)
    error = np.abs(got - want)
    allowed = np.maximum(relative * np.abs(want), absolute)
    worst = np.argmax(error - allowed)
    assert error[worst] <= allowed[worst], (x[worst], got[worst], want[worst])


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_is_accurate_to_rounding_in_float64(name):
    row, reference, arguments, _, _, relative = FUNCTIONS[name]
    x, got = _apply(np.float64, row, arguments)
    want = reference(x)
    assert np.all(np.abs(got - want) <= relative * np.abs(want) + 1e-15)


@pytest.mark.parametrize(("R", "bound"), [(np.float32, 5e-7), (np.float64, 4e-16)])
def test_erf_undoes_erfinv(R, bound):
    y, x = _apply(R, 7, special.erf(ERF_ARGUMENTS))
    inside = np.abs(y) < 1
    assert np.max(np.abs(special.erf(x[inside]) - y[inside])) <= bound


def test_erfinv_keeps_its_precision_far_out_in_float64():
    # 1 - y is exact here, so the tail is as well determined as the middle.
    tail = 2.0 ** -np.arange(1.0, 53.0)
    _, x = _apply(np.float64, 7, 1.0 - tail)
    np.testing.assert_allclose(special.erfc(x), tail, rtol=1e-12)


def test_erfinv_is_finite_at_and_beyond_one():
    for R in (np.float32, np.float64):
        _, x = _apply(R, 7, [-1.0, 1.0, -2.0, 2.0])
        assert np.all(np.isfinite(x))
        assert np.all(np.abs(x) > 3)


@pytest.mark.parametrize("R", [np.float32, np.float64])
@pytest.mark.parametrize("row", range(9))
def test_nan_comes_out_where_nan_went_in(R, row):
    with np.errstate(invalid="ignore"):
        _, got = _apply(R, row, [np.nan] * 17)
    assert np.all(np.isnan(got))


def test_exp_reaches_its_limits():
    _, got = _apply(np.float32, 0, [-np.inf, -1e30, -88.0, 0.0, np.inf])
    assert got.tolist() == [0.0, 0.0, 0.0, 1.0, np.inf]


@njit(**UNCACHED)
def _angles(R, y, x, out):
    for k in range(x.size):
        out[k] = real.atan2(R, y[k], x[k])


@pytest.mark.parametrize(("R", "bound"), [(np.float32, 4e-7), (np.float64, 4e-16)])
def test_atan2_agrees_all_round_and_on_the_axes(R, bound):
    turn = np.concatenate((np.linspace(-np.pi, np.pi, 100_001), np.arange(-4, 5) * np.pi / 4))
    y, x = np.sin(turn).astype(R), np.cos(turn).astype(R)
    y = np.append(y, np.array([0, 0, 1, -1, 0, 3e-20], R))
    x = np.append(x, np.array([1, -1, 0, 0, 0, 1e-20], R))
    out = np.empty_like(x)
    _angles(R, y, x, out)
    want = np.arctan2(y.astype(np.float64), x.astype(np.float64))
    assert np.all(np.abs(out - want) <= bound * np.maximum(np.abs(want), 1e-30))


@njit(**UNCACHED)
def _all_of_them(R, x, out):
    for k in range(x.size):
        a = min(abs(x[k]), R(0.9))
        out[k] = (
            real.exp(R, a) + real.log(R, a) + real.sin(R, a) + real.cos(R, a) + real.asin(R, a)
            + real.acos(R, a) + real.atan2(R, a, x[k]) + real.erf(R, a) + real.erfinv(R, a)
            + real.i0e(R, a)
        )  # fmt: skip


def test_float32_loops_are_vectorised_without_a_call():
    x = np.linspace(0, 1, 64, dtype=np.float32)
    _all_of_them(np.float32, x, np.empty_like(x))
    (asm,) = _all_of_them.inspect_asm().values()
    assert not re.search(
        r"\b(expf?|logf?|sinf?|cosf?|atan2f?|erff?|floorf?|sqrtf?)\b\s*$", asm, re.M
    )
    (ir,) = _all_of_them.inspect_llvm().values()
    assert re.search(r"<(4|8|16) x float>", ir), "LLVM did not vectorise the loop"
