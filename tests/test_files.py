"""Files that appear whole, and what they may stand in place of."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fabricusd.errors import FabricError
from fabricusd.files import _begin, remove_partial_files, require_writable, whole_file
from fabricusd.partial_files import remove_own_partial_files

ROOT = str(Path(__file__).resolve().parents[1])


def write(path, text="new"):
    with whole_file(path) as temporary:
        temporary.write_text(text)


def test_a_link_stays_and_its_file_is_replaced(tmp_path):
    (tmp_path / "there").mkdir()
    target, link = tmp_path / "there" / "v1.usda", tmp_path / "latest.usda"
    target.write_text("old")
    link.symlink_to(target)
    write(link)
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["latest.usda", "there", "v1.usda"]


def test_a_link_to_nothing_yet_gets_its_file(tmp_path):
    (tmp_path / "latest.usda").symlink_to(tmp_path / "v2.usda")
    write(tmp_path / "latest.usda")
    assert (tmp_path / "v2.usda").read_text() == "new"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
def test_a_pipe_is_refused_and_stays_one(tmp_path):
    pipe = tmp_path / "pipe.usda"
    os.mkfifo(pipe)
    with pytest.raises(FabricError, match="is a pipe or a device; it must be the name of a file"):
        write(pipe)
    assert pipe.is_fifo()


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "a.usda"
    target.write_text("old")

    def half(temporary):
        temporary.write_text("half")
        raise RuntimeError

    with pytest.raises(RuntimeError), whole_file(target) as temporary:
        half(temporary)
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.usda"]


HOLD = """
import sys
from fabricusd.files import _begin, whole_file

with whole_file(sys.argv[1]) as temporary:
    temporary.write_text(sys.argv[2])
    print(temporary, flush=True)
    sys.stdin.read()
"""

posix = pytest.mark.skipif(os.name != "posix", reason="elsewhere partial files go by their age")


def partial_files(folder):
    return [p for p in folder.iterdir() if ".partial-" in p.name]


def writer(path, text):
    """(a process that is writing `path`, its partial file)"""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(path), text], stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": ROOT},
    )  # fmt: skip
    return process, Path(process.stdout.readline().strip())


@posix
def test_the_next_writer_removes_a_killed_ones_file_and_leaves_that_of_a_living_one(tmp_path):
    """Two processes that live, one that was killed, all at one file."""
    target = tmp_path / "a.usda"
    living, mine = writer(target, "theirs")
    killed, debris = writer(target, "half")
    try:
        killed.kill()
        # Nobody has asked for its status yet, so that its number is still taken.
        wait_until(lambda: _state(killed.pid) in ("Z", ""))
        another, _ = writer(target, "first")
        another.communicate("")
        assert target.read_text() == "first"
        assert not debris.exists()
        assert partial_files(tmp_path) == [mine]
        assert mine.read_text() == "theirs"
        living.communicate("")
        assert living.returncode == 0
        assert target.read_text() == "theirs"
        assert partial_files(tmp_path) == []
    finally:
        for process in (living, killed):
            process.kill()
            process.communicate()


def _state(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return ""


def wait_until(true, seconds=30.0):
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@posix
def test_a_process_of_the_same_number_is_another_one(tmp_path):
    """In a container, where numbers are low, a killed process's is soon that of the next."""
    with whole_file(tmp_path / "a.usda") as mine:
        mine.write_text("new")
        words = mine.name.split("-")
        old = tmp_path / "-".join([*words[:3], "1", words[4]])
        if words[3] == "0":
            pytest.skip("this system does not tell when a process was started")
        old.write_text("half")
        remove_partial_files(tmp_path)
        assert partial_files(tmp_path) == [mine]


def test_partial_files_of_other_machines_go_by_their_age(tmp_path):
    young, old, of_old = (
        tmp_path / f".a.partial-{name}.usda" for name in ("0123abcd-7-1-x", "4567abcd-7-1-x", "x")
    )
    for path in (young, old, of_old, tmp_path / "a.partial-mine.usda", tmp_path / ".a.usda"):
        path.write_text("half")
    for path in (old, of_old):
        os.utime(path, (1, 1))
    remove_partial_files(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(
        [young.name, "a.partial-mine.usda", ".a.usda"]
    )


def test_what_an_interrupt_has_left_of_this_process_is_removed_and_nothing_else(tmp_path):
    mine, _ = _begin(tmp_path / "a.usda", clobber=True)[1], write(tmp_path / "b.usda")
    other = tmp_path / mine.name.replace(f"-{os.getpid()}-", "-1-")
    other.write_text("half")
    remove_own_partial_files()
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(["b.usda", other.name])


def test_a_long_name_is_written_and_one_that_is_too_long_refused_before_the_work(tmp_path):
    write(tmp_path / ("é" * 120 + ".usda"))
    for call in (write, require_writable):
        with pytest.raises(FabricError, match="cannot be written: File name too long"):
            call(tmp_path / ("a" * 252 + ".usda"))


@pytest.mark.parametrize("name", ["a\0b.usda", "a\ud800.usda"])
def test_a_name_that_is_none_is_refused(tmp_path, name):
    with pytest.raises(FabricError, match="is not a file name"):
        write(tmp_path / name)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has /proc/self/fd")
def test_content_is_on_the_disk_before_its_name_is(tmp_path, monkeypatch):
    done = []
    monkeypatch.setattr(
        os, "fsync", lambda handle: done.append(os.readlink(f"/proc/self/fd/{handle}"))
    )
    monkeypatch.setattr(
        Path,
        "replace",
        lambda self, to, rename=Path.replace: (done.append(f"to {to}"), rename(self, to)),
    )
    target = tmp_path / "a.usda"
    write(target)
    assert ".partial-" in done[0]
    assert done[1:] == [f"to {target}", str(tmp_path)]
    done.clear()
    with whole_file(target, durable=False) as temporary:
        temporary.write_text("x")
    assert done == [f"to {target}"]


def test_a_disk_that_fails_at_the_last_moment_keeps_the_old_file(tmp_path, monkeypatch):
    target = tmp_path / "a.usda"
    target.write_text("old")

    def fail(handle):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(FabricError, match=r"a\.usda cannot be written: Input/output error"):
        write(target)
    assert target.read_text() == "old"
    assert partial_files(tmp_path) == []
