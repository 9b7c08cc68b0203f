"""The bytes of a draft that somebody names."""

from __future__ import annotations

import os

from fabricusd.errors import FabricError
from fabricusd.files import readable_file

LARGEST = 256 * 1024 * 1024
"""Most bytes of a text file: six times a lift plan of 4096 x 4096."""


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """The whole of a file of at most `LARGEST` bytes; FabricError where that is not possible."""
    with readable_file(path).open("rb") as stream:
        data = stream.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise FabricError(str(path), f"is longer than the {LARGEST} bytes of the largest draft")
    return data
