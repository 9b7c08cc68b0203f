"""A bar for each long step of a command, by name, on a terminal only."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from fabricusd.steps import watched

DELAY = 1.0
"""Seconds for which a step is not shown: most are over by then."""


class Bars:
    """A listener, as `steps.watched` takes it, that draws a bar for each step that lasts."""

    def __init__(self) -> None:
        self._bars: dict[str, Any] = {}

    def __call__(self, name: str, total: int, done: int) -> None:
        """Draw that `done` of `total` parts of a step are done; a step that is over goes away."""
        bar = self._bars.get(name)
        if bar is None:
            from tqdm import tqdm

            bar = self._bars[name] = tqdm(
                total=total,
                desc=name,
                bar_format="{desc}: {percentage:3.0f} %|{bar}| {remaining} left",
                leave=False,
                delay=DELAY,
                miniters=1,
            )
        bar.update(done - bar.n)
        if done == total:
            self._bars.pop(name).close()

    def close(self) -> None:
        """Take away the bars of steps that were broken off."""
        while self._bars:
            self._bars.popitem()[1].close()


@contextmanager
def shown(quiet: bool) -> Iterator[None]:
    """A context whose steps have bars, unless it is quiet or standard error is no terminal."""
    if quiet or sys.stderr is None or not sys.stderr.isatty():
        yield
        return
    bars = Bars()
    try:
        with watched(listener=bars):
            yield
    finally:
        bars.close()
