"""Compute one block of a sheet: its texels at every mip level that fits inside the block.

Blocks are independent of one another and computed in any order, so memory does not grow with the
resolution.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.layout.raster import NOBODY, owners
from fabricusd.bake.texels.layers import Layer, Place, layer_of
from fabricusd.bake.texels.maps import TextureMap
from fabricusd.bake.texels.moment_indices import MOMENTS
from fabricusd.bake.texels.sheet import Sheet

Layers = Mapping[int, Layer]
"""Layers by lay number."""


def layers_of(sheet: Sheet, bx: int, by: int) -> Iterator[Layers]:
    """Yield the layers of a block, level by level from the finest."""
    window = sheet.window(bx, by)
    owner, _ = owners(sheet.corners, sheet.garment.lay, window, sheet.margin, sheet.resolution)
    layers: Layers = {
        int(k): layer_of(
            Place(sheet=sheet, lay=int(k), window=window), (owner == k).astype(np.float32)
        )
        for k in np.unique(owner)
        if k != NOBODY
    }
    yield layers
    for _ in range(1, sheet.levels):
        layers = {k: layer.halved() for k, layer in layers.items()}
        yield layers


def bake_block(
    sheet: Sheet, maps: Sequence[TextureMap], bx: int, by: int
) -> tuple[list[list[NDArray[Any]]], NDArray[np.float32], NDArray[np.float32]]:
    """Compute all levels of the maps (h, w, c) in a block, and the block's `top`.

    Returns ([map][level] arrays, moments, owned share).
    """
    found: list[list[NDArray[Any]]] = [[] for _ in maps]
    layers: Layers = {}
    for level, layers in enumerate(layers_of(sheet, bx, by)):
        for k, one in enumerate(maps):
            found[k].append(composed(one, layers, sheet.block_side >> level))
    return found, *top(sheet, layers)


def top(sheet: Sheet, layers: Layers) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(lays, MOMENTS) moments and (lays,) owned share of a block's coarsest level, a single texel.

    The coarser levels of the sheet are computed from these.
    """
    lays = len(sheet.garment.lays)
    moments, share = np.zeros((lays, MOMENTS), np.float32), np.zeros(lays, np.float32)
    for k, layer in layers.items():
        moments[k], share[k] = layer.moments_at(0, 0), layer.owned[0, 0]
    return moments, share


def composed(one: TextureMap, layers: Layers, size: int) -> NDArray[Any]:
    """(size, size, channels) values of a map; each texel takes them from the lay that owns most."""
    shape = (size, size, len(one.channels))
    if len(layers) == 1:
        (only,) = layers.values()
        if only.owned.min() > 0:
            return np.ascontiguousarray(only.values(one, None), one.kind).reshape(shape)
    most = np.zeros((size, size), np.float32)
    winner = np.full((size, size), NOBODY, np.int32)
    for k, layer in layers.items():
        better = layer.owned > most
        winner[better], most[better] = k, layer.owned[better]
    out = np.empty(shape, one.kind)
    out[...] = one.empty
    for k, layer in layers.items():
        mine = winner == k
        if mine.any():
            out[mine] = layer.values(one, mine)
    return out
