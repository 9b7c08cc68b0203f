"""Prepares kernels while a scene is read: a thread loads them, or other processes compile them.

numba caches compiled kernels on disk. A thread calls every kernel of a list in `kernel_tasks` once,
with minimal arguments, so that numba loads the kernels while the scene is read and its triangles
are prepared.

For the first picture on a machine there is nothing to load. numba compiles one function at a time
per process, so several processes go through a list from either end, and each takes the next task
that no other process has claimed. The renderer waits for them and then finds the kernels on disk.
The lists are asked for one by one, as soon as it is known that a picture needs them, and the same
processes compile them all: a process needs two seconds before its first kernel. They compile
without Python's cyclic garbage collector, which would take a fifth of the time; the memory that
this costs is freed when they end, some seconds after the last list. Kernels that they fail to
compile are compiled by the caller.
"""

from __future__ import annotations

import atexit
import gc
import os
import queue
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from functools import cache
from pathlib import Path

from numba.core.dispatcher import Dispatcher

from fabricusd.fabric import Fabric
from fabricusd.kernels.start import load_as_they_are, load_without_blas
from fabricusd.reference.start.kernel_tasks import (
    CLOSE_UPS,
    EVERY_PICTURE,
    LONGEST,
    TASKS,
    near_of_law,
    of_law,
)
from fabricusd.run.workers import worker_count

__all__ = ["EVERY_PICTURE", "close_ups_of", "compile_ahead", "compile_lists", "of_law"]

_LONGEST = 120.0
"""Longest time to wait for the other processes [s]."""
_PATIENCE = 10.0
"""Time that a process waits for another list [s]."""
_MOST_PROCESSES = 4
"""Largest number of processes; more of them would only wait for the longest kernel."""


class CompileAhead:
    """The thread that loads one list of kernels, or the processes that compile it."""

    def __init__(self, which: str) -> None:
        self._which = which
        self._thread: threading.Thread | None = None
        self._processes: list[_Process] = []
        if _compiled(which):
            # Not a daemon: Python must not shut LLVM down while it loads code.
            self._thread = threading.Thread(target=_load_kernels, args=(_kernels(), which))
            self._thread.start()
            return
        load_without_blas()
        # Inside another program, `executable` names that program, which must not be started again.
        if Path(sys.executable or "").name.startswith("python"):
            self._processes = _processes()
        for process in self._processes:
            process.ask(which)

    def wait(self) -> None:
        """Return when the kernels are ready, or when waiting for them is given up."""
        if self._thread is not None:
            self._thread.join()
        for process in self._processes:
            process.wait(self._which)
        self._processes = []


class _Process:
    """Another process that compiles lists; `compile_lists` is what it runs.

    claims : folder in which each process leaves a file for each task that it takes
    """

    def __init__(self, claims: str, backwards: bool) -> None:
        code = f"import {__name__} as ahead; ahead.compile_lists({claims!r}, {backwards})"
        self._process = subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        self._done: set[str] = set()
        self._ended = False
        self._news = threading.Condition()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    @property
    def lives(self) -> bool:
        """Whether it may be asked for more."""
        return not self._ended and self._process.poll() is None

    def ask(self, which: str) -> None:
        """Hand it a list; one that is about to end may not take it."""
        with suppress(OSError, ValueError):
            assert self._process.stdin is not None
            self._process.stdin.write(f"{which}\n")
            self._process.stdin.flush()

    def wait(self, which: str) -> None:
        """Return when it has gone through a list that it was asked for, or has ended."""
        with self._news:
            if not self._news.wait_for(lambda: self._ended or which in self._done, _LONGEST):
                self._process.kill()

    def stop(self) -> None:
        """End it."""
        self._process.kill()
        self._listener.join()

    def _listen(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                with self._news:
                    self._done.add(line.strip())
                    self._news.notify_all()
        self._process.wait()
        with suppress(OSError):
            self._process.stdin.close()
        with self._news:
            self._ended = True
            self._news.notify_all()


_started: list[_Process] = []
_starting = threading.Lock()


@cache
def _claims() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="fabricusd-")


def _processes() -> list[_Process]:
    """The processes that compile; those that have ended are replaced."""
    with _starting:
        for k in range(min(worker_count(None), _MOST_PROCESSES)):
            if k < len(_started) and _started[k].lives:
                continue
            _started[k : k + 1] = [_Process(_claims().name, k % 2 == 1)]
        return list(_started)


@atexit.register
def _stop() -> None:
    for process in _started:
        process.stop()


@cache
def compile_ahead(which: str) -> CompileAhead:
    """Start the thread or the processes, once per list; call `wait` before the first kernel call.

    which : one of the lists of `kernel_tasks.TASKS`
    """
    return CompileAhead(which)


def close_ups_of(fabric: Fabric) -> list[CompileAhead]:
    """What `fabric` needs at levels `weave` and `thread`, started."""
    near = near_of_law(fabric)
    return [compile_ahead(which) for which in (CLOSE_UPS, near) if which is not None]


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


def compile_lists(claims: str, backwards: bool) -> None:
    """Compile the lists that stdin names, line by line, and print each when it is done.

    Returns when stdin ends, or names nothing for some seconds.
    """
    # Most objects that a compiler makes live until the end, so collecting garbage frees little.
    gc.disable()
    load_without_blas()
    asked: queue.Queue[str] = queue.Queue()

    def listen() -> None:
        # Not by `sys.stdin`: Python cannot end while a thread waits for that.
        rest = b""
        while got := os.read(0, 4096):
            *lines, rest = (rest + got).split(b"\n")
            for line in lines:
                asked.put(line.decode().strip())
        asked.put("")

    threading.Thread(target=listen, daemon=True).start()
    with suppress(queue.Empty):
        while which := asked.get(timeout=_PATIENCE):
            compile_kernels(which, claims, backwards)
            print(which, flush=True)


def compile_kernels(which: str, claims: str, backwards: bool) -> None:
    """Compile the kernels of a list that no other process has claimed by a file in `claims`."""
    for task in TASKS[which][:: -1 if backwards else 1]:
        try:
            os.close(os.open(os.path.join(claims, task.__name__), os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            continue
        task()
