"""Noise along a thread and from thread to thread, whose mean vanishes as fast as a mean can.

The noise of a thread is a cubic B-spline over a lattice of hashed numbers in which the neighbours
2i and 2i + 1 are opposite. Whole pairs sum to nothing, so the mean over a window falls as one over
its length, where that of independent numbers falls as the root of it. Each thread has a phase of
its own: otherwise all threads would be even where the two of a pair meet. Numbers from thread to
thread are opposite in pairs, too.

A hash of 32 bits makes three independent numbers: for the width, for the shade, and for where the
thread lies.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import INLINE

Floats = NDArray[np.float64]

_U = np.uint32


@njit(**INLINE)
def mixed(x):
    """Hash 32 bits to 32 bits: `lowbias32` of [Wellons2018]."""
    x = _U(x)
    x = _U(x ^ _U(x >> _U(16)))
    x = _U(x * _U(0x7FEB352D))
    x = _U(x ^ _U(x >> _U(15)))
    x = _U(x * _U(0x846CA68B))
    return _U(x ^ _U(x >> _U(16)))


@njit(**INLINE)
def hashed(key, number):
    """Hash `number` (int32) under a key."""
    return mixed(_U(key + _U(_U(number) * _U(0x9E3779B1))))


@njit(**INLINE)
def first(R, h):
    """The lowest 11 bits of a hash as a number in (-1, 1)."""
    return R(np.int32(h & _U(0x7FF))) * R(2.0**-10) - R(1.0 - 2.0**-11)


@njit(**INLINE)
def second(R, h):
    """The next 11 bits of a hash as a number in (-1, 1)."""
    return R(np.int32(_U(h >> _U(11)) & _U(0x7FF))) * R(2.0**-10) - R(1.0 - 2.0**-11)


@njit(**INLINE)
def third(R, h):
    """The upper 10 bits of a hash as a number in (-1, 1)."""
    return R(np.int32(h >> _U(22))) * R(2.0**-9) - R(1.0 - 2.0**-10)


@njit(**INLINE)
def along(R, key, x):
    """Three independent noises of a thread at x (float64) in lattice distances, |x| below 2^30.

    Their variance is VARIANCE, and they lie within PEAK of 0. There is no branch, so that LLVM can
    vectorise the loop around.
    """
    x += float(R(np.int32(key & _U(0xFFFF)))) * 2.0**-15
    whole = np.floor(x)
    t, i = R(x - whole), np.int32(whole)
    s = R(1) - t
    b0, b3 = s * s * s, t * t * t
    b1 = R(4) - t * t * (R(6) - R(3) * t)
    b2 = R(6) - b0 - b1 - b3
    a = np.int32(np.int32(i - 1) >> 1)
    odd = R(np.int32(i & 1))
    even = R(1) - odd
    c0 = odd * (b0 - b1) - even * b0
    c1 = odd * (b2 - b3) + even * (b1 - b2)
    c2 = even * b3
    h0, h1, h2 = hashed(key, a), hashed(key, np.int32(a + 1)), hashed(key, np.int32(a + 2))
    sixth = R(1.0 / 6.0)
    return (
        sixth * (c0 * first(R, h0) + c1 * first(R, h1) + c2 * first(R, h2)),
        sixth * (c0 * second(R, h0) + c1 * second(R, h1) + c2 * second(R, h2)),
        sixth * (c0 * third(R, h0) + c1 * third(R, h1) + c2 * third(R, h2)),
    )


@njit(**INLINE)
def between(R, seed, number):
    """Three independent numbers in (-1, 1) of a thread (int32); those of 2k and 2k + 1 are
    opposite."""
    h = hashed(_U(~seed), np.int32(number >> 1))
    sign = R(1) - R(2) * R(np.int32(number & 1))
    return sign * first(R, h), sign * second(R, h), sign * third(R, h)


def _transfer(window: float, steps: int = 64) -> Floats:
    """(phases, lattice points) weights of the lattice points in the mean over `window` lattice
    distances, at phases over two of them."""
    reach = math.ceil(window / 2) + 4
    t = np.arange(-2, 2, 1.0 / steps) + 0.5 / steps
    a = np.abs(t)
    spline = np.where(a < 1, (4 - 6 * a**2 + 3 * a**3) / 6, np.maximum(2 - a, 0) ** 3 / 6)
    total = np.concatenate(([0.0], np.cumsum(spline))) / steps
    phase = np.arange(2 * steps) / steps
    lattice = np.arange(-2 * reach, 2 * reach)
    ends = np.concatenate((t - 0.5 / steps, [2.0]))
    half = max(window, 1.0 / steps) / 2
    right, left = (
        np.interp(phase[:, None] + side * half - lattice, ends, total) for side in (1, -1)
    )
    return np.asarray((right - left) / (2 * half))


def variance(window: float) -> float:
    """Variance of the mean of a noise over `window` lattice distances."""
    w = _transfer(window)
    pairs = w[:, 0::2] - w[:, 1::2]
    return float((pairs**2).sum(axis=1).mean() / 3.0)


VARIANCE = variance(0.0)

PEAK = float(np.abs(_transfer(0.0)[:, 0::2] - _transfer(0.0)[:, 1::2]).sum(axis=1).max())
"""The greatest value that a noise can have."""
