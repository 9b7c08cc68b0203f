"""Checkpoint the blocks of a bake on disk until the textures are assembled.

If all lays of a sheet have a cell table, only the layout of each block is stored, and each texture
looks up its texels when it is written: that costs less than writing all maps and reading them back.
For any other sheet all maps are stored. In both cases a killed bake resumes where it stopped.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.layout.garment import Garment
from fabricusd.bake.layout.raster import NOBODY
from fabricusd.bake.texels.blocks import Layers, bake_block, composed, layers_of, top
from fabricusd.bake.texels.cell_table import rasters_of
from fabricusd.bake.texels.layers import Place, TableLayer, cut_texels, shares
from fabricusd.bake.texels.maps import TextureMap
from fabricusd.bake.texels.moment_indices import MOMENTS
from fabricusd.bake.texels.sheet import BLOCK_SIDE, Sheet
from fabricusd.files import whole_file

DIGEST = 16
"""Bytes of the checksum at a file's end; the block's top precedes it."""

MOST = np.float32(1e12)
"""Largest magnitude of a map's or moment's value, so that sums of its squares fit single precision.
"""

Floats = NDArray[np.float32]


class Checkpoint(Protocol):
    """How the blocks of one sheet are stored in files, and how maps are read back from them."""

    def write(self, path: Path, bx: int, by: int) -> None:
        """Compute a block and store it."""

    def is_sound(self, path: Path) -> bool:
        """Whether a block's file exists and its checksum and contents are valid."""

    def values(self, path: Path, bx: int, by: int, k: int, level: int) -> NDArray[Any]:
        """(h, w, channels) values of map `k` in a block."""


def space_needed(
    garment: Garment, resolution: int, maps: Sequence[TextureMap], *, values: bool = False
) -> int:
    """Upper bound on the size of all blocks of one sheet [bytes]; values : see `checkpoint_of`."""
    if not values and all(raster is not None for raster in rasters_of(garment, resolution)):
        return 2 * resolution**2
    side = min(BLOCK_SIDE, resolution)
    texels = sum((side >> level) ** 2 for level in range(side.bit_length()))
    each = sum(len(one.channels) * np.dtype(one.kind).itemsize for one in maps)
    return texels * each * (resolution // side) ** 2


def checkpoint_of(sheet: Sheet, maps: Sequence[TextureMap], *, values: bool = False) -> Checkpoint:
    """Choose how to store a sheet's blocks; values : whether it must be by their values."""
    if not values and all(table is not None for table in sheet.tables):
        return LayoutCheckpoint(sheet, maps)
    return ValuesCheckpoint(sheet, maps)


class ValuesCheckpoint:
    """A checkpoint that stores all levels of all maps."""

    def __init__(self, sheet: Sheet, maps: Sequence[TextureMap]) -> None:
        self.sheet, self.maps = sheet, maps
        self.places = [
            [
                (sheet.block_side >> level) ** 2 * len(one.channels) * np.dtype(one.kind).itemsize
                for level in range(sheet.levels)
            ]
            for one in maps
        ]
        ends = np.cumsum([0, *(count for row in self.places for count in row)])
        self.offsets = ends[:-1].reshape(len(maps), sheet.levels)

    def write(self, path: Path, bx: int, by: int) -> None:
        """Compute a block and store it."""
        write_block(path, block_of_values(self.sheet, self.maps, bx, by))

    def is_sound(self, path: Path) -> bool:
        """Whether a block's file is whole."""
        end = int(self.offsets[-1, -1]) + self.places[-1][-1]
        size = end + top_bytes(self.sheet) + DIGEST
        data = sound_data(path, size, size)
        if data is None:
            return False
        parts = [
            np.frombuffer(data, one.kind, sum(places) // np.dtype(one.kind).itemsize, first)
            for one, places, first in zip(self.maps, self.places, self.offsets[:, 0], strict=True)
        ]
        return all(map(are_values, (*parts, np.frombuffer(data[end:-DIGEST], np.float32))))

    def values(self, path: Path, bx: int, by: int, k: int, level: int) -> NDArray[Any]:
        """(h, w, channels) of a map."""
        one, side = self.maps[k], self.sheet.block_side >> level
        with path.open("rb") as stream:
            stream.seek(self.offsets[k, level])
            data = stream.read(self.places[k][level])
        return np.frombuffer(data, one.kind).reshape(side, side, len(one.channels))


def block_of_values(
    sheet: Sheet, maps: Sequence[TextureMap], bx: int, by: int
) -> list[NDArray[Any]]:
    """The parts of a block's file as `ValuesCheckpoint` stores it: all levels of all maps."""
    found, moments, share = bake_block(sheet, maps, bx, by)
    return [*(level for one in found for level in one), moments, share]


class LayoutCheckpoint:
    """A checkpoint that stores owners of texels, and moments of texels that are partly owned.

    A file holds the owners (h, w) int16, or a single number if all are equal. Then, for each lay in
    increasing order and each level from the second, follow the moments (MOMENTS, n) of the n texels
    that the lay owns in part.
    """

    def __init__(self, sheet: Sheet, maps: Sequence[TextureMap]) -> None:
        self.sheet, self.maps = sheet, maps

    def write(self, path: Path, bx: int, by: int) -> None:
        """Compute a block and store it."""
        n = self.sheet.block_side
        levels = list(layers_of(self.sheet, bx, by))
        owner = np.full((n, n), NOBODY, np.int16)
        for k, layer in levels[0].items():
            owner[layer.owned > 0] = k
        parts: list[NDArray[Any]] = [owner if np.ptp(owner) else owner[0, :1]]
        for k in sorted(levels[0]):
            parts += [
                layer.own
                for layer in (one[k] for one in levels[1:])
                if isinstance(layer, TableLayer)
            ]
        write_block(path, [*parts, *top(self.sheet, levels[-1])])

    def is_sound(self, path: Path) -> bool:
        """Whether a block's file is complete and its owners are lays of the sheet."""
        n, lays = self.sheet.block_side, len(self.sheet.garment.lays)
        tail = top_bytes(self.sheet) + DIGEST
        # Lays that share a texel each own a finer texel in it: at most n * n parts per level.
        moments = 4 * MOMENTS * n * n * self.sheet.levels
        data = sound_data(path, 2 + tail, 2 * n * n + moments + tail)
        if data is None:
            return False
        if not are_values(np.frombuffer(data[-tail:-DIGEST], np.float32)):
            return False
        if len(data) == 2 + tail:
            return NOBODY <= int(np.frombuffer(data, np.int16, 1)[0]) < lays
        if len(data) < 2 * n * n + tail:
            return False
        owner = np.frombuffer(data, np.int16, n * n).reshape(n, n)
        if owner.min() < NOBODY or owner.max() >= lays:
            return False
        if len(data) != 2 * n * n + 4 * MOMENTS * self._cut(owner) + tail:
            return False
        return are_values(np.frombuffer(data[2 * n * n : -tail], np.float32))

    def _cut(self, owner: NDArray[np.int16]) -> int:
        """Count the partly owned texels of all levels and lays."""
        count = 0
        for number in np.unique(owner[owner != NOBODY]).tolist():
            owned = (owner == number).astype(np.float32)
            for _ in range(1, self.sheet.levels):
                owned = shares(owned, 1)
                count += int(np.count_nonzero(cut_texels(owned)))
        return count

    def values(self, path: Path, bx: int, by: int, k: int, level: int) -> NDArray[Any]:
        """(h, w, channels) of a map."""
        return composed(
            self.maps[k], self._layers(path, bx, by, level), self.sheet.block_side >> level
        )

    def _layers(self, path: Path, bx: int, by: int, level: int) -> Layers:
        n, tail = self.sheet.block_side, top_bytes(self.sheet) + DIGEST
        data = path.read_bytes()
        if len(data) == 2 + tail:
            number = int(np.frombuffer(data, np.int16, 1)[0])
            whole = np.broadcast_to(np.float32(1), (n >> level, n >> level))
            return {} if number == NOBODY else {number: self._layer(number, bx, by, level, whole)}
        owner = np.frombuffer(data, np.int16, n * n).reshape(n, n)
        moments = np.frombuffer(data[2 * n * n : -tail], np.float32)
        found, begin = {}, 0
        for number in np.unique(owner[owner != NOBODY]).tolist():
            owned = (owner == number).astype(np.float32)
            for one in range(self.sheet.levels):
                count = int(np.count_nonzero(cut_texels(owned))) * MOMENTS
                if one == level:
                    own = moments[begin : begin + count].reshape(MOMENTS, -1)
                    found[number] = self._layer(number, bx, by, level, owned, own)
                begin += count
                owned = shares(owned, 1) if one + 1 < self.sheet.levels else owned
        return found

    def _layer(
        self, number: int, bx: int, by: int, level: int, owned: Floats, *own: Floats
    ) -> TableLayer:
        place = Place(sheet=self.sheet, lay=number, window=self.sheet.window(bx, by), level=level)
        table = self.sheet.tables[number]
        assert table is not None
        return TableLayer(place, table, owned, *own)


def write_block(path: Path, parts: Sequence[NDArray[Any]] | bytes) -> None:
    """Write a block's file atomically, with its checksum at the end.

    parts : arrays, or their bytes
    """
    digest = hashlib.blake2b(digest_size=DIGEST)
    with whole_file(path, durable=False) as temporary, temporary.open("wb") as stream:
        for part in (parts,) if isinstance(parts, bytes) else parts:
            data = part if isinstance(part, bytes) else np.ascontiguousarray(part).tobytes()
            digest.update(data)
            stream.write(data)
        stream.write(digest.digest())


def sound_data(path: Path, least: int, most: int) -> bytes | None:
    """Return the contents of a block's file.

    None if the file does not exist, if its size is not from `least` to `most`, or if its checksum
    is wrong.
    """
    try:
        if not path.is_file() or not least <= path.stat().st_size <= most:
            return None
        data = path.read_bytes()
    except OSError:
        return None
    known = hashlib.blake2b(data[:-DIGEST], digest_size=DIGEST).digest()
    return data if known == data[-DIGEST:] else None


def are_values(numbers: NDArray[Any]) -> bool:
    """Whether all numbers are finite and small enough to be values of maps or moments."""
    return bool((np.abs(numbers) <= MOST).all())


def top_bytes(sheet: Sheet) -> int:
    """Return the bytes of a block's top, which precedes its checksum, see `read_top`."""
    return 4 * len(sheet.garment.lays) * (MOMENTS + 1)


def read_top(path: Path, sheet: Sheet) -> tuple[Floats, Floats]:
    """Read the (lays, MOMENTS) moments and (lays,) owned shares of a block's coarsest texel."""
    lays = len(sheet.garment.lays)
    with path.open("rb") as stream:
        stream.seek(-DIGEST - top_bytes(sheet), 2)
        values = np.frombuffer(stream.read(top_bytes(sheet)), np.float32)
    return values[: lays * MOMENTS].reshape(lays, MOMENTS), values[lays * MOMENTS :]
