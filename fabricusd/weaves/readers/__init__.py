"""The readers of drafts, one file each: what suffix a file has says which of them reads it.

To add one: a module here with a `READER`, and its line in `READERS`. Only the module of the reader
that is asked for is imported.
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
    "wif": (".wif", ".dtx", ".wpo", ".twa"),  # its reader calls the last three by their names
    "image": (
        ".png", ".tif", ".tiff", ".bmp", ".gif", ".jpg", ".jpeg", ".exr", ".tga", ".webp",
    ),
}  # fmt: skip

Colors = list[tuple[float, float, float]]


@dataclass(frozen=True, kw_only=True)
class DraftOptions:
    """What may be said of a draft besides its file. A reader refuses what it cannot heed.

    warp, weft : linear colours of ends and picks in order, [] for those of the file
    invert : of a drawdown, white is warp on top
    """

    warp: Colors
    weft: Colors
    invert: bool = False


@dataclass(frozen=True, kw_only=True)
class DraftReader:
    """One kind of draft.

    help : what the command line says of such a file
    read : (file, options) -> Draft; FabricError where the file is none
    """

    help: str
    read: Callable[[str, DraftOptions], Draft]


def reader_name(path: str | os.PathLike[str]) -> str:
    """The name of the reader for a file, "" where its suffix is that of no draft."""
    suffix = Path(path).suffix.lower()
    return next((name for name, suffixes in READERS.items() if suffix in suffixes), "")


def suffixes() -> tuple[str, ...]:
    """The suffixes of all drafts that are read."""
    return tuple(suffix for known in READERS.values() for suffix in known)


def read_draft(
    path: str | os.PathLike[str], options: DraftOptions | None = None, reader: str = ""
) -> Draft:
    """The draft in a file, read by its suffix, or by the reader that is named."""
    name = reader or reader_name(path)
    chosen: DraftReader = import_module(f"{__name__}.{name}").READER
    return chosen.read(os.fspath(path), options or DraftOptions(warp=[], weft=[]))
