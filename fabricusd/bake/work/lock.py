"""One writer a folder: a lock that says who holds it.

The system lets go of the lock when its process ends, however it ends, so a lock that a killed
process left behind stops nobody.
"""

from __future__ import annotations

import json
import os
import socket
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

from filelock import FileLock, Timeout

from fabricusd.errors import FabricError
from fabricusd.files import remove_partial_files

LOCK = ".fabricusd.lock"
HOLDER = ".fabricusd.holder"
"""Who holds the lock, in a file of its own: Windows lets nobody read a file that is locked."""

PATIENCE = 0.2
"""Seconds to wait for a lock: another process may just be about to remove its file."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Be the only one that writes into `folder`, which must exist, and clear it of what a killed
    writer left half written.

    Raises FabricError, saying who, where another process, or another thread of this one, writes.
    """
    lock = FileLock(folder / LOCK, timeout=PATIENCE)
    try:
        with warnings.catch_warnings():
            # A file system without such locks takes a file with the process's number instead.
            warnings.simplefilter("ignore")
            lock.acquire()
    except Timeout:
        raise FabricError(
            str(folder), f"is being written by {_holder(folder)}; wait for it, or name another"
        ) from None
    except OSError as error:
        raise FabricError(str(folder), f"cannot be written: {error.strerror}") from error
    try:
        _sign(folder)
        remove_partial_files(folder)
        yield
    finally:
        # The files go while the lock is held: whoever opened them before finds them gone.
        for name in (HOLDER, LOCK):
            with suppress(OSError):
                (folder / name).unlink(missing_ok=True)
        lock.release()


def refuse_locked(folder: Path) -> None:
    """Raise FabricError where somebody writes into `folder`; nothing is written."""
    if not (folder / LOCK).is_file() or not os.access(folder, os.W_OK):
        return
    with locked(folder):
        pass


def _sign(folder: Path) -> None:
    said = {
        "process": os.getpid(),
        "host": socket.gethostname(),
        "since": datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC"),
    }
    path = folder / HOLDER
    with suppress(OSError):
        # A new file: what is there may be a link to somewhere else.
        path.unlink(missing_ok=True)
        with path.open("x", encoding="utf-8") as stream:
            json.dump(said, stream)


def _holder(folder: Path) -> str:
    """Who holds the lock, in words."""
    path = folder / HOLDER
    if not path.is_file():
        return "another process"
    try:
        with path.open("rb") as stream:
            said = json.loads(stream.read(1000))
        number, host, since = int(said["process"]), str(said["host"]), str(said["since"])
    except (OSError, ValueError, KeyError, TypeError):
        return "another process"
    return f"process {number} on {host[:80]} since {since[:40]}"
