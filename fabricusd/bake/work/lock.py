"""Lock an output folder so that only one process writes to it; the lock names its holder.

The operating system releases the lock when the process ends, however it ends, so a killed process
does not block others.
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
"""File that names the lock's holder. It is separate because Windows forbids reading a locked file.
"""

PATIENCE = 0.2
"""Time to wait for a lock [s]: another process may be about to remove its file."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of `folder`, which must exist, and remove a killed writer's partial files.

    Raises FabricError, naming the holder, if another process or another thread of this process
    holds the lock.
    """
    lock = FileLock(folder / LOCK, timeout=PATIENCE)
    try:
        with warnings.catch_warnings():
            # On file systems without locks, filelock warns and writes a file with the process id.
            warnings.simplefilter("ignore")
            lock.acquire()
    except Timeout:
        raise FabricError(
            str(folder),
            f"is being written by {_holder(folder)}; wait for it to finish, or name another folder",
        ) from None
    except OSError as error:
        raise FabricError(str(folder), f"cannot be written: {error.strerror}") from error
    try:
        _sign(folder)
        remove_partial_files(folder)
        yield
    finally:
        # Remove the files before releasing the lock, so that waiting processes find them gone.
        for name in (HOLDER, LOCK):
            with suppress(OSError):
                (folder / name).unlink(missing_ok=True)
        lock.release()


def refuse_locked(folder: Path) -> None:
    """Raise FabricError if another process is writing to `folder`; write nothing."""
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
        # Replace the file rather than write to it: it may be a link to a file elsewhere.
        path.unlink(missing_ok=True)
        with path.open("x", encoding="utf-8") as stream:
            json.dump(said, stream)


def _holder(folder: Path) -> str:
    """Describe the holder of the lock."""
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
