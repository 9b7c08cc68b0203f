"""Spreads the independent parts of a step over threads of this process, or over a cluster."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from fabricusd.run.blas import one_blas_thread
from fabricusd.run.cluster import Cluster, Kept
from fabricusd.run.workers import worker_count
from fabricusd.steps import current, parts

Shared = TypeVar("Shared")
Item = TypeVar("Item")
Made = TypeVar("Made")

Place = int | None | Cluster
"""Where work is done: on so many threads of this process, on one for each processor, or on a
cluster."""


def spread(
    name: str,
    work: Callable[[Shared, Item], Made],
    shared: Shared,
    items: Sequence[Item],
    place: Place,
) -> list[Made]:
    """`work(shared, item)` of each item, in the order of the items; told as the step `name`.

    Linear algebra has one thread meanwhile, so that results do not depend on the place.

    work : a function of a module, which a cluster's workers can import; its loops should release
        Python's lock, as NumPy's and numba's do, since threads share one process
    shared : goes to each worker of a cluster once

    Raises KeyboardInterrupt where the watch's handler was asked to stop, and the error of an item.
    """
    if isinstance(place, Cluster):
        return _on_cluster(name, work, shared, items, place)
    count = min(worker_count(place), len(items))
    with one_blas_thread():
        if count <= 1:
            return [work(shared, item) for item in parts(name, items)]
        pool = ThreadPoolExecutor(count)
        try:
            jobs: list[Any] = [pool.submit(work, shared, item) for item in items]
            return [job.result() for job in parts(name, jobs)]
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _on_cluster(
    name: str,
    work: Callable[[Shared, Item], Made],
    shared: Shared,
    items: Sequence[Item],
    cluster: Cluster,
) -> list[Made]:
    watch, found = current(), dict[int, Made]()

    def tell() -> None:
        if watch.listener is not None:
            watch.listener(name, len(items), len(found))

    def done(number: int, made: Made) -> None:
        found[number] = made
        tell()

    try:
        tell()
        if not cluster.run(_part, shared, [(work, item) for item in items], done, watch.stop):
            raise KeyboardInterrupt
    finally:
        if watch.listener is not None:
            watch.listener(name, len(items), len(items))
    return [found[k] for k in range(len(items))]


def _part(kept: Kept, job: tuple[Callable[[Any, Any], Any], Any]) -> Any:
    work, item = job
    with one_blas_thread():
        return work(kept.thing, item)
