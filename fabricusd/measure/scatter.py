"""The two terms of a thread's scattering, apart: what a fit needs, since `f_s` is linear in both.

`appearance.thread.evaluate` returns their sum on all workers. This evaluation stays on the calling
thread and releases Python's lock, so that many fits run beside one another. Neither builds a table
for sampling; `conserving` has tables of its own energy, which are kept for threads seen before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.thread import terms, thread_row
from fabricusd.fabric import Thread
from fabricusd.kernels.real import KERNEL

Floats = NDArray[np.float64]


class Terms(NamedTuple):
    """`f_s = surface + volume A` per channel [1/sr].

    surface, volume : (n,) float
    """

    surface: Floats
    volume: Floats


def split(thread: Thread, wi: Floats, wo: Floats, model: str) -> Terms:
    """The terms of `thread` for (n, 3) unit vectors in its frame; its albedo is not used."""
    i = np.ascontiguousarray(np.asarray(wi, np.float64).T)
    o = np.ascontiguousarray(np.asarray(wo, np.float64).T)
    surface, volume = np.empty(i.shape[1]), np.empty(i.shape[1])
    _split(np.float64, thread_row(thread, model), i, o, surface, volume)
    return Terms(surface, volume)


@njit(**KERNEL)
def _split(R, row, wi, wo, surface, volume):  # type: ignore[no-untyped-def]
    for k in range(surface.size):
        surface[k], volume[k] = terms(
            R, row, wi[0, k], wi[1, k], wi[2, k], wo[0, k], wo[1, k], wo[2, k]
        )
