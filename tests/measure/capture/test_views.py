"""Sums of views are kept: a run that was broken off goes on, and a changed frame is read again."""

from __future__ import annotations

import numpy as np
import pytest

from fabricusd.cache import VARIABLE, _root_of
from fabricusd.errors import FabricError
from fabricusd.images.raw import read_codes, write_codes
from fabricusd.measure import measure
from fabricusd.measure.capture import views
from fabricusd.steps import watched
from tests.measure.shoots import replaced, shot, spoilt


@pytest.fixture
def read(tmp_path_factory, monkeypatch):
    """Names of the frames of views that were read, with an empty cache."""
    monkeypatch.setenv(VARIABLE, str(tmp_path_factory.mktemp("cache")))
    _root_of.cache_clear()
    monkeypatch.setattr(views, "CHUNK", 10)
    seen: list[str] = []
    before = views.read_frame

    def told(manifest, one, shape=None):
        seen.append(one.file)
        return before(manifest, one, shape)

    monkeypatch.setattr(views, "read_frame", told)
    yield seen
    _root_of.cache_clear()


def test_a_second_run_reads_no_view_again_and_returns_the_same(read):
    first = measure(shot())
    count = len(read)
    assert count == first.views * 8
    second = measure(shot())
    assert len(read) == count
    np.testing.assert_array_equal(first.lobes.f, second.lobes.f)


def test_a_run_that_was_broken_off_goes_on_with_the_next_views(read, monkeypatch):
    sums, calls = views._view, []

    def until(*given):
        calls.append(given)
        if len(calls) > 25:
            raise KeyboardInterrupt
        return sums(*given)

    with monkeypatch.context() as patch:
        patch.setattr(views, "_view", until)
        with pytest.raises(KeyboardInterrupt):
            measure(shot(), workers=1)
    del read[:]
    found = measure(shot(), workers=1)
    # Two chunks of ten were kept; each view has four exposures of two shots.
    assert len(read) == (found.views - 20) * 8


def test_a_frame_that_has_changed_is_read_again(read, tmp_path):
    folder = spoilt(tmp_path, lambda m: None)
    measure(folder)
    del read[:]
    frame = folder / "view_00001_03_1.pgm"
    codes = read_codes(frame).copy()
    frame.unlink()
    write_codes(frame, codes + 1)
    measure(folder)
    assert len(read) == 10 * 8


def test_why_a_view_is_left_out_is_said_in_a_second_run_too(read, tmp_path):
    folder = spoilt(tmp_path, lambda m: None)
    replaced(folder, "view_00000_00_0.pgm", b"P5\n")
    first, second = measure(folder), measure(folder)
    assert first.skipped == second.skipped == 1
    assert first.lobes.notes == second.lobes.notes


def test_progress_is_told_up_to_all_views(read):
    told = []
    with watched(listener=lambda name, total, done: told.append((name, total, done))):
        found = measure(shot())
    assert {name for name, _, _ in told} == {"photographs of views"}
    assert told[-1][1:] == (found.views, found.views)
    assert [d for _, _, d in told] == sorted(d for _, _, d in told)


def test_an_error_of_another_kind_is_not_kept_as_a_value(read, monkeypatch):
    def broken(*_):
        raise FabricError("all", "is broken")

    with monkeypatch.context() as patch:
        patch.setattr(views, "_view", broken)
        with pytest.raises(FabricError, match="has no view that can be used"):
            measure(shot())
    assert measure(shot()).skipped == 0
