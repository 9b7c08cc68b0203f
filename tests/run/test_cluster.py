"""Jobs on a Dask cluster: all are done once, whatever becomes of the workers."""

from __future__ import annotations

import sys
import threading

import pytest

from fabricusd.errors import FabricError
from fabricusd.run import cluster as module
from fabricusd.run.cluster import cluster_or_threads, identity, open_cluster
from fabricusd.stop import Stop
from tests.run.clusters import build_once, double, kill_a_worker


def test_every_job_is_done_once(cluster):
    found: list[tuple[int, int]] = []
    assert cluster.run(double, {"plus": 1}, range(40), lambda k, x: found.append((k, x)))
    assert sorted(found) == [(k, 2 * k + 1) for k in range(40)]


def test_no_jobs(cluster):
    assert cluster.run(double, {"plus": 1}, [], lambda *_: 1 / 0)


def test_a_worker_builds_what_jobs_share_once(cluster):
    found: list[tuple[int, int]] = []
    cluster.run(build_once, {"a": 1}, range(12), lambda _, x: found.append(x))
    assert {count for _, count in found} == {1}


def test_the_error_of_a_job_is_raised_here(cluster):
    with pytest.raises(ValueError, match="no job -1"):
        cluster.run(double, {"plus": 0}, [1, -1], lambda *_: None)


def test_jobs_of_a_lost_worker_are_done_by_others(cluster):
    found: dict[int, int] = {}

    def done(k: int, x: int) -> None:
        if not found:
            assert kill_a_worker(cluster)
        assert k not in found
        found[k] = x

    assert cluster.run(double, {"plus": 5}, range(60), done)
    assert found == {k: 2 * k + 5 for k in range(60)}
    cluster.client.wait_for_workers(2, timeout=60)


def test_a_result_that_is_lost_on_its_way_is_computed_again(cluster, monkeypatch):
    from distributed import Future

    found, lost, result = {}, [], Future.result

    def lose_two(future, *args):
        if len(lost) < 2:
            lost.append(future)
            future.client.cancel([future], force=True)
        return result(future, *args)

    monkeypatch.setattr(Future, "result", lose_two)
    assert cluster.run(double, {"plus": 3}, range(8), lambda k, x: found.update({k: x}))
    assert len(lost) == 2
    assert found == {k: 2 * k + 3 for k in range(8)}


def test_stop_is_heard(cluster):
    stop, found = Stop(), []

    def done(k: int, _: int) -> None:
        found.append(k)
        stop.asked = True

    assert not cluster.run(double, {"plus": 0}, range(50), done, stop)
    assert len(found) == 1


def test_a_worker_of_another_version_is_named(cluster, monkeypatch):
    real = identity()
    monkeypatch.setattr(module, "identity", lambda: {**real, "numba": "0.1"})
    # The workers have modules of their own, in which `identity` is still the real one.
    monkeypatch.setattr(cluster.client, "run", lambda _: {"tcp://one": real})
    with pytest.raises(FabricError, match=r"worker tcp://one has numba .*; it must have 0\.1"):
        cluster.compare()


def test_a_worker_of_another_version_that_joins_late_does_nothing(cluster, monkeypatch):
    monkeypatch.setattr(module, "_versions", lambda: (("numba", "0.1"),))
    with pytest.raises(FabricError, match=r"worker on .* has numba .*; it must have 0\.1"):
        cluster.run(double, {"plus": 0}, [1], lambda *_: None)


def test_what_jobs_share_is_sent_once(cluster, monkeypatch):
    sent: list[int] = []
    real = cluster.client.scatter
    monkeypatch.setattr(
        cluster.client, "scatter", lambda data, **how: sent.append(len(data)) or real(data, **how)
    )
    shared = {"plus": 3}
    for _ in range(3):
        assert cluster.run(double, shared, range(4), lambda *_: None)
    assert len(sent) == 1
    assert cluster.run(double, {"plus": 4}, range(4), lambda *_: None)
    assert len(sent) == 2


def test_another_processor_is_a_note(cluster, monkeypatch):
    real = identity()
    theirs = {"tcp://one": {**real, "processor": "x86_64 old"}}
    monkeypatch.setattr(cluster.client, "run", lambda _: theirs)
    monkeypatch.setattr(cluster, "notes", [])
    cluster.compare()
    assert len(cluster.notes) == 1
    assert "x86_64 old" in cluster.notes[0]


@pytest.mark.parametrize("address", ["nonsense", "tcp://127.0.0.1:1", "local:x", "local:0", ""])
def test_a_scheduler_that_is_none_is_refused(address, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(module, "CONNECT", 1.0)
    before = threading.active_count()
    with pytest.raises(FabricError, match="scheduler"), open_cluster(address):
        pass
    assert threading.active_count() == before  # a client's thread would be left behind


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(FabricError, match="fabricusd\\[distributed\\]"), open_cluster("local"):
        pass


def test_threads_and_a_cluster_exclude_one_another():
    with pytest.raises(FabricError, match="--workers"):
        cluster_or_threads("local", 2)
    with cluster_or_threads(None, 2) as none:
        assert none is None
