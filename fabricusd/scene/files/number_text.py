"""Parses numbers in text into arrays, many lines at once."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray


def is_blank(data: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Where the bytes are white space, as defined by `bytes.split`."""
    return np.asarray((data == 32) | ((data >= 9) & (data <= 13)))


def word_starts(data: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Where a word begins."""
    blank = is_blank(data)
    starts = ~blank
    starts[1:] &= blank[:-1]
    return starts


def words_per_line(data: NDArray[np.uint8]) -> NDArray[np.int64]:
    """(lines,) number of words in each line of `data`, which must end with a line feed."""
    total = np.cumsum(word_starts(data), dtype=np.int32)
    return np.diff(total[data == 10], prepend=0).astype(np.int64)


def parsed(data: NDArray[np.uint8], kind: Any) -> NDArray[Any] | None:
    """All numbers in `data`, or None if any part of it is not a number.

    There may be more numbers than words: '1-2' is parsed as two numbers, so the caller must compare
    the counts.
    """
    if not len(data) or is_blank(data).all():
        return np.zeros(0, kind)
    with warnings.catch_warnings():
        # numpy still warns about text that is not a number, instead of raising ValueError.
        warnings.simplefilter("error")
        try:
            return np.asarray(np.fromstring(data.tobytes(), kind, sep=" "))
        except (DeprecationWarning, ValueError):
            return None
