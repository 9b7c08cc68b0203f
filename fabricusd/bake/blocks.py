"""One block of a texture set: its texels at every level that fits inside the block.

Blocks are computed in any order and do not know one another, so memory is flat in the resolution;
each is kept in a file of its own until the textures are put together, so that a bake that was
killed goes on where it stopped.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.compiled import true_repeat
from fabricusd.bake import moments as m
from fabricusd.bake.garment import Garment
from fabricusd.bake.maps import Texels, TextureMap
from fabricusd.bake.raster import NOBODY, owners, texel_triangles
from fabricusd.files import whole_file

BLOCK = 256
"""Texels along a block's side: 12 MB of planes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet:
    """One texture of a set: a UDIM tile of a garment at a resolution.

    corners : (m, 3, 2) float64 - the garment's triangles in texels of this tile
    """

    garment: Garment
    recipes: tuple[m.Recipe, ...]
    tile: tuple[int, int]
    number: int
    resolution: int
    margin: int
    corners: NDArray[np.float64]

    @property
    def block(self) -> int:
        """Texels along a block's side."""
        return min(BLOCK, self.resolution)

    @property
    def across(self) -> int:
        """Blocks along the sheet's side."""
        return self.resolution // self.block

    @property
    def levels(self) -> int:
        """Mip levels inside a block, down to one texel."""
        return self.block.bit_length()


def sheet_of(
    garment: Garment,
    recipes: tuple[m.Recipe, ...],
    number: int,
    tile: tuple[int, int],
    resolution: int,
    margin: int,
) -> Sheet:
    """The sheet of a tile."""
    return Sheet(
        garment=garment,
        recipes=recipes,
        tile=tile,
        number=number,
        resolution=resolution,
        margin=margin,
        corners=texel_triangles(garment.uv, tile, resolution),
    )


def texel_step(sheet: Sheet, lay: int, scale: int = 1) -> NDArray[np.float64]:
    """(2, 2) threads that one texel of side `scale` spans: columns for right and for down."""
    return sheet.garment.lays[lay].matrix @ np.diag((1.0, -1.0)) * (scale / sheet.resolution)


def texel_start(sheet: Sheet, lay: int, x: float, y: float) -> NDArray[np.float64]:
    """(2,) weave coordinates of the texel corner (x, y), reduced modulo the repeat in float64."""
    one = sheet.garment.lays[lay]
    uv = np.array(
        [sheet.tile[0] + x / sheet.resolution, sheet.tile[1] + 1.0 - y / sheet.resolution]
    )
    return np.asarray(np.mod(one.matrix @ uv + one.offset, true_repeat(one.fabric)))


def bake_block(
    sheet: Sheet, maps: Sequence[TextureMap], bx: int, by: int
) -> tuple[list[list[NDArray[Any]]], NDArray[np.float32], NDArray[np.float32]]:
    """Levels of every map (h, w, c) in a block, and what the levels above it are made from.

    Returns ([map][level] arrays, (lays, PLANES) planes and (lays,) owned share of the one texel
    that the block shrinks to).
    """
    size = sheet.block
    window = (bx * size, by * size, (bx + 1) * size, (by + 1) * size)
    owner, _ = owners(sheet.corners, sheet.garment.lay, window, sheet.margin, sheet.resolution)
    stacks = {
        int(k): _planes(sheet, int(k), owner, window) for k in np.unique(owner) if k != NOBODY
    }
    found: list[list[NDArray[Any]]] = [[] for _ in maps]
    for level in range(sheet.levels):
        layers = {
            k: (planes, owned, *centres(sheet, k, window, level))
            for k, (planes, owned) in stacks.items()
        }
        for k, one in enumerate(maps):
            found[k].append(compose(sheet, one, layers, size >> level))
        if level + 1 < sheet.levels:
            stacks = {k: m.halve(planes, owned) for k, (planes, owned) in stacks.items()}
    lays = len(sheet.garment.lays)
    top, share = np.zeros((lays, m.PLANES), np.float32), np.zeros(lays, np.float32)
    for k, (planes, owned) in stacks.items():
        top[k], share[k] = planes[:, 0, 0], owned[0, 0]
    return found, top, share


def _planes(
    sheet: Sheet, lay: int, owner: NDArray[np.int32], window: tuple[int, int, int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    planes = np.zeros((m.PLANES, *owner.shape), np.float32)
    step = texel_step(sheet, lay)
    made = sheet.recipes[lay]
    side = m.samples_for(made, step, true_repeat(sheet.garment.lays[lay].fabric))
    start = texel_start(sheet, lay, window[0], window[1])
    sums = np.empty(m.PLANES, np.float32)
    m.texels(made, step, start, (window[0], window[1]), owner, lay, side, sums, planes)
    return planes, (owner == lay).astype(np.float32)


def centres(
    sheet: Sheet, lay: int, window: tuple[int, int, int, int], level: int
) -> tuple[NDArray[np.float64], NDArray[Any], NDArray[Any]]:
    """Weave coordinates (h, w, 2) of a level's texel centres, and the set and thread there.

    window : (x0, y0, x1, y1) - a square of texels of the finest level
    """
    count = (window[2] - window[0]) >> level
    step = texel_step(sheet, lay, 1 << level)
    start = texel_start(sheet, lay, window[0], window[1])
    place = np.arange(count) + 0.5
    weave = np.empty((count, count, 2))
    repeat = true_repeat(sheet.garment.lays[lay].fabric)
    for axis in range(2):
        line = start[axis] + step[axis, 0] * place[None, :] + step[axis, 1] * place[:, None]
        weave[..., axis] = np.mod(line, repeat[axis])
    sets, threads = np.empty(count * count, np.uint8), np.empty(count * count, np.int32)
    m.threads_under(sheet.recipes[lay].cloth, weave.reshape(-1, 2), sets, threads)
    return weave, sets.reshape(count, count), threads.reshape(count, count)


def compose(
    sheet: Sheet, one: TextureMap, layers: dict[int, tuple[Any, ...]], size: int
) -> NDArray[Any]:
    """(size, size, channels) of a map, each texel from the lay that owns most of it."""
    out = np.empty((size, size, len(one.channels)), one.kind)
    out[...] = one.empty
    if not layers:
        return out
    best = np.full((size, size), 0.0, np.float32)
    winner = np.full((size, size), NOBODY, np.int32)
    for k, layer in layers.items():
        better = layer[1] > best
        winner[better], best[better] = k, layer[1][better]
    for k, (planes, _, weave, which, thread) in layers.items():
        mine = winner == k
        whole = bool(mine.all())
        if not whole and not mine.any():
            continue

        def pick(array: NDArray[Any], mine: Any = mine, whole: bool = whole) -> NDArray[Any]:
            flat = array.reshape(*array.shape[:-2], -1)
            return flat if whole else flat[..., mine.ravel()]

        lay = sheet.garment.lays[k]
        texels = Texels(
            planes=pick(planes),
            usual=sheet.recipes[k].mean,
            along=lay.along,
            weave=pick(np.moveaxis(weave, -1, 0)).T,
            hit=(pick(which), pick(thread)),
            types=len(lay.fabric.threads),
            lay=k,
        )
        values = one.function(texels)
        if whole:
            out[...] = values.reshape(size, size, -1)
        else:
            out[mine] = values
    return out


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
