"""A weaver's name for a grid of cells: plain, basket, twill or satin."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

LARGEST = 64
"""Most threads of a repeat, each way, that is examined; no weave with a name is wider."""


def recognise(cells: NDArray[np.bool_]) -> str:
    """The name of the weave `cells` (m, n), spelt as in `named.py`; "" if it has no name.

    Several copies of a repeat are recognised as that repeat. It does not matter at which thread the
    repeat starts.
    """
    if max(cells.shape) > LARGEST:
        return ""
    cells = shortest_repeat(cells)
    m, n = cells.shape
    if (m, n) == (1, 1):
        return "warp only" if cells[0, 0] else "weft only"
    basket = _basket(cells)
    if basket:
        return basket
    if m != n:
        return ""
    for step in range(1, n):
        rolled = np.stack([np.roll(cells[0], i * step) for i in range(m)])
        if np.array_equal(rolled, cells):
            return _stepped(cells[0], step)
    return ""


def shortest_repeat(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The smallest (m', n') block that tiles `cells` (m, n) a whole number of times."""
    for axis in (0, 1):
        count = cells.shape[axis]
        for period in range(1, count + 1):
            if count % period == 0 and np.array_equal(np.roll(cells, period, axis), cells):
                cells = np.take(cells, np.arange(period), axis=axis)
                break
    return cells


def _basket(cells: NDArray[np.bool_]) -> str:
    m, n = cells.shape
    a, b = m // 2, n // 2
    if m % 2 or n % 2 or m == 0 or n == 0:
        return ""
    i, j = np.arange(m)[:, None], np.arange(n)
    pattern = (i // a + j // b) % 2 == 0
    for di in range(a + 1):
        for dj in range(b + 1):
            if np.array_equal(np.roll(pattern, (di, dj), (0, 1)), cells):
                return "plain" if (a, b) == (1, 1) else f"basket {a}/{b}"
    return ""


def _stepped(end: NDArray[np.bool_], step: int) -> str:
    """The name of a weave in which each end is the previous one, moved by `step` picks."""
    n, over = len(end), int(end.sum())
    if step in (1, n - 1):
        changes = np.flatnonzero(end != np.roll(end, 1))
        changes = np.roll(changes, 0 if end[changes[0]] else -1)
        runs = [int(r) for r in (np.roll(changes, -1) - changes) % n]
        # A twill may be read from any of its lines; weavers write the longest "over" first.
        runs = max(runs[k:] + runs[:k] for k in range(0, len(runs), 2))
        lengths = "/".join(map(str, runs))
        return f"twill {lengths} {'Z' if step == 1 else 'S'}"
    if over in (1, n - 1) and math.gcd(step, n) == 1:
        # MODEL section 1 writes a satin mod(a i + j, N): its tie moves *down* by a picks per end.
        return f"satin {n} step {n - step}{' weft' if over == 1 else ''}"
    return ""
