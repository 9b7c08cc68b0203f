"""The readers of drafts, one module each; the suffix of a file decides which of them reads it.

To add one, write a module here with a `READER`, and add a line to `READERS`. A module is imported
only when its reader is needed.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fabricusd.weaves.draft import Draft

READERS = {
    # module: suffixes
    "wif": (".wif", ".dtx", ".wpo", ".twa"),  # the last three are refused by what they are
    "image": (
        ".png", ".tif", ".tiff", ".bmp", ".gif", ".jpg", ".jpeg", ".exr", ".tga", ".webp",
    ),
}  # fmt: skip

Colors = list[tuple[float, float, float]]


@dataclass(frozen=True, kw_only=True)
class DraftOptions:
    """Options for reading a draft. A reader refuses an option that it cannot follow.

    warp, weft : linear colours of ends and picks in order; [] for the colours of the file
    invert : in a drawdown, white means warp on top
    """

    warp: Colors
    weft: Colors
    invert: bool = False


@dataclass(frozen=True, kw_only=True)
class DraftReader:
    """A reader for one kind of draft.

    help : the command line's description of such a file
    read : (file, options) -> Draft; raises FabricError if the file is not such a draft
    """

    help: str
    read: Callable[[str, DraftOptions], Draft]


def reader_name(path: str | os.PathLike[str]) -> str:
    """The name of the reader for a file; "" if no reader has its suffix."""
    suffix = Path(path).suffix.lower()
    return next((name for name, suffixes in READERS.items() if suffix in suffixes), "")


def suffixes() -> tuple[str, ...]:
    """The suffixes of all drafts that can be read."""
    return tuple(suffix for known in READERS.values() for suffix in known)


def read_draft(
    path: str | os.PathLike[str], options: DraftOptions | None = None, reader: str = ""
) -> Draft:
    """The draft in a file, read by the named reader, or else by the one that has its suffix."""
    name = reader or reader_name(path)
    chosen: DraftReader = import_module(f"{__name__}.{name}").READER
    return chosen.read(os.fspath(path), options or DraftOptions(warp=[], weft=[]))
