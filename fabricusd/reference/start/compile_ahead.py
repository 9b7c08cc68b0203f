"""Prepares kernels while a scene is read: a thread loads them, or other processes compile them.

numba caches compiled kernels on disk. A thread calls every kernel of a list in `kernel_tasks` once,
with minimal arguments, so that numba loads the kernels while the scene is read and its triangles
are prepared.

For the first picture on a machine there is nothing to load. numba compiles one function at a time
per process, so several processes go through the list from either end, and each takes the next task
that no other process has claimed. The renderer waits for them and then finds the kernels on disk.
The kernels that only levels `weave` and `thread` need form a list of their own, which is prepared
at the first hit at one of these levels. The processes compile without Python's cyclic garbage
collector, which would take a fifth of the time; the memory that this costs is freed when they exit.
Kernels that they fail to compile are compiled by the caller.
"""

from __future__ import annotations

import atexit
import gc
import os
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from functools import cache
from pathlib import Path

from numba.core.dispatcher import Dispatcher

from fabricusd.kernels.start import load_as_they_are, load_without_blas
from fabricusd.reference.start.kernel_tasks import (
    CLOSE_UPS,
    EVERY_PICTURE,
    LONGEST,
    TASKS,
    of_law,
)
from fabricusd.run.workers import worker_count

__all__ = ["CLOSE_UPS", "EVERY_PICTURE", "compile_ahead", "compile_kernels", "of_law"]

_LONGEST = 120.0
"""Longest time to wait for the other processes [s]."""
_MOST_PROCESSES = 4
"""Largest number of processes; more of them would only wait for the longest kernel."""


class CompileAhead:
    """The thread that loads one list of kernels, or the processes that compile it."""

    def __init__(self, which: str) -> None:
        self._processes: list[subprocess.Popen[bytes]] = []
        self._thread: threading.Thread | None = None
        if _compiled(which):
            # Not a daemon: Python must not shut LLVM down while it loads code.
            self._thread = threading.Thread(target=_load_kernels, args=(_kernels(), which))
            self._thread.start()
            return
        load_without_blas()
        # Inside another program, `executable` names that program, which must not be started again.
        if not Path(sys.executable or "").name.startswith("python"):
            return
        atexit.register(self._stop)
        self._claims = tempfile.TemporaryDirectory(prefix="fabricusd-")
        none = subprocess.DEVNULL
        for k in range(min(worker_count(None), _MOST_PROCESSES)):
            call = f"compile_kernels({which!r}, {self._claims.name!r}, {k % 2 == 1})"
            code = f"import {__name__} as ahead; ahead.{call}"
            process = subprocess.Popen(
                [sys.executable, "-c", code], stdin=none, stdout=none, stderr=none
            )
            self._processes.append(process)

    def wait(self) -> None:
        """Return when the kernels are ready, or when waiting for them is given up."""
        if self._thread is not None:
            self._thread.join()
        while self._processes:
            process = self._processes.pop()
            try:
                process.wait(_LONGEST)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            if not self._processes:
                self._claims.cleanup()

    def _stop(self) -> None:
        for process in self._processes:
            process.kill()


@cache
def compile_ahead(which: str) -> CompileAhead:
    """Start the thread or the processes, once per list; call `wait` before the first kernel call.

    which : EVERY_PICTURE for what every picture needs, CLOSE_UPS for what levels `weave` and
        `thread` also need
    """
    return CompileAhead(which)


def _compiled(which: str) -> bool:
    """Whether numba's disk cache holds the longest kernel of the list."""
    kernel = LONGEST[which]
    name = f"{kernel.__module__.rpartition('.')[2]}.{kernel.__name__}"
    return any(Path(kernel.stats.cache_path).glob(f"{name}*.nbi"))


def _load_kernels(kernels: list[Dispatcher], which: str) -> None:
    """Call every kernel. A kernel that cannot be loaded raises its error when it is needed."""
    load_as_they_are(kernels)
    for task in TASKS[which]:
        with suppress(Exception):
            task()


def _kernels() -> list[Dispatcher]:
    """All kernels of the package in the modules imported so far."""
    return [
        value
        for name, module in sys.modules.copy().items()
        if name.startswith("fabricusd.")
        for value in vars(module).copy().values()
        if isinstance(value, Dispatcher)
    ]


def compile_kernels(which: str, claims: str, backwards: bool) -> None:
    """Compile the kernels of a list that no other process has claimed by a file in `claims`."""
    # Most objects that a compiler makes live until the end, so collecting garbage frees little.
    gc.disable()
    load_without_blas()
    for task in TASKS[which][:: -1 if backwards else 1]:
        try:
            os.close(os.open(os.path.join(claims, task.__name__), os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            continue
        task()
