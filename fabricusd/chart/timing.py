"""Processor time of rival methods, measured in turns so that a busy machine slows all alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

SHORTEST = 0.01
"""Least seconds of a turn: a method is called repeatedly, so that cold caches do not count."""


def in_turns(methods: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Processor seconds per call of each method, in each of `rounds` turns.

    The time of all workers is added up. A first turn, which is not counted, compiles the methods
    and determines how often each is called in the other turns.
    """
    calls: dict[str, int] = {}
    for name, method in methods.items():
        method()
        calls[name] = max(1, round(SHORTEST / max(_seconds(method, 1), 1e-6)))
    taken: dict[str, list[float]] = {name: [] for name in methods}
    for _ in range(rounds):
        for name, method in methods.items():
            taken[name].append(_seconds(method, calls[name]))
    return taken


def _seconds(method: Callable[[], object], calls: int) -> float:
    start = time.process_time()
    for _ in range(calls):
        method()
    return (time.process_time() - start) / calls


def typical(values: ArrayLike) -> tuple[float, float]:
    """(median, half the range between the quartiles)."""
    low, middle, high = np.quantile(np.asarray(values, np.float64), (0.25, 0.5, 0.75))
    return float(middle), float(0.5 * (high - low))
