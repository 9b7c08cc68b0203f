"""Long steps are told by name, part by part, and broken off where the handler asks."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.fabric import Fabric, Weave
from fabricusd.run.workers import Batches
from fabricusd.steps import current, parts, watched
from fabricusd.stop import Stop


class Ear:
    def __init__(self) -> None:
        self.heard: list[tuple[str, int, int]] = []

    def __call__(self, name: str, total: int, done: int) -> None:
        self.heard.append((name, total, done))


def test_each_part_is_told_before_it_is_done_and_the_last_call_says_that_all_are():
    ear = Ear()
    with watched(listener=ear):
        for k in parts("a step", "abc"):
            assert ear.heard[-1] == ("a step", 3, "abc".index(k))
    assert ear.heard[-1] == ("a step", 3, 3)
    assert len(ear.heard) == 4


def test_nobody_listens_by_default_and_after_a_watch():
    with watched(listener=Ear()):
        assert current().listener is not None
    assert current() == (None, None)
    assert list(parts("a step", [1, 2])) == [1, 2]


def test_an_inner_watch_keeps_what_it_does_not_name():
    ear, stop = Ear(), Stop()
    with watched(listener=ear), watched(stop=stop):
        assert current() == (ear, stop)


def test_a_step_is_broken_off_before_its_next_part_and_said_to_be_over():
    ear, stop, done = Ear(), Stop(), []

    def step() -> None:
        for k in parts("a step", range(5)):
            done.append(k)
            stop.asked = k == 1

    with watched(listener=ear, stop=stop), pytest.raises(KeyboardInterrupt):
        step()
    assert done == [0, 1]
    assert ear.heard[-1] == ("a step", 5, 5)


def test_a_step_that_its_maker_leaves_early_is_over():
    ear = Ear()
    with watched(listener=ear):
        for _ in parts("a step", range(5)):
            break
    assert ear.heard[-1] == ("a step", 5, 5)


def test_workers_tell_the_listener_of_the_thread_that_waits():
    ear = Ear()
    with watched(listener=ear):
        assert Batches(2, lambda _, batch: list(parts(f"{batch}", "ab")) and None).run(3)
    assert {name for name, _, _ in ear.heard} == {"0", "1", "2"}


def test_a_batch_in_a_long_step_is_given_up_and_counts_as_not_done():
    stop, begun, done = Stop(), threading.Event(), []

    def task(_: int, batch: int) -> None:
        for _part in parts("a step", range(100000)):
            begun.set()
            threading.Event().wait(0.001)
        done.append(batch)

    def ask(_: int) -> None:
        assert begun.wait(10)
        stop.asked = True

    assert not Batches(2, task, stop).run(4, ask)
    assert done == []


def test_a_weave_whose_tables_are_made_says_which_and_of_which_fabric():
    ear = Ear()
    i, j = np.indices((7, 7))
    with watched(listener=ear):
        compile_shadow(Fabric(name="odd", weave=Weave((3 * i + j) % 7 < 3)))
    names = list(dict.fromkeys(name for name, _, _ in ear.heard))
    assert "horizon table of 'odd'" in names
    assert "lines of the threads of 'odd'" in names
    assert [done for name, _, done in ear.heard if name == names[-1]][-1] > 0
