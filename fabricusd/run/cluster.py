"""Runs independent jobs on the workers of a Dask cluster, of this machine or of many.

A job is a function of a *shared* thing and of an argument of its own. The shared thing (a scene,
the sheets of a bake) goes to each worker once and is kept there with whatever the worker builds
from it. Jobs whose worker is lost are given to another one.
"""

from __future__ import annotations

import asyncio
import hashlib
import pickle
import platform
import queue
import re
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import cache
from typing import Any, NamedTuple

import numba
import numpy as np

import fabricusd
from fabricusd.errors import FabricError, one_line
from fabricusd.kernels.cache import fingerprint
from fabricusd.ranges import RANGES
from fabricusd.run.workers import worker_count
from fabricusd.stop import Stop

LOCAL = re.compile(r"local(?::(\d+))?")
CONNECT = 20.0
"""Seconds to wait for a scheduler, and then for its first worker."""
POLL = 0.1
"""Seconds between two looks at whether the user wants to stop."""
AHEAD = 3
"""Jobs handed out per thread of the cluster: enough that none waits for the client."""
COUNTED = 1.0
"""Seconds after which the cluster's threads are counted again."""
LOSSES = 1000
"""Lost workers after which Dask calls a job the reason for the losses. Farms kill workers."""
KEPT = 2
"""Shared things that a worker keeps, with what it has built from them."""

_LOST: Any = object()
"""In place of a result that no worker has any more."""

_kept: OrderedDict[str, dict[str, Any]] = OrderedDict()
_lock = threading.Lock()


class Kept(NamedTuple):
    """What a job finds on its worker: the shared thing, and a place for what is built from it."""

    thing: Any
    built: dict[Any, Any]
    lock: threading.Lock


class Made(Sequence[Any]):
    """A sequence of `count` things, each of which `make` makes when it is asked for."""

    def __init__(self, count: int, make: Callable[[int], Any]) -> None:
        self.size, self.make = count, make

    def __len__(self) -> int:
        return self.size

    def __getitem__(self, k: Any) -> Any:
        return self.make(k)


@contextmanager
def open_cluster(scheduler: str) -> Iterator[Cluster]:
    """A cluster, connected and compared with this machine.

    scheduler : the address of a Dask scheduler, as in "tcp://10.0.0.1:8786", or "local" or
        "local:4" for that many processes of this machine, by default one for each processor

    Raises `FabricError` if Dask is missing, the scheduler does not answer or has no worker, or a
    worker has another version of anything that the results depend on.
    """
    try:
        import dask
        from distributed import Client, LocalCluster
    except ModuleNotFoundError as error:
        raise FabricError(
            "--scheduler", f"needs {error.name}: pip install 'fabricusd[distributed]'"
        ) from None
    own = None
    local = LOCAL.fullmatch(scheduler)
    settings = {
        "distributed.scheduler.allowed-failures": LOSSES,
        # A job holds a frame's scene, or the sums of its pixels.
        "distributed.admin.large-graph-warning-threshold": "4GiB",
    }
    with dask.config.set(settings):
        try:
            if local:
                count = worker_count(None) if local[1] is None else int(local[1])
                RANGES["workers"].require("--scheduler local:", count)
                own = LocalCluster(
                    n_workers=count, threads_per_worker=1, memory_limit=0, silence_logs=50,
                    host="127.0.0.1", dashboard_address="127.0.0.1:0",
                )  # fmt: skip
            else:
                _greet(scheduler)
            client = Client(own or scheduler, timeout=CONNECT, set_as_default=False)
        except (OSError, ValueError, TypeError, ImportError, KeyError, AttributeError) as error:
            if own is not None:
                own.close()
            if isinstance(error, FabricError):
                raise
            said = one_line(str(error) or type(error).__name__, 160)
            raise FabricError(
                f"--scheduler '{one_line(scheduler, 80)}'",
                f"does not answer ({said}); it must be 'local', 'local:N' or the address of a Dask "
                "scheduler, as in tcp://10.0.0.1:8786",
            ) from None
        try:
            cluster = Cluster(client, scheduler)
            cluster.compare()
            yield cluster
        finally:
            client.close()
            if own is not None:
                own.close()


def _greet(scheduler: str) -> None:
    """Connect to `scheduler` and part again.

    A `Client` that finds no scheduler leaves its thread and half of itself behind; when that is
    collected it waits for seconds, and enough of them keep the next client from starting.

    Raises `OSError` or `ValueError` where no scheduler answers.
    """
    from distributed.comm import connect

    async def greet() -> None:
        comm = await connect(scheduler, timeout=CONNECT)
        await comm.close()

    # In a thread of its own: a notebook's thread runs a loop already.
    with ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, greet()).result()


def cluster_or_threads(
    scheduler: str | Cluster | None, workers: int | None
) -> AbstractContextManager[Cluster | None]:
    """The cluster of `scheduler`; None, for threads of this process, where none is asked for.

    scheduler : as `open_cluster` takes it, or a cluster that is open and stays so

    Raises `FabricError` where both a scheduler and a number of threads are asked for.
    """
    if scheduler is None:
        return nullcontext()
    if workers is not None:
        raise FabricError(
            "--workers", "counts threads of this process; it cannot be had with --scheduler"
        )
    if isinstance(scheduler, Cluster):
        return nullcontext(scheduler)
    return open_cluster(scheduler)


class Cluster:
    """The workers of a Dask scheduler; made by `open_cluster`.

    notes : what differs between the machines and may show in the last bits of results
    """

    def __init__(self, client: Any, scheduler: str) -> None:
        self.client, self.scheduler = client, scheduler
        self.notes: list[str] = []
        self._shared: _Shared | None = None

    @property
    def threads(self) -> int:
        """Jobs that run at once, at least 1."""
        return max(sum(self.client.nthreads().values()), 1)

    def compare(self) -> None:
        """Compare what results depend on, on every worker, with this machine.

        Raises `FabricError` for another version, and for a scheduler without workers.
        """
        self._wait()
        here = identity()
        try:
            found = self.client.run(identity)
        except Exception as error:
            raise FabricError(
                f"--scheduler '{self.scheduler}'",
                f"has a worker that cannot run fabricusd ({one_line(str(error), 160)}); install "
                "the same version in its environment",
            ) from None
        for address, theirs in found.items():
            for name, value in here.items():
                if theirs.get(name) == value:
                    continue
                if name == "processor":
                    self.notes.append(
                        f"worker {address} has a processor of another kind ({theirs[name]} for "
                        f"{value}); its results may differ in their last bits"
                    )
                    continue
                raise _another(f"worker {address}", name, theirs.get(name), value)

    def run(
        self,
        function: Callable[[Kept, Any], Any],
        shared: Any,
        jobs: Sequence[Any],
        done: Callable[[int, Any], Any],
        stop: Stop | None = None,
    ) -> bool:
        """Call `function(kept, job)` on the workers for all `jobs`, in any order.

        function : of a module that the workers have, too
        shared : for `Kept.thing`; the same object as in the last call is not sent again
        done : called here with the number of each finished job and its result

        Returns False where `stop` was asked; an error of a job is raised here.
        """
        try:
            return self._run(function, shared, jobs, done, stop or Stop())
        except KeyboardInterrupt:
            if stop is None:
                raise
            stop.asked = True
            return False

    def _run(
        self,
        function: Callable[[Kept, Any], Any],
        thing: Any,
        jobs: Sequence[Any],
        done: Callable[[int, Any], Any],
        stop: Stop,
    ) -> bool:
        from distributed.client import FutureCancelledError

        if self._shared is None or self._shared.thing is not thing:
            self._shared = self._sent(thing, _packed(thing))
        waiting = list(range(len(jobs)))[::-1]
        out: dict[Any, int] = {}
        over: queue.SimpleQueue[Any] = queue.SimpleQueue()
        counted, room = -COUNTED, 0
        try:
            while waiting or out:
                if stop.asked:
                    return False
                if time.monotonic() - counted > COUNTED:
                    counted, room = time.monotonic(), AHEAD * self.threads
                while waiting and len(out) < room:
                    k = waiting.pop()
                    future = self.client.submit(
                        _job, function, _versions(), self._shared.digest, self._shared.blob,
                        jobs[k], pure=False,
                    )  # fmt: skip
                    out[future] = k
                    future.add_done_callback(over.put)
                try:
                    future = over.get(timeout=POLL)
                except queue.Empty:
                    continue
                k = out.pop(future)
                found = _LOST
                if future.status in ("finished", "error"):
                    with suppress(FutureCancelledError):
                        found = future.result()  # raises the error of a job
                if found is _LOST:
                    # Cancelled, or lost with the last worker that held the shared thing, which may
                    # be while the result is on its way.
                    waiting.append(k)
                    self._shared = self._sent(thing, self._shared.packed)
                    continue
                done(k, found)
            return True
        finally:
            self.client.cancel(list(out), force=True)

    def _sent(self, thing: Any, packed: bytes) -> _Shared:
        """The shared thing on every worker there is; others fetch it from them."""
        digest = hashlib.blake2b(packed, digest_size=16).hexdigest()
        for _ in range(LOSSES):
            try:
                blob = self.client.scatter(packed, broadcast=True, hash=False, direct=False)
                return _Shared(thing, packed, digest, blob)
            except (OSError, TimeoutError):
                # To a worker that has just been lost, which the scheduler had not yet seen.
                self._wait()
        raise FabricError(f"--scheduler '{self.scheduler}'", "loses every worker at once")

    def _wait(self) -> None:
        """Wait until there is a worker."""
        try:
            self.client.wait_for_workers(1, timeout=CONNECT)
        except TimeoutError:
            raise FabricError(
                f"--scheduler '{self.scheduler}'",
                "has no workers; start some: dask worker ADDRESS, in the same environment",
            ) from None


class _Shared(NamedTuple):
    """What was sent last: the thing, its bytes and their digest, and Dask's handle of them."""

    thing: Any
    packed: bytes
    digest: str
    blob: Any


def _another(where: str, name: str, theirs: str | None, ours: str) -> FabricError:
    return FabricError(where, f"has {name} {theirs}; it must have {ours}, as the client's machine")


def _packed(thing: Any) -> bytes:
    # Of Dask's own dependencies: it also packs the read-only mappings that a fabric holds.
    import cloudpickle

    return bytes(cloudpickle.dumps(thing))


def _job(
    function: Callable[[Kept, Any], Any],
    versions: tuple[tuple[str, str], ...],
    digest: str,
    blob: bytes,
    job: Any,
) -> Any:
    """Run one job on a worker, which may have joined after the others were compared."""
    if versions != _versions():
        own = dict(_versions())
        name, value = next((n, v) for n, v in versions if own.get(n) != v)
        raise _another(f"worker on {platform.node()}", name, own.get(name), value)
    with _lock:
        entry = _kept.get(digest)
        if entry is None:
            entry = {"thing": pickle.loads(blob), "built": {}, "lock": threading.Lock()}
            _kept[digest] = entry
            while len(_kept) > KEPT:
                _kept.popitem(last=False)
        _kept.move_to_end(digest)
    return function(Kept(**entry), job)


def identity() -> dict[str, str]:
    """What the results of this process depend on."""
    import llvmlite.binding as llvm

    return {
        "fabricusd": f"{fabricusd.__version__} ({fingerprint()})",
        "Python": ".".join(platform.python_version_tuple()[:2]),
        "numba": numba.__version__,
        "numpy": np.__version__,
        "processor": f"{platform.machine()} {numba.config.CPU_NAME or llvm.get_host_cpu_name()}",
    }


@cache
def _versions() -> tuple[tuple[str, str], ...]:
    """What must be equal of `identity`."""
    return tuple((name, value) for name, value in identity().items() if name != "processor")
