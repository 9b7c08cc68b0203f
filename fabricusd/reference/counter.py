"""Random numbers that are a function of pixel, sample, vertex and seed, and of nothing else.

[Jarzynski2020] `pcg4d`: four 32-bit counters in, four hashed 32-bit numbers out. No state, so a
picture does not depend on how many workers made it or in which order.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.appearance.real import INLINE

R = np.float32
_U = np.uint32


@njit(**INLINE)
def _mix(x, y, z, w):
    x = _U(x + y * w)
    y = _U(y + z * x)
    z = _U(z + x * y)
    w = _U(w + y * z)
    return x, y, z, w


@njit(**INLINE)
def pcg4d(a, b, c, d):
    """Hash four uint32 into four uint32."""
    x = _U(_U(a) * _U(1664525) + _U(1013904223))
    y = _U(_U(b) * _U(1664525) + _U(1013904223))
    z = _U(_U(c) * _U(1664525) + _U(1013904223))
    w = _U(_U(d) * _U(1664525) + _U(1013904223))
    x, y, z, w = _mix(x, y, z, w)
    x = _U(x ^ (x >> _U(16)))
    y = _U(y ^ (y >> _U(16)))
    z = _U(z ^ (z >> _U(16)))
    w = _U(w ^ (w >> _U(16)))
    return _mix(x, y, z, w)


@njit(**INLINE)
def unit_float(x):
    """A uint32 as a float32 in [0, 1), by its upper 24 bits."""
    return R(np.int32(x >> _U(8))) * R(5.9604645e-08)


@njit(**INLINE)
def four_uniform(pixel, sample, dimension, seed):
    """Four independent float32 in [0, 1)."""
    x, y, z, w = pcg4d(pixel, sample, dimension, seed)
    return unit_float(x), unit_float(y), unit_float(z), unit_float(w)
