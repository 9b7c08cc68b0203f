"""The cache on disk stays below its bound, and never loses what is in use."""

from __future__ import annotations

import os
import time

import pytest

from fabricusd import cache
from fabricusd.cli.main import main

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
    entry("old", days=9)
    entry("older", days=10)
    entry("new")
    assert [e.key for e in cache.entries()] == ["old", "new"]


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
