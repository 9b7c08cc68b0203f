"""The noise of threads against its formula in NumPy, and the pairs that make its mean vanish."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from fabricusd.appearance.weave.yarn.noise import PEAK, VARIANCE, along, between, hashed, variance
from fabricusd.kernels.real import KERNEL

R = np.float64
U = np.uint32


def mixed(x):
    """`noise.mixed` of (n,) uint32."""
    x = np.asarray(x, np.uint64) & np.uint64(0xFFFFFFFF)
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        x ^= x >> np.uint64(shift)
        x = x * np.uint64(factor) & np.uint64(0xFFFFFFFF)
    return x ^ (x >> np.uint64(16))


def lattice(key, i):
    """(3, n) numbers in (-1, 1) at lattice points i (n,): 2k and 2k + 1 are opposite."""
    h = mixed(
        np.uint64(key) + np.uint64(0x9E3779B1) * (np.asarray(i // 2) % 2**32).astype(np.uint64)
    )
    bits = (h & np.uint64(0x7FF), (h >> np.uint64(11)) & np.uint64(0x7FF), h >> np.uint64(22))
    sign = np.where(i % 2 == 0, 1.0, -1.0)
    return [
        sign * ((b + 0.5) / half - 1.0) for b, half in zip(bits, (1024, 1024, 512), strict=True)
    ]


def spline(t):
    """The cubic B-spline on (-2, 2)."""
    a = np.abs(t)
    return np.where(a < 1, (4 - 6 * a**2 + 3 * a**3) / 6, np.maximum(2 - a, 0) ** 3 / 6)


@njit(**{**KERNEL, "cache": False})
def along_all(R, key, x, out):
    for k in range(x.size):
        out[0, k], out[1, k], out[2, k] = along(R, key, x[k])


@njit(**{**KERNEL, "cache": False})
def between_all(R, seed, out):
    for k in range(out.shape[1]):
        out[0, k], out[1, k], out[2, k] = between(R, seed, np.int32(k - out.shape[1] // 2))


def noises(key, x):
    out = np.empty((3, len(x)))
    along_all(R, U(key), x, out)
    return out


@pytest.mark.parametrize("key", [0, 1, 0xFFFFFFFF, 123456789])
def test_the_noise_is_a_spline_over_hashes_in_opposite_pairs(key):
    x = np.random.default_rng(key % 97).uniform(-50, 50, 500)
    at = x + (key & 0xFFFF) * 2.0**-15
    first = np.floor(at).astype(np.int64)
    expected = np.zeros((3, len(x)))
    for o in range(-1, 3):
        expected += spline(at - first - o) * lattice(key, first + o)
    assert np.allclose(noises(key, x), expected, atol=1e-12)


def test_the_noise_has_the_variance_and_the_bound_that_are_stated():
    x = np.arange(4000.0) * 3.7
    found = np.concatenate([noises(hash_ * 7919, x).ravel() for hash_ in range(50)])
    assert found.var() == pytest.approx(VARIANCE, rel=0.02)
    assert abs(found).max() <= PEAK
    assert abs(found.mean()) < 4 * np.sqrt(VARIANCE / found.size) * 3


def test_the_variance_of_means_over_windows_is_what_the_formula_says():
    fine = np.arange(0, 4096, 1 / 16)
    found = np.stack([noises(k * 104729 + 5, fine)[0] for k in range(40)])
    for window in (1, 2, 8):
        means = found.reshape(40, -1, 16 * window).mean(axis=2)
        assert means.var() == pytest.approx(variance(float(window)), rel=0.05), window


def test_a_mean_falls_as_one_over_the_length_of_the_window():
    """Independent numbers fall as the root of it: a quarter of the deviation takes 16 times the
    length, not 4."""
    assert np.sqrt(variance(64.0) / variance(16.0)) == pytest.approx(0.25, rel=0.1)


def test_threads_are_opposite_in_pairs():
    out = np.empty((3, 2000))
    between_all(R, U(99), out)
    assert np.allclose(out[:, 0::2] + out[:, 1::2], 0.0)
    assert abs(out[:, ::2].mean()) < 0.05
    assert out.var() == pytest.approx(1 / 3, rel=0.05)


def test_the_three_numbers_of_a_hash_are_independent():
    x = np.arange(20000.0) * 2.3
    found = noises(4242, x)
    assert np.abs(np.corrcoef(found) - np.eye(3)).max() < 0.03


def test_hashes_of_neighbours_share_no_bits():
    @njit(**{**KERNEL, "cache": False})
    def fill(out):
        for k in range(out.size):
            out[k] = hashed(U(17), np.int32(k))

    out = np.empty(1 << 14, np.uint32)
    fill(out)
    bits = (out[:, None] >> np.arange(32, dtype=np.uint32) & 1).astype(float)
    assert np.abs(bits.mean(axis=0) - 0.5).max() < 0.02
    flips = bits[1:] != bits[:-1]
    assert np.abs(flips.mean(axis=0) - 0.5).max() < 0.02
