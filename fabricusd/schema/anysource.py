"""A fabric from whatever a user has: a USD file, a WIF draft, an image, or a preset's name."""

from __future__ import annotations

import os
from pathlib import Path

from fabricusd.errors import reads
from fabricusd.fabric import Fabric

IMAGE_SUFFIXES = (".png", ".tif", ".tiff", ".bmp", ".gif", ".jpg", ".jpeg", ".exr", ".tga", ".webp")


DRAFT_SUFFIXES = (".wif", ".dtx", ".wpo", ".twa")
"""Drafts. Of these only WIF is read; its reader calls the others by their names."""


def is_draft(source: str | os.PathLike[str]) -> bool:
    """Whether `source` is a draft or an image by its suffix, and not USD."""
    return Path(source).suffix.lower() in (*DRAFT_SUFFIXES, *IMAGE_SUFFIXES)


@reads("a fabric")
def load_any(source: str | os.PathLike[str]) -> tuple[Fabric, tuple[str, ...]]:
    """(fabric, what was noticed on the way). FabricError as the reader of that kind raises it."""
    text = os.fspath(source)
    if is_draft(text):
        from fabricusd.weaves import losses, read_image, read_wif, to_fabric

        drawn = text.lower().endswith(IMAGE_SUFFIXES)
        draft = read_image(text) if drawn else read_wif(text)
        return to_fabric(draft, name=Path(text).stem), (*draft.warnings, *losses(draft))
    from fabricusd.schema.read import load

    return load(text), ()
