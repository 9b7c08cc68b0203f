"""What a bake keeps between its start and its end, so that a killed one can go on.

`.bake` in the output folder holds the key of the job, the blocks that are done and a mark for each
texture that is. Everything in it is written whole; a block whose checksum is wrong counts as none.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.blocks import composed, sizes
from fabricusd.bake.layers import ComputedLayer, Layer, Place
from fabricusd.bake.maps import TextureMap
from fabricusd.bake.planes import PLANES
from fabricusd.bake.sheet import Sheet
from fabricusd.errors import FabricError
from fabricusd.files import remove_partial_files, whole_file

FOLDER = ".bake"


class Scratch:
    """The folder of one job.

    key : what the job is, in one word; another key means that nothing in the folder can be used
    """

    def __init__(self, out: Path, key: str, *, resume: bool) -> None:
        self.folder = out / FOLDER
        held = self.folder / "key"
        if resume and held.is_file() and held.read_text() != key:
            raise FabricError(
                str(out),
                "holds a bake of another scene, fabric or settings; leave --resume out to start "
                "anew",
            )
        try:
            if not resume and self.folder.exists():
                shutil.rmtree(self.folder)
            self.folder.mkdir(parents=True, exist_ok=True)
            remove_partial_files(out)
        except OSError as error:
            raise FabricError(str(out), f"cannot be written: {error.strerror}") from error
        if not held.is_file():
            with whole_file(held) as temporary:
                temporary.write_text(key)

    def block(self, sheet: Sheet, bx: int, by: int) -> Path:
        """Where a block is kept."""
        folder = self.folder / f"{sheet.garment.name}.{sheet.number}"
        folder.mkdir(exist_ok=True)
        return folder / f"{bx}_{by}.block"

    def drop(self, sheet: Sheet) -> None:
        """Forget the blocks of a sheet whose textures are all done."""
        shutil.rmtree(self.folder / f"{sheet.garment.name}.{sheet.number}", ignore_errors=True)

    def is_done(self, file: Path) -> bool:
        """Whether a texture is there, as it was when it was marked."""
        mark = self.folder / f"{file.name}.done"
        return mark.is_file() and file.is_file() and mark.read_text() == sha256(file)

    def mark_done(self, file: Path) -> None:
        """Remember that a texture is finished."""
        with whole_file(self.folder / f"{file.name}.done") as temporary:
            temporary.write_text(sha256(file))

    def close(self) -> None:
        """Remove the folder: the job is done."""
        shutil.rmtree(self.folder, ignore_errors=True)


def sha256(path: Path) -> str:
    """Checksum of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def bytes_needed(sheets: Sequence[Sheet], maps: Sequence[TextureMap]) -> int:
    """What the blocks of all sheets take."""
    total = 0
    for sheet in sheets:
        one = sum(count for row in sizes(sheet, maps) for _, count in row)
        total += one * sheet.across**2
    return total


def read_tops(
    scratch: Scratch, sheet: Sheet, maps: Sequence[TextureMap]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(lays, PLANES, n, n) planes of the texel that each block shrinks to, (lays, n, n) owned."""
    lays, n = len(sheet.garment.lays), sheet.across
    planes, owned = np.empty((lays, PLANES, n, n), np.float32), np.empty((lays, n, n), np.float32)
    last = sizes(sheet, maps)[-1][-1] if maps else (0, 0)
    count = lays * PLANES
    for by in range(n):
        for bx in range(n):
            with scratch.block(sheet, bx, by).open("rb") as stream:
                stream.seek(sum(last))
                values = np.frombuffer(stream.read(4 * (count + lays)), np.float32)
            planes[:, :, by, bx] = values[:count].reshape(lays, PLANES)
            owned[:, by, bx] = values[count:]
    return planes, owned


def bands(
    scratch: Scratch, sheet: Sheet, one: TextureMap, level: int, places: list[tuple[int, int]]
) -> Iterator[NDArray[Any]]:
    """Rows of a level that lies inside the blocks, from the top, in heights that tiles like."""
    side = sheet.block >> level
    shape = (side, side, len(one.channels))
    offset, count = places[level]
    waiting: list[NDArray[Any]] = []
    for by in range(sheet.across):
        row = np.empty((side, side * sheet.across, shape[2]), one.kind)
        for bx in range(sheet.across):
            with scratch.block(sheet, bx, by).open("rb") as stream:
                stream.seek(offset)
                values = np.frombuffer(stream.read(count), one.kind)
            row[:, bx * side : (bx + 1) * side] = values.reshape(shape)
        waiting.append(row)
        if len(waiting) * side >= 64 or by == sheet.across - 1:
            yield np.ascontiguousarray(np.concatenate(waiting))
            waiting = []


def upper_levels(
    scratch: Scratch, sheet: Sheet, maps: Sequence[TextureMap]
) -> list[list[NDArray[Any]]]:
    """[map][level] the levels above the blocks' own, whole."""
    planes, owned = read_tops(scratch, sheet, maps)
    window = (0, 0, sheet.resolution, sheet.resolution)
    layers: dict[int, Layer] = {
        k: ComputedLayer(
            Place(sheet=sheet, lay=k, window=window, level=sheet.levels - 1), planes[k], owned[k]
        )
        for k in range(len(planes))
        if owned[k].any()
    }
    found: list[list[NDArray[Any]]] = [[] for _ in maps]
    size = sheet.across
    while size > 1:
        layers = {k: layer.halved() for k, layer in layers.items()}
        size //= 2
        for k, values in enumerate(composed(maps, layers, size)):
            found[k].append(values)
    return found
