"""Replace the maps that shape reflections where the texels of a bake do not resolve threads.

Between the texel of a warp and that of a weft, every reader interpolates: the mean of the two
directions lies at 45 degrees, along which nothing in the cloth lies, and cloth near one texel per
thread shows chequers. The bake's own mip levels are means of the threads' moments, not of their
directions. There, these maps come from the mip level whose texels span several threads.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.images.files import read_mip_level, shape_of, write_mip_exr
from fabricusd.materials.bake_folder import BakedLay, MapSet
from fabricusd.materials.fit.texels import resolved

Floats = NDArray[np.floating[Any]]

RESOLVED = 4.0
"""Texels per thread from which reflections are those of single threads."""

SPANNED = 4.0
"""Threads that a texel of these maps spans at least, where threads are not resolved."""

LEVELS = 32
"""More mip levels than a texture has."""

CHANNELS = {
    "roughness_along": ("Y",),
    "roughness_across": ("Y",),
    "tangent": ("X", "Y", "Z"),
    "normal": ("X", "Y", "Z"),
}
"""The maps that shape reflections, and their channels."""


def lobe_level(matrix: Floats, width: int) -> int:
    """The mip level whose texels span SPANNED threads; 0 where texels resolve threads.

    matrix : (2, 2) threads per UV; width : texels per side
    """
    threads = float(np.linalg.norm(matrix, axis=1).min()) / width
    if threads * RESOLVED <= 1.0 or threads <= 0.0:
        return 0
    return max(0, math.ceil(math.log2(SPANNED / threads)))


def level_of(maps: MapSet, lay: BakedLay) -> int:
    """The mip level that the look of a lay takes these maps from.

    It is 0 where each thread is fitted by itself, which starts at fewer texels per thread.
    """
    files = maps.textures.get("roughness_along", {})
    if not files or resolved(maps, lay):
        return 0
    return lobe_level(lay.matrix, shape_of(next(iter(files.values())))[1])


def write_spanning_maps(maps: MapSet, level: int, folder: Path) -> tuple[MapSet, list[Path]]:
    """Write the maps of CHANNELS from mip level `level` on to `folder`.

    Returns the new map set, and the files.
    """
    textures = {name: dict(files) for name, files in maps.textures.items()}
    made = []
    for name, channels in CHANNELS.items():
        for tile, source in maps.textures.get(name, {}).items():
            number = f".{tile}" if maps.udim else ""
            target = folder / f"{maps.name}.{name}.mean{2**level}{number}.exr"
            levels = _levels(source, level, len(channels))
            bands = [partial(_whole, one) for one in levels]
            said = {"oiio:ColorSpace": "Raw"}
            write_mip_exr(target, bands, len(levels[0]), channels, np.float16, said)
            textures[name][tile] = target
            made.append(target)
    return replace(maps, textures=textures, spanned=2**level), made


def _levels(source: Path, first: int, channels: int) -> list[NDArray[np.float16]]:
    """The mip levels of a texture from `first` on; its last one if it has fewer."""
    found: list[NDArray[np.float16]] = []
    for level in range(LEVELS):
        try:
            pixels = read_mip_level(source, level)
        except FabricError:
            if level == 0:
                raise
            break
        if level <= first:
            found = []
        found.append(pixels[..., :channels].astype(np.float16))
        if len(pixels) == 1:
            break
    return found


def _whole(level: NDArray[Any]) -> Iterator[NDArray[Any]]:
    yield level
