"""Hands batches of work to worker threads, keeps all of them busy, and stops them without loss."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.ranges import require_ranges
from fabricusd.steps import current, watched
from fabricusd.stop import Stop


def worker_count(workers: int | None) -> int:
    """`workers`, or if None the number of processors that this process may use."""
    if workers is None:
        try:
            return len(os.sched_getaffinity(0))
        except AttributeError:
            return os.cpu_count() or 1
    require_ranges(workers=workers)
    return workers


def pixels_along_z_curve(width: int, height: int) -> NDArray[np.int32]:
    """(pixels,) int32 all pixels in Z-order, so that each batch covers a compact region."""
    x, y = np.arange(width, dtype=np.uint64), np.arange(height, dtype=np.uint64)
    key = _spread(x)[None, :] | (_spread(y)[:, None] << np.uint64(1))
    return np.argsort(key.ravel(), kind="stable").astype(np.int32)


def _spread(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Insert a zero bit after each of the lower 16 bits."""
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        x = (x | (x << np.uint64(shift))) & np.uint64(mask)
    return x


class Batches:
    """Runs numbered batches on several workers, in any order.

    The calling thread waits. On Ctrl-C, or when `stop` is triggered, no further batch is started,
    the running batches are finished (those in a long step of `fabricusd.steps` are given up), and
    `run` returns False. An error in a worker stops the others
    in the same way and is raised in the calling thread.
    """

    def __init__(
        self, workers: int, task: Callable[[int, int], None], stop: Stop | None = None
    ) -> None:
        self.workers = workers
        self.task = task
        self.stop = stop or Stop()

    def run(self, count: int, progress: Callable[[int], Any] | None = None) -> bool:
        """Call `task(worker, batch)` for every batch below `count`; False if interrupted."""
        lock, watch = threading.Lock(), current()
        state: dict[str, Any] = {"next": 0, "done": 0, "error": None}

        def work(worker: int) -> None:
            with watched(watch, stop=self.stop):
                go_on(worker)

        def go_on(worker: int) -> None:
            while True:
                with lock:
                    batch = state["next"]
                    if batch >= count or state["error"] is not None or self.stop.asked:
                        return
                    state["next"] += 1
                try:
                    self.task(worker, batch)
                except KeyboardInterrupt:
                    # A long step inside of the batch was broken off.
                    self.stop.asked = True
                    return
                except BaseException as error:
                    with lock:
                        state["error"] = error
                    return
                with lock:
                    state["done"] += 1

        threads = [
            threading.Thread(target=work, args=(k,), daemon=True)
            for k in range(min(self.workers, count))
        ]
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads):
            try:
                for thread in threads:
                    thread.join(0.1)
                    if thread.is_alive():
                        break
                if progress is not None:
                    progress(state["done"])
            except KeyboardInterrupt:
                self.stop.asked = True
        if state["error"] is not None:
            raise state["error"]
        if progress is not None:
            progress(state["done"])
        return bool(state["done"] == count)
