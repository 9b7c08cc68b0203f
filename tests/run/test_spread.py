"""Parts of a step: the same results in the same order on threads and on a cluster."""

from __future__ import annotations

import pytest

from fabricusd.run.spread import spread
from fabricusd.steps import watched
from fabricusd.stop import Stop
from tests.run.clusters import plus


@pytest.fixture(params=["one thread", "threads", "cluster"])
def place(request):
    if request.param == "cluster":
        return request.getfixturevalue("cluster")
    return 1 if request.param == "one thread" else 3


def test_results_are_in_the_order_of_the_items(place):
    assert spread("sums", plus, 10, [3, 1, 2, 0], place) == [13, 11, 12, 10]


def test_nothing_to_do(place):
    assert spread("sums", plus, 10, [], place) == []


def test_each_place_takes_the_shared_thing_of_this_call(place):
    assert [spread("sums", plus, k, [1], place) for k in (1, 2)] == [[2], [3]]


def test_a_step_is_told_from_its_beginning_to_its_end(place):
    told: list[tuple[str, int, int]] = []
    with watched(listener=lambda *step: told.append(step)):
        spread("sums", plus, 0, [1, 2, 3], place)
    assert told[0] == ("sums", 3, 0)
    assert told[-1] == ("sums", 3, 3)
    assert [done for _, _, done in told] == sorted(done for _, _, done in told)


def test_the_error_of_a_part_is_raised(place):
    with pytest.raises(ValueError, match="no item -1"):
        spread("sums", plus, 0, [1, -1], place)


def test_stop_is_heard(place):
    stop = Stop()
    stop.asked = True
    with watched(stop=stop), pytest.raises(KeyboardInterrupt):
        spread("sums", plus, 0, [1, 2], place)
