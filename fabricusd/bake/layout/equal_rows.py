"""Rows of arrays that are equal bit by bit, numbered: corners that share their values."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def numbered_rows(columns: Iterable[NDArray[Any]]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """(k,) the first row of each kind, and (n,) which kind each row is, counted as they come.

    columns : (n,) each, of 32-bit numbers; they are asked for one by one, so that a million corners
        do not need all of them at once
    """
    number: NDArray[np.int32] | None = None
    first = np.zeros(0, np.int64)
    for column in columns:
        key = np.ascontiguousarray(column)
        # 0 and -0 are one number.
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
    """What `numpy.unique` gives as index and inverse, with a third of its memory."""
    order = np.argsort(key)
    new = np.ones(len(key), bool)
    new[1:] = key[order[1:]] != key[order[:-1]]
    number = np.empty(len(key), np.int32)
    number[order] = np.cumsum(new, dtype=np.int32) - np.int32(1)
    starts = np.flatnonzero(new)
    return np.minimum.reduceat(order, starts) if len(starts) else starts, number
