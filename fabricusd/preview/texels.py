"""Texels of a bake, drawn for a fit."""

from __future__ import annotations

import numpy as np

from fabricusd.preview.bake_folder import BakedLay, MapSet
from fabricusd.preview.fit import TexelSample
from fabricusd.reference.images import read_mip_level

COUNT = 24
"""Texels drawn of each lay: enough for the threads of a repeat at several tangent angles."""

NEEDED = ("base_color", "roughness_along", "roughness_across", "normal", "tangent", "opacity")


def draw_texels(maps: MapSet, number: int, lay: BakedLay) -> TexelSample | None:
    """COUNT texels of the lay `number`, None where the bake lacks a map that the fit needs."""
    if any(name not in maps.textures for name in NEEDED):
        return None
    tile = next(iter(maps.textures["base_color"]))
    read = {name: read_mip_level(maps.textures[name][tile]) for name in NEEDED}
    if "lay" in maps.textures:
        mine = read_mip_level(maps.textures["lay"][tile])[..., 0] == number
    else:
        mine = np.linalg.norm(read["normal"], axis=-1) > 0.5
    places = np.flatnonzero(mine.ravel())
    if not len(places):
        return None
    chosen = places[np.random.default_rng(1).integers(0, len(places), COUNT)]
    value = {
        name: pixels.reshape(-1, pixels.shape[-1])[chosen].astype(np.float64)
        for name, pixels in read.items()
    }
    # The weave's frame: U and V of the weave as rows, so that fits do not depend on the grain.
    turn = np.eye(3)
    u = lay.matrix[0] / np.linalg.norm(lay.matrix[0])
    turn[:2, :2] = [u, [-u[1], u[0]]]
    normal = value["normal"] @ turn.T
    smooth = value["tangent"] @ turn.T
    rough = np.stack((-smooth[:, 1], smooth[:, 0], smooth[:, 2]), axis=1)
    rows = np.concatenate(
        (
            value["base_color"], value["roughness_along"], value["roughness_across"],
            value["opacity"], normal, rough,
        ),
        axis=1,
    )  # fmt: skip
    # Where a texel spans whole repeats all texels are alike, and one stands for them.
    _, first, counts = np.unique(np.round(rows, 2), axis=0, return_index=True, return_counts=True)
    rows = rows[first]
    return TexelSample(
        base=rows[:, :3],
        smooth=rows[:, 3],
        rough=rows[:, 4],
        opacity=rows[:, 5],
        normal=rows[:, 6:9] / np.maximum(np.linalg.norm(rows[:, 6:9], axis=1, keepdims=True), 1e-9),
        tangent=rows[:, 9:],
        weight=counts / counts.sum(),
    )


def mean_texel(maps: MapSet, number: int) -> dict[str, tuple[float, ...]]:
    """The mean of each map that there is over the texels of a lay; directions normalised."""
    from fabricusd.preview.surfaces import MAPS

    tile = next(iter(next(iter(maps.textures.values()))), 0) if maps.textures else 0
    mine = None
    if "lay" in maps.textures:
        mine = read_mip_level(maps.textures["lay"][tile])[..., 0] == number
    found = {}
    for name, kind in MAPS.items():
        if tile not in maps.textures.get(name, {}):
            continue
        pixels = read_mip_level(maps.textures[name][tile])
        if mine is not None and mine.any():
            pixels = pixels[mine][None]
        mean = pixels.mean(axis=(0, 1), dtype=np.float64)
        if kind == "vector3":
            mean /= max(float(np.linalg.norm(mean)), 1e-9)
        found[name] = tuple(map(float, mean))
    return found
