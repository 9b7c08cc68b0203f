"""A mixture near by as inputs of the material, beside those of `lobes.inputs`.

cycles:near:share, :angle floats[8]    `Parts`, the parts of the weft first
cycles:near:spread, :tinted floats[2]  by set
cycles:near:own floats                 width of each lobe at one point of a thread
cycles:near:factors floats             of each lobe, of the diffuse part and of the sheen: three
                                       channels for each of eight parts
cycles:near:through floats[24]         light through, if there is any
cycles:near:lobes_weft asset ...       the textures
cycles:near:threads floats[6]          u and v of the threads by row, and their offset, in
cycles:near:repeat floats[2]           repeats of the textures; absent if they lie on the UVs
cycles:near:density floats[1]          threads along a UV of 1, the geometric mean of both sets
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.materials.lobes.inputs import PREFIX
from fabricusd.materials.near.mixture import NearMixture
from fabricusd.materials.networks.graph import Texture, Value

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Laid:
    """Textures of threads, and how they lie on a garment.

    textures : by the names of `maps.TEXTURES`
    threads : (2, 3) threads by the UVs, with their offset in the last column; None if the textures
        lie on the UVs
    repeat : ends and picks of a texture
    density : threads along a UV of 1, the geometric mean of both sets; 0 if it is not known
    """

    textures: Mapping[str, Texture]
    threads: Floats | None = None
    repeat: tuple[int, int] = (1, 1)
    density: float = 0.0


def near_inputs(near: NearMixture, laid: Laid, cover: float) -> dict[str, Value | Texture]:
    """Return the inputs of a material.

    cover : the share of the cloth that the far mixture is divided by, see `of_covered`
    """
    arrays = {
        "share": near.parts.share, "angle": near.parts.angle, "spread": near.parts.spread,
        "tinted": near.tinted, "own": near.own, "factors": near.factors * cover,
    }  # fmt: skip
    if near.through.any():
        arrays["through"] = near.through
    if laid.threads is not None:
        arrays["threads"] = np.concatenate((laid.threads[:, :2].ravel(), laid.threads[:, 2]))
        arrays["repeat"] = np.array(laid.repeat, np.float64)
    if laid.density > 0.0:
        arrays["density"] = np.array([laid.density])
    found: dict[str, Value | Texture] = {
        name: Value("floats", tuple(float(x) for x in one.ravel())) for name, one in arrays.items()
    }
    found |= laid.textures
    return {f"{PREFIX}near:{name}": one for name, one in found.items()}
