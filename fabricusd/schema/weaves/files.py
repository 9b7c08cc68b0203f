"""Opening a draft that somebody names: one line of error for each way it can go wrong."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from fabricusd.errors import FabricError
from fabricusd.files import readable_file

LARGEST = 256 * 1024 * 1024
"""Most bytes of a text file: six times a lift plan of 4096 x 4096."""


def ordinary_file(path: str | os.PathLike[str]) -> Path:
    """`path`, if it is a file that can be opened, has an end, and is not empty.

    Raises FabricError otherwise.
    """
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return readable_file(path)  # which says why not
    except ValueError as error:
        raise FabricError(repr(str(path)), f"is no file name: {error}") from None
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise FabricError(str(path), "is a pipe or a device; it must be a file")
    return readable_file(path)


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """The whole of a file of at most `LARGEST` bytes; FabricError where that is not possible."""
    with ordinary_file(path).open("rb") as stream:
        data = stream.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise FabricError(str(path), f"is longer than the {LARGEST} bytes of the largest draft")
    return data
