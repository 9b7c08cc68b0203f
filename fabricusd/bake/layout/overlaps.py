"""Refuse a UV layout that overlaps itself: two places on the cloth would share their texels."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fabricusd.bake.layout.garment import Garment
from fabricusd.bake.layout.raster import overlap_map, texel_triangles, times_covered
from fabricusd.errors import FabricError
from fabricusd.images.files import write_png


def refuse_overlaps(
    garment: Garment, tiles: dict[int, tuple[int, int]], size: int, folder: Path | None
) -> None:
    """Raise FabricError if any texel of a tile of `size` texels a side lies in two triangles.

    A picture of the overlaps is written to `<garment>.overlaps.<tile>.png` in `folder`, unless
    `folder` is None.
    """
    for number, tile in tiles.items():
        corners = texel_triangles(garment.uv, tile, size)
        inside = ((corners.min(axis=1) < size) & (corners.max(axis=1) > 0)).all(axis=1)
        count, pairs = times_covered(corners[inside], (size, size))
        twice = int(np.count_nonzero(count > 1))
        if not twice:
            continue
        shown = ""
        if folder is not None:
            picture = folder / f"{garment.name}.overlaps.{number}.png"
            write_png(picture, overlap_map(corners[inside], size))
            shown = f", see {picture}"
        first, second = np.flatnonzero(inside)[pairs[0]]
        share = twice / max(int(np.count_nonzero(count)), 1)
        raise FabricError(
            garment.copies[0],
            f"has UVs that overlap on {share:.3g} of their area in tile {number}, first triangles "
            f"{first} and {second}{shown}; unwrap it without overlaps, or use --unwrap",
        )
