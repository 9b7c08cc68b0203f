"""One block of a texture set: its texels at every level that fits inside the block.

Blocks are computed in any order and do not know one another, so memory is flat in the resolution;
each is kept in a file of its own until the textures are put together, so that a bake that was
killed goes on where it stopped.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.layers import Layer, Place, layer_of
from fabricusd.bake.maps import TextureMap
from fabricusd.bake.planes import PLANES
from fabricusd.bake.raster import NOBODY, owners
from fabricusd.bake.sheet import Sheet
from fabricusd.files import whole_file


def bake_block(
    sheet: Sheet, maps: Sequence[TextureMap], bx: int, by: int
) -> tuple[list[list[NDArray[Any]]], NDArray[np.float32], NDArray[np.float32]]:
    """Levels of every map (h, w, c) in a block, and what the levels above it are made from.

    Returns ([map][level] arrays, (lays, PLANES) planes and (lays,) owned share of the one texel
    that the block shrinks to).
    """
    window = sheet.window(bx, by)
    owner, _ = owners(sheet.corners, sheet.garment.lay, window, sheet.margin, sheet.resolution)
    layers: dict[int, Layer] = {
        int(k): layer_of(
            Place(sheet=sheet, lay=int(k), window=window), (owner == k).astype(np.float32)
        )
        for k in np.unique(owner)
        if k != NOBODY
    }
    found: list[list[NDArray[Any]]] = [[] for _ in maps]
    for level in range(sheet.levels):
        for k, values in enumerate(composed(maps, layers, sheet.block >> level)):
            found[k].append(values)
        if level + 1 < sheet.levels:
            layers = {k: layer.halved() for k, layer in layers.items()}
    lays = len(sheet.garment.lays)
    top, share = np.zeros((lays, PLANES), np.float32), np.zeros(lays, np.float32)
    for k, layer in layers.items():
        top[k], share[k] = layer.planes_at(0, 0), layer.owned[0, 0]
    return found, top, share


def composed(
    maps: Sequence[TextureMap], layers: Mapping[int, Layer], size: int
) -> list[NDArray[Any]]:
    """(size, size, channels) of each map, each texel from the lay that owns most of it."""
    most = np.zeros((size, size), np.float32)
    winner = np.full((size, size), NOBODY, np.int32)
    for k, layer in layers.items():
        better = layer.owned > most
        winner[better], most[better] = k, layer.owned[better]
    found = []
    present = {k: winner == k for k in layers}
    for one in maps:
        out = np.empty((size, size, len(one.channels)), one.kind)
        whole = [k for k, mine in present.items() if mine.all()]
        if whole:
            out[...] = layers[whole[0]].values(one, None).reshape(out.shape)
        else:
            out[...] = one.empty
            for k, mine in present.items():
                if mine.any():
                    out[mine] = layers[k].values(one, mine)
        found.append(out)
    return found


def sizes(sheet: Sheet, maps: Sequence[TextureMap]) -> list[list[tuple[int, int]]]:
    """[map][level] (offset, bytes) inside a block's file, planes of the top behind them."""
    offset, found = 0, []
    for one in maps:
        row = []
        for level in range(sheet.levels):
            count = (sheet.block >> level) ** 2 * len(one.channels) * np.dtype(one.kind).itemsize
            row.append((offset, count))
            offset += count
        found.append(row)
    return found


def write_block(
    path: Path,
    found: list[list[NDArray[Any]]],
    top: NDArray[np.float32],
    share: NDArray[np.float32],
) -> None:
    """A block's file, whole or not at all, its checksum at the end."""
    digest = hashlib.blake2b(digest_size=16)
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        for part in (*(level for one in found for level in one), top, share):
            data = np.ascontiguousarray(part).data.cast("B")
            digest.update(data)
            stream.write(data)
        stream.write(digest.digest())


def block_is_sound(path: Path) -> bool:
    """Whether a block's file is there and is what was written."""
    try:
        data = path.read_bytes()
    except OSError:
        return False
    return len(data) > 16 and hashlib.blake2b(data[:-16], digest_size=16).digest() == data[-16:]
