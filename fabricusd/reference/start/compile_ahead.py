"""Kernels made ready while a scene is read: loaded by a thread, or compiled by other processes.

numba keeps on disk what it compiled. A thread calls every kernel of a list of `kernel_tasks` once,
on next to nothing, so that numba loads them while the scene is read and its triangles are prepared.

On a machine's first picture there is nothing to load. numba compiles one function at a time in a
process, so processes of their own go through the list, from one end or the other, each taking
the next that none has, and whoever wanted to render waits and finds them on disk. What only levels
`weave` and `thread` need is a list of its own, for the first hit at one of those. Processes compile
without Python's collector of cycles, which costs a fifth of the time, and end with the memory that
this takes. Whatever they fail to make is compiled by the caller.
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
from fabricusd.reference.start.kernel_tasks import FAR, LONGEST, NEAR, TASKS
from fabricusd.run.workers import worker_count

__all__ = ["FAR", "NEAR", "compile_ahead", "compile_kernels"]

_LONGEST = 120.0
"""Seconds after which the other processes are no longer waited for."""
_MOST_PROCESSES = 4
"""More would wait for the longest kernel."""


class CompileAhead:
    """The thread, or where kernels have not been compiled the processes, of one list."""

    def __init__(self, which: str) -> None:
        self._processes: list[subprocess.Popen[bytes]] = []
        self._thread: threading.Thread | None = None
        if _compiled(which):
            # No daemon: Python must not take LLVM apart while it loads code.
            self._thread = threading.Thread(target=_load_kernels, args=(_kernels(), which))
            self._thread.start()
            return
        load_without_blas()
        # Inside another program `executable` is that program, which must not be started again.
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
        """Return when the kernels are ready, or will not be."""
        if self._thread is not None:
            self._thread.join()
        while self._processes:
            process = self._processes.pop()
            try:
                process.wait(_LONGEST)
            except subprocess.TimeoutExpired:
                process.kill()
            if not self._processes:
                self._claims.cleanup()

    def _stop(self) -> None:
        for process in self._processes:
            process.kill()


@cache
def compile_ahead(which: str) -> CompileAhead:
    """Start the thread or the processes, once; for `wait` before the first kernel is called.

    which : FAR, what every picture needs, or NEAR, what levels `weave` and `thread` need besides
    """
    return CompileAhead(which)


def _compiled(which: str) -> bool:
    """Whether numba has that list's longest kernel on disk."""
    kernel = LONGEST[which]
    name = f"{kernel.__module__.rpartition('.')[2]}.{kernel.__name__}"
    return any(Path(kernel.stats.cache_path).glob(f"{name}*.nbi"))


def _load_kernels(kernels: list[Dispatcher], which: str) -> None:
    """Call every kernel; one that cannot be loaded complains where it is needed."""
    load_as_they_are(kernels)
    for task in TASKS[which]:
        with suppress(Exception):
            task()


def _kernels() -> list[Dispatcher]:
    """Those of the appearance model and of the tracer, as far as they have been imported."""
    return [
        value
        for name, module in sys.modules.copy().items()
        if name.startswith("fabricusd.")
        for value in vars(module).copy().values()
        if isinstance(value, Dispatcher)
    ]


def compile_kernels(which: str, claims: str, backwards: bool) -> None:
    """Compile every kernel of a list that no file of its name in folder `claims` claims yet."""
    # Most of what a compiler makes lives until the end.
    gc.disable()
    load_without_blas()
    for task in TASKS[which][:: -1 if backwards else 1]:
        try:
            os.close(os.open(os.path.join(claims, task.__name__), os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            continue
        task()
