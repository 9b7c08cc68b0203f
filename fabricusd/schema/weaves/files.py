"""Opening a file that somebody names: one line of error for each way it can go wrong."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from fabricusd.errors import FabricError

LARGEST = 256 * 1024 * 1024
"""Most bytes of a text file: six times a lift plan of 4096 x 4096."""


def require_file(path: str | os.PathLike[str], kind: str) -> Path:
    """`path`, which can be opened, is an ordinary file and not empty; `kind` says what is wanted.

    Raises FabricError otherwise.
    """
    where, problem = str(path), f"it must be {kind}"
    try:
        found = os.stat(path)
        if stat.S_ISDIR(found.st_mode):
            raise FabricError(where, f"is a directory; {problem}")
        if not stat.S_ISREG(found.st_mode):
            raise FabricError(where, f"is not an ordinary file; {problem}")
        if found.st_size == 0:
            raise FabricError(where, f"is empty; {problem}")
        with open(path, "rb"):
            pass
    except FabricError:
        raise
    except FileNotFoundError:
        raise FabricError(where, f"does not exist; {problem}") from None
    except PermissionError:
        raise FabricError(where, f"may not be read by you; {problem} that you can read") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FabricError(where, f"cannot be opened ({reason}); {problem}") from None
    return Path(path)


def read_bytes(path: str | os.PathLike[str], kind: str) -> bytes:
    """The whole of a file of at most `LARGEST` bytes; FabricError where that is not possible."""
    file = require_file(path, kind)
    with file.open("rb") as stream:
        data = stream.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise FabricError(
            str(path), f"is {file.stat().st_size} bytes; it must be at most {LARGEST}"
        )
    return data
