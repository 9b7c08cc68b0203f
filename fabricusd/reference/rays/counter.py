"""A counter-based generator: hashes four counters and maps the hash to a uniform number."""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.kernels.real import INLINE

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
    """Hash four uint32 into four uint32. [Jarzynski2020]"""
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
    """Map a uint32 to a float32 in [0, 1) by its upper 24 bits."""
    return R(np.int32(x >> _U(8))) * R(5.9604645e-08)
