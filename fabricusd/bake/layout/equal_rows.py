"""Number the distinct rows of arrays, to find corners that share all their values."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def numbered_rows(columns: Iterable[NDArray[Any]]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """(k,) index of the first of each set of equal rows, and (n,) the number of each row's set.

    Sets are numbered in order of appearance. Rows are equal if they are equal bit by bit.

    columns : (n,) each, of 32-bit numbers; they are requested one by one, so that a million corners
        do not need all columns in memory at once
    """
    number: NDArray[np.int32] | None = None
    first = np.zeros(0, np.int64)
    for column in columns:
        key = np.ascontiguousarray(column)
        # Adding 0 turns -0 into 0.
        key = np.add(key, key.dtype.type(0)).view(np.uint32).astype(np.uint64)
        if number is not None:
            key |= number.astype(np.uint64) << np.uint64(32)
        first, number = _kinds(key)
    assert number is not None
    order = np.argsort(first)
    rank = np.empty(len(first), np.int32)
    rank[order] = np.arange(len(first), dtype=np.int32)
    return first[order], rank[number]


def _kinds(key: NDArray[np.uint64]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return the index and inverse of `numpy.unique`, in a third of its memory."""
    order = np.argsort(key)
    new = np.ones(len(key), bool)
    new[1:] = key[order[1:]] != key[order[:-1]]
    number = np.empty(len(key), np.int32)
    number[order] = np.cumsum(new, dtype=np.int32) - np.int32(1)
    starts = np.flatnonzero(new)
    return np.minimum.reduceat(order, starts) if len(starts) else starts, number
