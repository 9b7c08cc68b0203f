"""Replace the maps that shape reflections where the texels of a bake do not resolve threads.

Between the texel of a warp and that of a weft, every reader interpolates: the mean of the two
directions lies at 45 degrees, along which nothing in the cloth lies, and cloth near one texel per
thread shows chequers. The bake's own mip levels are means of the threads' moments, not of their
directions. There, these maps are the mean of the mip level whose texels span several threads: one
texel, since in a level of them the smoother direction jumps with the unevenness of balanced cloth.
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

FLAT = {"tangent": (1.0, 0.0, 0.0), "normal": (0.0, 0.0, 1.0)}
"""What stands for a lay without texels."""

CHANNELS = {
    "roughness_along": ("Y",),
    "roughness_across": ("Y",),
    "tangent": ("X", "Y", "Z"),
    "normal": ("X", "Y", "Z"),
}
"""The maps that shape reflections, and their channels."""


def lobe_level(matrix: Floats, width: int) -> int:
    """The mip level whose texels span SPANNED threads; 0 where texels resolve threads, and where
    they span as many by themselves.

    matrix : (2, 2) threads per UV; width : texels per side
    """
    threads = threads_per_texel(matrix, width)
    if threads * RESOLVED <= 1.0:
        return 0
    return max(0, math.ceil(math.log2(SPANNED / threads)))


def threads_per_texel(matrix: Floats, width: int) -> float:
    """Threads that a texel spans, of the set of which it spans fewer; arguments of lobe_level."""
    return float(np.linalg.norm(matrix, axis=1).min()) / width


def takes_the_mean(maps: MapSet, lay: BakedLay) -> bool:
    """Whether the look of a lay takes these maps from the mean of the cloth.

    It takes the bake's own maps where texels resolve threads, where one of the maps is missing, and
    where each thread is fitted by itself, which starts at fewer texels per thread.
    """
    if any(not maps.textures.get(name) for name in CHANNELS) or resolved(maps, lay):
        return False
    return threads_per_texel(lay.matrix, _width(maps)) * RESOLVED > 1.0


def write_spanning_maps(maps: MapSet, number: int, folder: Path) -> tuple[MapSet, list[Path]]:
    """Write the maps of CHANNELS as the mean of the lay `number` to `folder`, of one texel each.

    A cloth lies in one direction of its UVs, so from afar these maps are constant. The mean is that
    of covariances of slopes: of `alpha^2` along and across the tangent, taken as a tensor.

    Returns the new map set, and the files.
    """
    found = _mean(maps, number)
    textures = {name: dict(files) for name, files in maps.textures.items()}
    made = []
    tag = f"lay{number}"
    for name, channels in CHANNELS.items():
        pixel = np.array(found[name], np.float16).reshape(1, 1, len(channels))
        for tile in maps.textures.get(name, {}):
            udim = f".{tile}" if maps.udim else ""
            target = folder / f"{maps.name}.{name}.{tag}{udim}.exr"
            said = {"oiio:ColorSpace": "Raw"}
            write_mip_exr(target, [partial(_whole, pixel)], 1, channels, np.float16, said)
            textures[name][tile] = target
            made.append(target)
    return replace(maps, textures=textures, spanned=tag), made


def _mean(maps: MapSet, number: int) -> dict[str, tuple[float, ...]]:
    """The mean of each map of CHANNELS over the texels of a lay, on all tiles."""
    level = lobe_level(maps.lays[number].matrix, _width(maps))
    tensor, normal = np.zeros((2, 2)), np.zeros(3)
    for tile in maps.textures["roughness_along"]:
        read = {name: level_pixels(maps.textures[name][tile], level) for name in CHANNELS}
        mine = np.linalg.norm(read["normal"][..., :3], axis=-1) > 0.5
        if "lay" in maps.textures:
            lays = read_mip_level(maps.textures["lay"][tile])[..., 0]
            middle = lays.shape[0] // mine.shape[0] // 2
            step = lays.shape[0] // mine.shape[0]
            mine &= lays[middle::step, middle::step] == number
        along = read["tangent"][mine][:, :2]
        along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
        across = np.stack((-along[:, 1], along[:, 0]), axis=1)
        for axis, name in ((along, "roughness_along"), (across, "roughness_across")):
            weight = read[name][mine][:, 0].astype(np.float64) ** 4
            tensor += np.einsum("n,na,nb->ab", weight, axis, axis)
        normal += read["normal"][mine][:, :3].sum(axis=0, dtype=np.float64)
    length = float(np.linalg.norm(normal))
    if length == 0.0:
        return {name: (0.5,) if len(c) == 1 else FLAT[name] for name, c in CHANNELS.items()}
    # The normals' sum tells the number of texels but for their tilt, which is small at this level.
    values, axes = np.linalg.eigh(tensor / length)
    smooth, rough = np.maximum(values, 0.0) ** 0.25
    return {
        "roughness_along": (float(smooth),), "roughness_across": (float(rough),),
        "tangent": (float(axes[0, 0]), float(axes[1, 0]), 0.0),
        "normal": tuple(float(x) for x in normal / length),
    }  # fmt: skip


def _width(maps: MapSet) -> int:
    return shape_of(next(iter(maps.textures["roughness_along"].values())))[1]


def level_pixels(file: Path, level: int) -> Floats:
    """(h, w, c) of a mip level, or of the coarsest above it that the file has."""
    for one in range(level, 0, -1):
        try:
            return read_mip_level(file, one)
        except FabricError:
            continue
    return read_mip_level(file)


def _whole(level: NDArray[Any]) -> Iterator[NDArray[Any]]:
    yield level
