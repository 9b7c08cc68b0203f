"""The cache on disk stays below its bound, and never loses what is in use."""

from __future__ import annotations

import os
import time
from dataclasses import replace

import numpy as np
import pytest

from fabricusd import cache
from fabricusd.appearance.thread import evaluate, split
from fabricusd.cli.main import main
from tests.measure.shoots import SPUN

DAY = 24 * 3600.0


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache"


def entry(key, size=1000, days=0.0, kind="tables"):
    made = cache.cache_folder(kind, key)
    (made / "data").write_bytes(bytes(size))
    used = time.time() - days * DAY
    os.utime(made / ".used", (used, used))
    return made


def test_an_entry_is_there_again_and_marked_as_used():
    made = entry("a", days=9)
    assert cache.cache_folder("tables", "a") == made
    assert time.time() - cache.entries()[0].used < 60
    assert (made / "data").stat().st_size == 1000


def test_what_was_used_least_recently_goes_first_and_only_until_the_rest_fits():
    for key, days in (("young", 2), ("oldest", 9), ("old", 5)):
        entry(key, days=days)
    assert [e.key for e in cache.prune(2500)] == ["oldest"]
    assert [e.key for e in cache.entries()] == ["old", "young"]


def test_what_may_be_in_use_stays_even_above_the_bound():
    entry("now")
    assert cache.prune(0) == []


def test_a_new_entry_makes_room(monkeypatch):
    monkeypatch.setattr(cache.prune, "__defaults__", (1500, None))
    monkeypatch.setattr(cache, "PRUNED_EVERY", 0.0)
    entry("old", days=9)
    entry("older", days=10)
    entry("new")
    assert [e.key for e in cache.entries()] == ["old", "new"]


def test_many_new_entries_are_counted_once(monkeypatch):
    counted = []
    monkeypatch.setattr(cache, "prune", lambda: counted.append(1))
    for key in "abc":
        entry(key)
    assert counted == [1]


def test_what_is_recorded_is_known_where_it_is_kept(folder, tmp_path, monkeypatch):
    def array(kind, number):
        return cache.kept(kind, ("key", number), lambda: np.full(3, number))

    array("fits", 1)
    with cache.recorded("fits") as entries:
        array("fits", 1), array("fits", 2), array("tables", 3)
    assert [kind for kind, _, _ in entries] == ["fits", "fits"]
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "another"))
    with cache.only_known("fits"), pytest.raises(cache.Unknown):
        array("fits", 1)
    for one in entries:
        cache.keep(*one)
    with cache.only_known("fits"):
        assert [array("fits", n)[0] for n in (1, 2)] == [1, 2]
        # Of other kinds, what is not known is made.
        assert array("tables", 3)[0] == 3


def test_a_fit_does_not_fill_the_cache_with_the_tables_of_its_steps():
    views = np.array([[0.0, 0.0, 1.0]])
    evaluate(replace(SPUN, model="conserving", gamma_surface=0.1234), views, views)
    kept = len(cache.entries())
    assert kept > 0
    for width in (0.11, 0.12):
        split(replace(SPUN, model="conserving", gamma_surface=width), views, views)
    assert len(cache.entries()) == kept


def test_a_folder_that_cannot_be_written_is_replaced_by_a_temporary_one(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "file"))
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    assert cache.cache_folder("tables", "a").is_relative_to(tmp_path)
    assert cache.root().name.startswith("fabricusd-cache-")


def test_the_command_shows_and_clears(folder, capsys):
    entry("a")
    assert main(["cache"]) == 0
    shown = capsys.readouterr().out
    assert shown.splitlines()[0] == str(folder)
    assert "tables" in shown
    assert main(["cache", "--clear"]) == 0
    assert "removed 1 entries" in capsys.readouterr().err
    assert cache.entries() == []
