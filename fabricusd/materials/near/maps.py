"""Write the textures that say which threads a texel shows, from the maps of a bake.

    lobes_weft, lobes_warp            R G B A: share of the texel that each part of the set covers
    lobes_lean                        R G: lean and spread of the weft; B A: those of the warp
    lobes_weft_tint, lobes_warp_tint  R G B: tint of the set; only where its threads differ

The fields are those of `parts.Texels`, which filter linearly. Coarser levels are means of finer
ones. Texels outside the UV layout hold the mean of their nearest lay, so that the far mixture and
not a gap comes in at seams.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from fabricusd.appearance.weave.quadrature import curve_nodes
from fabricusd.bake.texels.angle_rows import FINE
from fabricusd.bake.texels.moment_indices import PARTS
from fabricusd.fabric import Fabric
from fabricusd.images.files import read_mip_level, shape_of, write_mip_exr
from fabricusd.materials.bake_folder import MapSet
from fabricusd.materials.near.parts import COUNT, LEAST, SETS, Parts, Texels

Floats = NDArray[np.float64]
Pixels = NDArray[np.float32]

NOUNS = ("weft", "warp")

NEEDED = tuple(f"{noun}_{kind}" for noun in NOUNS for kind in ("share", "angle", "spread"))
"""Maps of the bake that the textures are made from; `weft_thread` and `warp_thread` give tints."""

WIDEST = 0.25
"""Threads that a texel may span for its threads to be seen."""

SHARES, LEAN, TINTS = (
    ("lobes_weft", "lobes_warp"), "lobes_lean", ("lobes_weft_tint", "lobes_warp_tint"),
)  # fmt: skip
TEXTURES = (*SHARES, LEAN, *TINTS)


def why_not(maps: MapSet) -> str | None:
    """Return why a bake has no threads for lobes near by; None if it has."""
    lost = [name for name in NEEDED if name not in maps.textures]
    if lost:
        return f"the bake lacks {', '.join(lost)}"
    if any(lay.fabric is None for lay in maps.lays):
        return "a fabric is not in the bake folder"
    width = span(maps)
    if width > WIDEST:
        return f"a texel of the bake spans {width:.1f} threads"
    return None


def span(maps: MapSet) -> float:
    """Threads that a texel of a bake spans, at most."""
    size = shape_of(next(iter(next(iter(maps.textures.values())).values())))[1]
    return max(float(np.abs(lay.matrix).sum(axis=1).max()) / size for lay in maps.lays)


def tinted_sets(fabric: Fabric, *, even: bool = False) -> bool:
    """Whether the colour of threads differs within a set; `even` : with even yarn."""
    nodes = curve_nodes(fabric, FINE)
    kinds = np.split(nodes.thread, [nodes.warp_start])
    return (fabric.is_uneven and not even) or any(len(np.unique(one)) > 1 for one in kinds)


def write_near_maps(maps: MapSet, folder: Path) -> tuple[dict[str, dict[int, Path]], list[Parts]]:
    """Write the textures of a garment; return them by name and tile, and the parts of each lay.

    The parts are those of the texels themselves, so that the coarsest level is their `texel`.
    """
    tiles = list(maps.textures[NEEDED[0]])
    read = {tile: _read(maps, tile) for tile in tiles}
    lays = {tile: _lays(maps, tile) for tile in tiles}
    parts, colors = [], []
    for number in range(len(maps.lays)):
        mine = [(read[tile], lays[tile] == number) for tile in tiles]
        one, color = _parts(mine)
        parts.append(one)
        colors.append(color)
    tinted = any(tinted_sets(lay.fabric) for lay in maps.lays if lay.fabric) and all(
        f"{noun}_thread" in maps.textures for noun in NOUNS
    )
    found: dict[str, dict[int, Path]] = {}
    for tile in tiles:
        layers = _layers(read.pop(tile), lays[tile], parts, colors)
        for name, pixels in layers.items():
            if name in TINTS and not tinted:
                continue
            end = f".{tile}" if maps.udim else ""
            target = folder / f"{maps.name}.{name}{end}.exr"
            write_levels(target, pixels)
            found.setdefault(name, {})[tile] = target
    return found, parts


def texels_of(layers: Mapping[str, Pixels]) -> Texels:
    """Return the texels that textures (h, w, c) hold, row by row."""
    share = np.concatenate([layers[name].reshape(-1, PARTS) for name in SHARES], axis=1)
    lean = layers[LEAN].reshape(-1, 2, 2).astype(np.float64)
    sets = share.reshape(-1, 2, PARTS).sum(axis=2, dtype=np.float64)
    tint = np.repeat(sets[:, :, None], 3, axis=2)
    if TINTS[0] in layers:
        tint = np.stack([layers[name].reshape(-1, 3) for name in TINTS], axis=1)
    return Texels(
        share=share.astype(np.float64), lean=lean[:, :, 0], spread=lean[:, :, 1],
        tint=tint.astype(np.float64),
    )  # fmt: skip


def write_levels(target: Path, pixels: Pixels) -> None:
    """Write a texture (h, w, c) with all its levels."""
    levels = []
    size, channels = len(pixels), tuple("RGBA")[: pixels.shape[2]]
    while True:
        levels.append(np.ascontiguousarray(pixels, np.float16))
        if len(pixels) == 1:
            break
        pixels = halved(pixels)
    write_mip_exr(
        target, [partial(_whole, one) for one in levels], size, channels, np.float16,
        {"oiio:ColorSpace": "Raw"},
    )  # fmt: skip


def halved(pixels: Pixels) -> Pixels:
    """(h/2, w/2, c) means of 2 x 2 pixels."""
    h, w, c = pixels.shape
    return np.asarray(pixels.reshape(h // 2, 2, w // 2, 2, c).mean(axis=(1, 3)), np.float32)


def _whole(level: NDArray[Any]) -> Iterator[NDArray[Any]]:
    yield level


def _read(maps: MapSet, tile: int) -> dict[str, Pixels]:
    names = (*NEEDED, *(f"{noun}_thread" for noun in NOUNS))
    return {
        name: read_mip_level(maps.textures[name][tile]) for name in names if name in maps.textures
    }


def _lays(maps: MapSet, tile: int) -> NDArray[np.int64]:
    """(h, w) number of each texel's lay, -1 outside the layout."""
    if "lay" in maps.textures:
        found = read_mip_level(maps.textures["lay"][tile])[..., 0]
        return np.where(found < len(maps.lays), found, -1).astype(np.int64)
    covered = [read_mip_level(maps.textures[f"{n}_share"][tile]).sum(axis=2) for n in NOUNS]
    return np.where(sum(covered) > 0, 0, -1).astype(np.int64)


def _parts(tiles: list[tuple[dict[str, Pixels], NDArray[np.bool_]]]) -> tuple[Parts, Floats]:
    """The parts of a lay, and (2, 3) mean colour of each set."""
    count = max(sum(int(mine.sum()) for _, mine in tiles), 1)
    share, first, color = np.zeros(COUNT), np.zeros(COUNT), np.zeros((2, 3))
    for read, mine in tiles:
        for which, noun in enumerate(NOUNS):
            at = slice(PARTS * which, PARTS * (which + 1))
            w = read[f"{noun}_share"][mine].astype(np.float64)
            share[at] += w.sum(axis=0)
            first[at] += (w * read[f"{noun}_angle"][mine]).sum(axis=0)
            if f"{noun}_thread" in read:
                tint = read[f"{noun}_thread"][mine][:, :3]
                color[which] += (w.sum(axis=1)[:, None] * tint).sum(axis=0)
    angle = first / np.maximum(share, 1e-12)
    spread = np.zeros(2)
    for read, mine in tiles:
        for which, noun in enumerate(NOUNS):
            _, square = _off(read, noun, mine, angle[PARTS * which : PARTS * (which + 1)])
            spread[which] += square.sum(dtype=np.float64)
    sets = share.reshape(2, PARTS).sum(axis=1)[:, None]
    share = np.where(share / count > LEAST, share / count, 0.0)
    return Parts(share=share, angle=angle, spread=spread / count), color / np.maximum(sets, 1e-12)


def _off(
    read: dict[str, Pixels], noun: str, mine: NDArray[np.bool_], angle: Floats
) -> tuple[Pixels, Pixels]:
    """(n,) lean and spread of the texels `mine`, for the mean angles (PARTS,) of the parts."""
    w = read[f"{noun}_share"][mine]
    off = read[f"{noun}_angle"][mine] - angle.astype(np.float32)
    return (w * off).sum(axis=1), (w * (read[f"{noun}_spread"][mine] ** 2 + off**2)).sum(axis=1)


def _layers(
    read: dict[str, Pixels], lays: NDArray[np.int64], parts: list[Parts], colors: list[Floats]
) -> dict[str, Pixels]:
    """The textures of a tile, name by name."""
    shape = lays.shape
    found = {
        name: np.zeros((*shape, 4 if name not in TINTS else 3), np.float32) for name in TEXTURES
    }
    nearest = _nearest(lays)
    for number, (one, color) in enumerate(zip(parts, colors, strict=True)):
        mine, around = lays == number, (lays < 0) & (nearest == number)
        mean = texel_pixels(one.texel)
        for name in TEXTURES:
            found[name][around] = mean[name][0]
        for which, noun in enumerate(NOUNS):
            w = read[f"{noun}_share"][mine]
            found[SHARES[which]][mine] = w
            lean, spread = _off(read, noun, mine, one.angle[PARTS * which : PARTS * (which + 1)])
            found[LEAN][mine, 2 * which], found[LEAN][mine, 2 * which + 1] = lean, spread
            tint = np.ones((1, 3))
            if f"{noun}_thread" in read:
                known = np.where(color[which] > 1e-6, color[which], 1.0)
                tint = read[f"{noun}_thread"][mine][:, :3] / known
                tint = np.where(color[which] > 1e-6, tint, 1.0)
            found[TINTS[which]][mine] = w.sum(axis=1)[:, None] * tint
    return found


def texel_pixels(texels: Texels) -> dict[str, Pixels]:
    """(n, c) pixels of each texture."""
    both = np.stack((texels.lean, texels.spread), axis=2).reshape(-1, 4)
    found: dict[str, Any] = {LEAN: both}
    for which in (0, 1):
        found[SHARES[which]] = texels.share[:, SETS == which]
        found[TINTS[which]] = texels.tint[:, which]
    return {name: np.asarray(one, np.float32) for name, one in found.items()}


def _nearest(lays: NDArray[np.int64]) -> NDArray[np.int64]:
    """(h, w) number of the lay nearest to each texel."""
    known = np.unique(lays[lays >= 0])
    if len(known) < 2:
        return np.full_like(lays, known[0] if len(known) else 0)
    rows, columns = distance_transform_edt(lays < 0, return_distances=False, return_indices=True)
    return np.asarray(lays[rows, columns])
