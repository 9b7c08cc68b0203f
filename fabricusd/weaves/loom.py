"""The set-up of a loom for a weave: threading, tie-up and treadling."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Loom(NamedTuple):
    """A loom with as few shafts and treadles as the weave allows; each thread uses one of them.

    threading : (m,) int - the shaft of each end, from 0
    treadling : (n,) int - the treadle of each pick, from 0
    tie_up : (treadles, shafts) bool - True where the treadle raises the shaft
    """

    threading: NDArray[np.int64]
    treadling: NDArray[np.int64]
    tie_up: NDArray[np.bool_]

    @property
    def shafts(self) -> int:
        """Number of distinct ends."""
        return int(self.tie_up.shape[1])

    @property
    def treadles(self) -> int:
        """Number of distinct picks."""
        return int(self.tie_up.shape[0])


def thread_loom(cells: NDArray[np.bool_]) -> Loom:
    """The loom for `cells` (m, n); `tie_up[treadling[j], threading[i]] == cells[i, j]`.

    Equal ends share a shaft and equal picks a treadle; both are numbered in order of appearance.
    """
    threading, ends = _distinct_rows(cells)
    treadling, picks = _distinct_rows(cells.T)
    return Loom(threading, treadling, cells[np.ix_(ends, picks)].T)


def _distinct_rows(cells: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """((rows,) int number of each row, (k,) int row at which each number first appears)."""
    bits = np.ascontiguousarray(np.packbits(cells, axis=1))
    whole = bits.view(np.dtype((np.void, bits.shape[1]))).ravel()
    _, first, number = np.unique(whole, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank[number], first[order]
