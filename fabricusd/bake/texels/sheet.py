"""Describe a sheet: one UDIM tile of a garment at a given resolution, divided into blocks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.layout.garment import Garment
from fabricusd.bake.layout.raster import texel_triangles
from fabricusd.bake.texels.cell_table import CellTable, tables_of
from fabricusd.bake.texels.recipe import Recipe
from fabricusd.bake.texels.repeat import baked_repeat

SMALLEST, LARGEST = 64, 32768
"""Texels along a side of a texture. Most tools cannot open larger ones; use more UDIM tiles."""

BLOCK_SIDE = 256
"""Texels along the side of a block, whose moments take 18 MB."""

Window = tuple[int, int, int, int]
"""(x0, y0, x1, y1): texels of the finest level in the half-open ranges [x0, x1) and [y0, y1)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet:
    """A UDIM tile of a garment at a given resolution; every map has one texture of it.

    recipes : of each lay
    tile : (column, row); number : its UDIM number
    margin : texels by which UV shells are extended beyond their border
    corners : (m, 3, 2) float64 - the garment's triangles in texels of this tile
    tables : cell table of each lay, None if its texels are computed one by one
    """

    garment: Garment
    recipes: tuple[Recipe, ...]
    tile: tuple[int, int]
    number: int
    resolution: int
    margin: int
    corners: NDArray[np.float64]
    tables: tuple[CellTable | None, ...] = ()

    @property
    def block_side(self) -> int:
        """Texels along a block's side."""
        return min(BLOCK_SIDE, self.resolution)

    @property
    def across(self) -> int:
        """Blocks along the sheet's side."""
        return self.resolution // self.block_side

    @property
    def levels(self) -> int:
        """Mip levels inside a block, down to one texel."""
        return self.block_side.bit_length()

    def window(self, bx: int, by: int) -> Window:
        """Return the texels of a block."""
        size = self.block_side
        return bx * size, by * size, (bx + 1) * size, (by + 1) * size


def sheets_of(
    garment: Garment,
    recipes: tuple[Recipe, ...],
    tiles: Mapping[int, tuple[int, int]],
    resolution: int,
    margin: int,
) -> list[Sheet]:
    """Return the sheets of a garment's tiles, by UDIM number; they share their cell tables."""
    found = [
        Sheet(
            garment=garment,
            recipes=recipes,
            tile=tile,
            number=number,
            resolution=resolution,
            margin=margin,
            corners=texel_triangles(garment.uv, tile, resolution),
        )
        for number, tile in tiles.items()
    ]
    tables = tables_of(garment, recipes, resolution, found[0].levels)
    return [replace(sheet, tables=tables) for sheet in found]


def texel_step(sheet: Sheet, lay: int, scale: int = 1) -> NDArray[np.float64]:
    """(2, 2) threads that a texel of side `scale` spans: columns for right and for down."""
    return sheet.garment.lays[lay].matrix @ np.diag((1.0, -1.0)) * (scale / sheet.resolution)


def texel_start(sheet: Sheet, lay: int, x: float, y: float) -> NDArray[np.float64]:
    """(2,) weave coordinates of the texel corner (x, y) in float64, reduced modulo the repeat
    unless the threads are uneven: no repeat repeats those."""
    one = sheet.garment.lays[lay]
    uv = np.array(
        [sheet.tile[0] + x / sheet.resolution, sheet.tile[1] + 1.0 - y / sheet.resolution]
    )
    place = one.matrix @ uv + one.offset
    return np.asarray(
        place if one.fabric.is_uneven else np.mod(place, baked_repeat(one.fabric)), np.float64
    )
