"""Textures with each thread's own fit in them: colour, roughness and the tint of the reflection.

At the finest level a texel takes the factors of the thread in map `thread_id`; a coarser level has
the mean of the finer level's colours, and for roughness the baked level times the mean factor, so
that what the bake knows about slopes stays.
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
"""By number of a thread, and of none: (8,) as `fit.thread_factors` gives them."""

COLUMNS = {
    "base_color": slice(0, 3),
    "roughness_along": slice(3, 4),
    "roughness_across": slice(4, 5),
    "specular_tint": slice(5, 8),
}
"""Which of the factors a map takes."""


def write_thread_maps(maps: MapSet, factors: Mapping[int, Factors], folder: Path) -> MapSet:
    """`maps` with the textures of COLUMNS written anew into `folder`.

    factors : by number of the lay; lays that are not there stay as they are
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
    """(h, w) which row of the (m, 8) table each texel takes."""
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
    """One texture with all its levels; source : None for a map that the bake has not, all 1."""
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
    """(h/2, w/2, c) means of four."""
    h, w, c = pixels.shape
    return np.asarray(pixels.reshape(h // 2, 2, w // 2, 2, c).mean(axis=(1, 3)), np.float32)
