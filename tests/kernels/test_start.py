"""What is set before numba compiles the first kernel."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from fabricusd.kernels.internals import use_internals
from fabricusd.kernels.start import CACHE_LINE


@njit
def _addresses(out):  # type: ignore[no-untyped-def]
    kept = np.zeros(1)
    for k in range(out.size):
        # Of odd sizes, so that one does not happen to begin where another ends.
        room = np.empty(13 * k + 5, np.float32)
        room[0] = k
        kept[0] += room[0]
        out[k] = room.ctypes.data
    return kept[0]


@pytest.mark.skipif(not use_internals(), reason="numba's internals are not used")
def test_arrays_of_kernels_begin_on_lines_of_the_cache():
    found = np.zeros(64, np.int64)
    _addresses(found)
    assert (found % CACHE_LINE == 0).all()
