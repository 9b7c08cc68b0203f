"""Load textures from files, and from packages, in which Blender cannot open them."""

from __future__ import annotations

import io
import os
import tempfile
import zipfile
from typing import Any

import bpy

TILE = "<UDIM>"


class Images:
    """Loads each texture of an import once.

    missing : names of those that could not be read
    """

    def __init__(self) -> None:
        self.loaded: dict[str, Any] = {}
        self.missing: list[str] = []

    def __call__(self, path: str, *, data: bool, four: bool = False) -> Any:
        """Return the image at `path`, `FILE` or `FILE.usdz[FILE]`; None if it cannot be read.

        data : whether the image holds data rather than linear Rec. 709 colour
        four : whether its fourth channel is data and no opacity
        """
        if path not in self.loaded:
            try:
                self.loaded[path] = _from_package(path) if "[" in path else _from_file(path)
            except (OSError, KeyError, RuntimeError, zipfile.BadZipFile):
                self.loaded[path] = None
                self.missing.append(os.path.basename(path.rstrip("]")))
        image = self.loaded[path]
        if image is not None:
            image.colorspace_settings.name = "Non-Color" if data else "Linear Rec.709"
            if four:
                image.alpha_mode = "CHANNEL_PACKED"
        return image


def _from_file(path: str) -> Any:
    known = (i for i in bpy.data.images if not i.packed_file and _absolute(i) == path)
    return next(known, None) or _load(path)


def _absolute(image: Any) -> str:
    return str(bpy.path.abspath(image.filepath, library=image.library))


def _load(path: str) -> Any:
    image = bpy.data.images.load(path)
    if TILE in path:
        # Blender then looks for the tiles.
        image.source = "TILED"
    return image


def _from_package(path: str) -> Any:
    """Load what is in a package into memory, where it stays without the package."""
    outer, inner = path.removesuffix("]").split("[", 1)
    with open(outer, "rb") as file:
        content = file.read()
    while "[" in inner:
        name, inner = inner.removesuffix("]").split("[", 1)
        content = zipfile.ZipFile(io.BytesIO(content)).read(name)
    package = zipfile.ZipFile(io.BytesIO(content))
    head, _, tail = inner.partition(TILE)
    with tempfile.TemporaryDirectory() as folder:
        for name in package.namelist():
            whole = name == inner or (TILE in inner and _is_tile(name, head, tail))
            if whole:
                with open(os.path.join(folder, os.path.basename(name)), "wb") as file:
                    file.write(package.read(name))
        image = _load(os.path.join(folder, os.path.basename(inner)))
        image.pack()
    return image


def _is_tile(name: str, head: str, tail: str) -> bool:
    return name.startswith(head) and name.endswith(tail) and name[len(head) :][:4].isdigit()
