"""Jobs for the cluster of the tests, and the loss of one of its workers."""

from __future__ import annotations

import os
import signal

from fabricusd.run.cluster import Cluster, Kept


def kill_a_worker(cluster: Cluster) -> bool:
    """End a worker's process at once, as a farm does; False where none answers just then."""
    try:
        numbers = list(cluster.client.run(os.getpid, on_error="ignore").values())
    except OSError:
        # The one that was killed last is still counted as a worker.
        return False
    for number in numbers[:1]:
        os.kill(number, signal.SIGKILL)
    return bool(numbers)


def double(kept: Kept, job: int) -> int:
    """A job: twice the number, plus what is shared."""
    if job < 0:
        raise ValueError(f"no job {job}")
    return 2 * job + int(kept.thing["plus"])


def build_once(kept: Kept, job: int) -> tuple[int, int]:
    """A job: the process, and how often it has built what the jobs share."""
    with kept.lock:
        kept.built.setdefault("count", 0)
        if "tracer" not in kept.built:
            kept.built["tracer"] = job
            kept.built["count"] += 1
    return os.getpid(), kept.built["count"]


def plus(shared: int, item: int) -> int:
    """A part of a step: the sum."""
    if item < 0:
        raise ValueError(f"no item {item}")
    return shared + item
