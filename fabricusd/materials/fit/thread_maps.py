"""Write textures that include each thread's own fit: colour, roughness and tint of the reflection.

At the finest level a texel takes the factors of its thread in the map `thread_id`. Coarser levels
of a colour are means of the finer level. Coarser levels of a roughness are the baked level times
the mean factor, which preserves the effect of slopes on the baked roughness.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.lookup import NO_THREAD
from fabricusd.images.files import read_mip_level, write_mip_exr
from fabricusd.materials.bake_folder import MapSet

Floats = NDArray[np.float64]
Factors = Mapping[int, Floats]
"""(8,) factors by thread number, including NO_THREAD, as returned by `fit.thread_factors`."""

COLUMNS = {
    "base_color": slice(0, 3),
    "roughness_along": slice(3, 4),
    "roughness_across": slice(4, 5),
    "specular_tint": slice(5, 8),
}
"""The factors that each map takes."""


def write_thread_maps(maps: MapSet, factors: Mapping[int, Factors], folder: Path) -> MapSet:
    """Write the textures of COLUMNS with the factors applied to `folder`; return the new map set.

    factors : by lay number; lays that are not listed stay unchanged
    """
    textures = {name: dict(files) for name, files in maps.textures.items()}
    textures["specular_tint"] = {}
    for tile in maps.textures["thread_id"]:
        rows, table = _rows(maps, tile, factors)
        for name, columns in COLUMNS.items():
            number = f".{tile}" if maps.udim else ""
            target = folder / f"{maps.name}.{name}{number}.exr"
            _write(target, maps.textures.get(name, {}).get(tile), rows, table[:, columns])
            textures[name][tile] = target
    return replace(maps, textures=textures)


def _rows(
    maps: MapSet, tile: int, factors: Mapping[int, Factors]
) -> tuple[NDArray[np.uint16], NDArray[np.float32]]:
    """(h, w) index of each texel's row in a table of factors, and the (m, 8) table."""
    ids = read_mip_level(maps.textures["thread_id"][tile])[..., 0]
    lays = read_mip_level(maps.textures["lay"][tile])[..., 0] if "lay" in maps.textures else 0 * ids
    rows, table = np.zeros(ids.shape, np.uint16), [np.ones(8)]
    for lay, of_lay in factors.items():
        rows[lays == lay] = len(table)
        table.append(of_lay[NO_THREAD])
        for number, row in of_lay.items():
            if number != NO_THREAD:
                rows[(lays == lay) & (ids == number)] = len(table)
                table.append(row)
    return rows, np.array(table, np.float32)


def _write(
    target: Path, source: Path | None, rows: NDArray[np.uint16], factors: NDArray[np.float32]
) -> None:
    """Write one texture with all its mip levels.

    source : the baked texture; None for a map that the bake lacks, taken as 1 everywhere
    """
    color = factors.shape[1] == 3
    factor = factors[rows]
    levels: list[NDArray[np.float16]] = []
    size = len(rows)
    fine: NDArray[np.float32] = np.ones((1, 1, 1), np.float32)
    while True:
        if levels:
            fine, factor = _halved(fine), _halved(factor)
        if not levels or not color:
            baked = read_mip_level(source, len(levels)) if source else np.ones(1, np.float32)
            fine = np.minimum(baked * factor, 1.0)
        levels.append(fine.astype(np.float16))
        if len(fine) == 1:
            break
    channels = ("R", "G", "B") if color else ("Y",)
    said = {"oiio:ColorSpace": "lin_rec709" if color else "Raw"}
    write_mip_exr(
        target, [partial(_whole, one) for one in levels], size, channels, np.float16, said
    )


def _whole(level: NDArray[Any]) -> Iterator[NDArray[Any]]:
    yield level


def _halved(pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    """(h/2, w/2, c) means of 2 x 2 pixels."""
    h, w, c = pixels.shape
    return np.asarray(pixels.reshape(h // 2, 2, w // 2, 2, c).mean(axis=(1, 3)), np.float32)
