"""Cloth from a file that was dropped on the page: a draft, an image of a weave, or USD text.

A reader gets a copy in a private folder, and USD text may not name other files: whoever sends a
file learns nothing about those of this machine.
"""

from __future__ import annotations

import base64
import binascii
import re
import tempfile
from pathlib import Path
from typing import Any

from fabricusd.errors import FabricError, one_line
from fabricusd.fabric import Fabric
from fabricusd.preview.serve.wanted import MOST_THREADS, require_small
from fabricusd.schema.source import refuse_other_layers
from fabricusd.weaves.readers import reader_name

SUFFIXES: dict[str, tuple[bytes, ...]] = {
    ".wif": (), ".usda": (b"#usda",), ".png": (b"\x89PNG",), ".jpg": (b"\xff\xd8\xff",),
    ".jpeg": (b"\xff\xd8\xff",), ".bmp": (b"BM",), ".gif": (b"GIF8",),
    ".tif": (b"II", b"MM"), ".tiff": (b"II", b"MM"), ".webp": (b"RIFF",),
}  # fmt: skip
"""Files that are opened, and how they begin: a library of images would try all that it knows, and
some kinds, such as playlists, name other files."""


def opened(name: str, data: str) -> tuple[Fabric, tuple[str, ...]]:
    """(fabric, notes of its reader) of a file's name and its content in base64.

    Raises FabricError for a file of another kind, and as its reader does.
    """
    suffix = Path(name).suffix.lower()
    shown = one_line(name, 60)
    if suffix not in SUFFIXES:
        raise FabricError(shown, f"cannot be opened; it must be one of {', '.join(SUFFIXES)}")
    try:
        content = base64.b64decode(data, validate=True)
    except (binascii.Error, ValueError):
        raise FabricError(shown, "does not arrive as base64") from None
    if not content:
        raise FabricError(shown, "is empty; it must hold something")
    starts = SUFFIXES[suffix]
    if starts and not content.startswith(starts):
        raise FabricError(shown, f"is no {suffix} file by its first bytes")
    stem = re.sub(r"\W+", "_", Path(name).stem, flags=re.ASCII)[:40] or "opened"
    with tempfile.TemporaryDirectory(prefix="fabricusd-") as folder:
        path = Path(folder) / f"{stem}{suffix}"
        path.write_bytes(content)
        try:
            fabric, notes = _read(path)
        except FabricError as error:
            said = str(error).replace(str(path), shown).replace(folder, "")
            raise FabricError("", said) from error
    require_small(fabric.weave.cells.size, shown)
    if len(fabric.threads) > MOST_THREADS:
        count = len(fabric.threads)
        raise FabricError(
            shown, f"has {count} threads; it must have at most {MOST_THREADS} to be served"
        )
    return fabric, tuple(note.replace(folder, "") for note in notes)


def _read(path: Path) -> tuple[Fabric, tuple[str, ...]]:
    from fabricusd.schema.anysource import load_any

    if not reader_name(path):
        refuse_other_layers(path)
        return load_any(path)
    return _of_draft(path)


def _of_draft(path: Path) -> tuple[Fabric, tuple[str, ...]]:
    """As `load_any`, but a draft that is too large is refused before it is dyed."""
    from fabricusd.schema.anysource import load_any
    from fabricusd.weaves.readers import read_draft

    draft: Any = read_draft(path)
    if draft.weave is not None:
        require_small(draft.weave.cells.size, path.name)
    return load_any(path)
