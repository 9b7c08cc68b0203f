"""Make the textures of a garment's threads and fit its lobes near by, where its bake allows it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.materials.bake_folder import BakedLay, MapSet
from fabricusd.materials.near import AUTO, OFF, REPEAT, TEXELS, repeat
from fabricusd.materials.near.inputs import Laid
from fabricusd.materials.near.maps import why_not, write_levels, write_near_maps
from fabricusd.materials.near.parts import Parts
from fabricusd.materials.networks.graph import Texture
from fabricusd.schema.names import prim_name


@dataclass(frozen=True, kw_only=True, eq=False)
class Threads:
    """The threads of a lay: its textures and its parts."""

    laid: Laid
    parts: Parts


@dataclass(kw_only=True, eq=False)
class Files:
    """What is written: the folder, made on demand, the files, and remarks."""

    folder: Callable[[], Path]
    files: list[Path]
    remarks: list[str]


def threads_of(maps: MapSet, near: str, made: Files) -> dict[int, Threads]:
    """Write the textures of a garment's threads; return the threads by lay, as far as there are.

    near : one of `near.NEAR`
    """
    if near == OFF:
        return {}
    reason = why_not(maps)
    if near != REPEAT and reason is None:
        return _of_texels(maps, made)
    if near == TEXELS:
        made.remarks.append(f"lobes of {maps.name} are the cloth from afar: {reason}")
        return {}
    found = {}
    for number, lay in enumerate(maps.lays):
        where = f"lobes of {maps.name} {lay.name}"
        if lay.fabric is None or not repeat.fits(lay.fabric):
            what = "its repeat is too large" if lay.fabric else "the bake folder lacks the fabric"
            made.remarks.append(f"{where} are the cloth from afar: {what}")
            continue
        found[number] = _of_repeat(lay, made)
        if near == AUTO and reason:
            made.remarks.append(f"{where} have even threads, one repeat of them: {reason}")
    return found


def _of_texels(maps: MapSet, made: Files) -> dict[int, Threads]:
    files, parts = write_near_maps(maps, made.folder())
    made.files += [path for tiles in files.values() for path in tiles.values()]
    textures = {}
    for name, tiles in files.items():
        number, path = next(iter(tiles.items()))
        if maps.udim:
            path = path.with_name(path.name.replace(f".{number}.", ".<UDIM>."))
        textures[name] = Texture(path)
    return {
        k: Threads(laid=Laid(textures=textures, density=_density(lay)), parts=one)
        for k, (lay, one) in enumerate(zip(maps.lays, parts, strict=True))
    }


def _density(lay: BakedLay) -> float:
    """Threads along a UV of 1, the geometric mean of both sets."""
    return float(np.sqrt(abs(np.linalg.det(lay.matrix))))


def _of_repeat(lay: BakedLay, made: Files) -> Threads:
    assert lay.fabric is not None
    pixels, parts = repeat.repeat_layers(lay.fabric)
    textures: dict[str, Texture] = {}
    for name, one in pixels.items():
        path = made.folder() / f"{prim_name(lay.name, ascii_only=True)}.{name}.exr"
        if path not in made.files:
            write_levels(path, one)
            made.files.append(path)
        textures[name] = Texture(path)
    threads = np.concatenate((lay.matrix, lay.offset.reshape(2, 1)), axis=1)
    laid = Laid(
        textures=textures, threads=threads, repeat=true_repeat(lay.fabric), density=_density(lay)
    )  # fmt: skip
    return Threads(laid=laid, parts=parts)
