"""What glTF's metallic-roughness material and its extensions read, from the maps of a bake.

glTF counts the rougher direction: along it the alpha is `mix(roughness^2, 1, strength^2)`, across
it `roughness^2`. The bake's `tangent` is the smoother one, so the direction is a quarter turn on.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.materials.fit.spanning import level_pixels
from fabricusd.materials.networks.graph import Texture, Value
from fabricusd.materials.networks.look import Look
from fabricusd.materials.networks.surfaces import Inputs

Floats = NDArray[np.floating[Any]]

MASK_ERROR = 0.02
"""Largest error of the mean cover for which gaps are cut out by MASK, which needs no sorting."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Layers:
    """(h, w, c) arrays from 0 to 1, linear, row 0 at the top; 1 x 1 where a constant will do.

    base, tint : colours; cover : (h, w, 1)
    roughness : (h, w, 1) - its square is the alpha of the smoother direction
    direction : (h, w, 2) - unit vectors along which the cloth is rougher, from -1 to 1
    strength : (h, w, 1) - of the anisotropy
    normal : (h, w, 3) - (n + 1)/2
    through : (h, w, 3) or None - diffuse transmittance
    """

    base: Floats
    cover: Floats
    roughness: Floats
    direction: Floats
    strength: Floats
    normal: Floats
    tint: Floats
    through: Floats | None


def layers_of(
    inputs: Inputs, look: Look, tile: int, *, normals: Path | None = None, level: int = 0
) -> Layers:
    """Read the maps of one UDIM tile, and apply the factors of the look.

    normals : the baked normals (not coded), which have the levels that the coded ones lack
    level : mip level of the roughness, the direction and the normals, see `fit.spanning`
    """

    def read(name: str, level: int = 0) -> Floats:
        source = inputs[name]
        if isinstance(source, Value):
            return np.atleast_1d(np.asarray(source.value, np.float32))[None, None]
        assert isinstance(source, Texture)
        return level_pixels(of_tile(source, tile), level)

    smooth, rough = alphas(
        read("roughness_along", level)[..., :1], read("roughness_across", level)[..., :1], look
    )
    through = None
    if look.transmission_scale is not None:
        through = _scaled(read("transmission_color"), look.transmission_scale)
        through = through if through.max() > 0.0 else None
    coded = isinstance(inputs["normal"], Texture) and normals is not None and level > 0
    return Layers(
        base=_scaled(read("base_color"), look.base_color_scale),
        cover=np.clip(read("opacity")[..., :1], 0.0, 1.0),
        roughness=np.sqrt(smooth),
        direction=rougher(read("tangent", level)),
        strength=strength(smooth, rough),
        normal=_coded(level_pixels(normals, level))
        if coded and normals
        else read("normal")[..., :3],
        tint=read("specular_tint")[..., :3],
        through=through,
    )


def of_tile(source: Texture, tile: int) -> Path:
    """The file of a texture's UDIM tile."""
    return source.path.with_name(source.path.name.replace("<UDIM>", str(tile)))


def _scaled(color: Floats, factors: tuple[float, float, float]) -> Floats:
    # Textures may have 16 million texels: keep them in single precision.
    return np.asarray(np.clip(color[..., :3] * np.array(factors, np.float32), 0.0, 1.0))


def _coded(normals: Floats) -> Floats:
    """Unit normals as (n + 1)/2; texels without one are flat."""
    length = np.linalg.norm(normals[..., :3], axis=-1, keepdims=True)
    unit = np.where(length > 1e-6, normals[..., :3] / np.maximum(length, 1e-6), (0.0, 0.0, 1.0))
    return np.asarray(0.5 * unit + 0.5)


def alphas(along: Floats, across: Floats, look: Look) -> tuple[Floats, Floats]:
    """(smoother, rougher) microfacet alphas, from the maps of the roots and a look's factors."""
    smooth = np.minimum((along * look.smooth_scale) ** 2, 1.0)
    rough = np.minimum((across * look.rough_scale) ** 2, 1.0)
    return smooth, np.maximum(rough, smooth)


def strength(smooth: Floats, rough: Floats) -> Floats:
    """The anisotropy's strength s, for which `mix(smooth, 1, s^2) = rough`."""
    square = (rough - smooth) / np.maximum(1.0 - smooth, 1e-6)
    return np.asarray(np.sqrt(np.clip(square, 0.0, 1.0)))


def rougher(tangent: Floats) -> Floats:
    """(h, w, 2) unit vectors a quarter turn from the map `tangent`; (1, 0) where there is none."""
    turned = np.stack((-tangent[..., 1], tangent[..., 0]), axis=-1)
    length = np.linalg.norm(turned, axis=-1, keepdims=True)
    return np.where(
        length > 1e-6, turned / np.maximum(length, 1e-6), np.array((1, 0), turned.dtype)
    )


def alpha_mode(cover: Floats, *, opaque: bool) -> str:
    """How gaps are shown: "OPAQUE", "MASK" or "BLEND".

    MASK cuts out what is less than half covered, needs no sorting, and casts right shadows. It is
    chosen where texels resolve the gaps, so that cutting changes the mean cover by MASK_ERROR at
    most. Where a texel is the mean of threads and gaps, MASK would close the cloth: BLEND.
    """
    if opaque:
        return "OPAQUE"
    cut = cover >= 0.5
    return "MASK" if abs(float(np.mean(cut - cover))) <= MASK_ERROR else "BLEND"


def beside_through(base: Floats, through: Floats) -> tuple[Floats, Floats, Floats]:
    """(base, weight, colour) for `mix(base, colour, weight)` of a diffuse sheet.

    The largest channel of the transmittance is the weight, so that of the colour is 1. The base is
    brighter by what the mix takes from it.
    """
    weight = through.max(axis=-1, keepdims=True)
    color = through / np.maximum(weight, 1e-6)
    return np.clip(base / np.maximum(1.0 - weight, 1e-6), 0.0, 1.0), weight, color
