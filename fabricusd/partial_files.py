"""Names of files that are being written, and the removal of those whose writer was killed."""

from __future__ import annotations

import hashlib
import os
import re
import socket
import sys
import time
from contextlib import suppress
from functools import cache

_MARK = ".partial-"

_OWNED = re.compile(r"\..*\.partial-([0-9a-f]{8})-([0-9]+)-([0-9]+)-")
"""Name of a partial file: its machine, its process, and when that process was started."""

_LEFT_OVER = 86400.0
"""Seconds after which a partial file from another machine, whose processes cannot be queried,
counts as left over: files are computed elsewhere, and writing one takes minutes at most."""

_LONGEST_STEM = 40
"""Most characters of the file's own name: the partial name must fit into 255 bytes."""


def partial_prefix(stem: str) -> str:
    """Beginning of the partial name of a file that this process writes."""
    process = os.getpid()
    return f".{stem[:_LONGEST_STEM]}{_MARK}{_machine()}-{process}-{_start_of(process)[0]}-"


def remove_partial_files(folder: str | os.PathLike[str]) -> None:
    """Remove files that `whole_file` left in `folder` when its process was killed.

    Files of running processes are left alone, and so are, for a day, those of another machine.
    A file that cannot be removed stays.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith(".") and _MARK in entry.name and _is_stale(entry):
                with suppress(OSError):
                    os.unlink(entry.path)


@cache
def _folders() -> set[str]:
    """Folders that this process has written to."""
    return set()


def remove_partial_files_once(folder: str | os.PathLike[str]) -> None:
    """Call `remove_partial_files` the first time that this process writes into `folder`."""
    name = os.path.abspath(folder)
    if name not in _folders():
        _folders().add(name)
        remove_partial_files(name)


def remove_own_partial_files() -> None:
    """Remove this process's own partial files: an interrupt may have stopped a writer anywhere."""
    own = partial_prefix("").removeprefix(".")
    for folder in _folders():
        with suppress(OSError), os.scandir(folder) as entries:
            for entry in entries:
                if own in entry.name:
                    with suppress(OSError):
                        os.unlink(entry.path)


def _is_stale(entry: os.DirEntry[str]) -> bool:
    owner = _OWNED.match(entry.name)
    if owner and owner[1] == _machine() and sys.platform != "win32":
        return not _lives(int(owner[2]), owner[3])
    try:
        return entry.stat(follow_symlinks=False).st_mtime < time.time() - _LEFT_OVER
    except OSError:
        return False


def _lives(process: int, start: str) -> bool:
    """Whether that process is running, rather than a later one with the same number."""
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # somebody else's
        return True
    began, state = _start_of(process)
    return state not in ("Z", "X") and began == start


def _start_of(process: int) -> tuple[str, str]:
    """(when a process was started, its state), both as Linux reports them; ("0", "") elsewhere."""
    try:
        with open(f"/proc/{process}/stat", encoding="utf-8", errors="replace") as stream:
            words = stream.read().rpartition(")")[2].split()
        return words[19], words[0]
    except (OSError, IndexError):
        return "0", ""


@cache
def _machine() -> str:
    """Eight hexadecimal digits for the namespace of process numbers: this boot of this machine."""
    words = [socket.gethostname()]
    with suppress(OSError), open("/proc/sys/kernel/random/boot_id", encoding="ascii") as stream:
        words.append(stream.read())
    with suppress(OSError):
        words.append(os.readlink("/proc/self/ns/pid"))
    return hashlib.sha256("\n".join(words).encode("utf-8", "replace")).hexdigest()[:8]
