"""Load a fabric from a USD file, a WIF draft, an image, or a preset's name."""

from __future__ import annotations

import os
from pathlib import Path

from fabricusd.errors import reads
from fabricusd.fabric import Fabric
from fabricusd.weaves.readers import read_draft, reader_name


def is_draft(source: str | os.PathLike[str]) -> bool:
    """Whether `source` is a draft or an image by its suffix, and not USD."""
    return bool(reader_name(source))


@reads("a fabric")
def load_any(source: str | os.PathLike[str]) -> tuple[Fabric, tuple[str, ...]]:
    """Return (fabric, notes of the reader). Raises FabricError as that reader does."""
    text = os.fspath(source)
    if is_draft(text):
        from fabricusd.dye.make import made_of_colors, thread_of
        from fabricusd.weaves import losses, to_fabric

        draft = read_draft(text)
        woven = to_fabric(draft, thread_of(), name=Path(text).stem)
        done = made_of_colors(woven, palette=draft.palette)
        return done.fabric, (*draft.warnings, *losses(draft), *done.notes)
    from fabricusd.schema.read import load_noted

    return load_noted(text)
