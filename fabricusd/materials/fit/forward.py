"""Evaluate a surface model with a look over a bake's texels: what a renderer shows of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fabricusd.materials.fit.models import Surface, evaluate, transmitted
from fabricusd.materials.fit.target import TexelSample
from fabricusd.materials.networks.look import Look

Floats = NDArray[np.float64]


def forward(kind: str, look: Look, texels: TexelSample, wi: Floats, wo: Floats) -> Floats:
    """(k, n, 3) radiance of each texel, for wi, wo (k, n, 3) in the texel's frame."""
    value = evaluate(kind, surface_of(kind, look, texels), wi, wo)
    return np.asarray(value * texels.opacity[:, None, None])


def forward_through(kind: str, look: Look, texels: TexelSample, wi: Floats, wo: Floats) -> Floats:
    """`forward` for lights from behind, with the map `transmission_color` as it is."""
    through = np.broadcast_to(texels.through, (len(texels.base), 3))[:, None]
    value = transmitted(kind, surface_of(kind, look, texels), through, wi, wo)
    return np.asarray(value * texels.opacity[:, None, None])


def surface_of(kind: str, look: Look, texels: TexelSample) -> Surface:
    """The parameters of each texel's surface, (k, 1, ...)."""
    one = np.ones((len(texels.base), 1))
    smooth = np.minimum((texels.smooth * look.smooth_scale) ** 2, 1.0)[:, None]
    rough = np.minimum((texels.rough * look.rough_scale) ** 2, 1.0)[:, None]
    if kind == "preview":
        rough = smooth
    return Surface(
        base=np.minimum(texels.base * np.array(look.base_color_scale), 1.0)[:, None],
        ior=look.specular_ior * one,
        alpha_rough=np.maximum(rough, smooth),
        alpha_smooth=smooth,
        tint=(np.ones((len(one), 3)) * texels.tint * np.array(look.specular_tint))[:, None],
        fuzz_weight=look.fuzz_weight * one,
        fuzz_color=np.array(look.fuzz_color)[None, None],
        fuzz_roughness=look.fuzz_roughness * one,
    )


def frames_of(texels: TexelSample) -> Floats:
    """(k, 3, 3) frame of each texel: rows x (the rougher axis), y, z (the normal)."""
    z = texels.normal
    x = texels.tangent - np.sum(texels.tangent * z, axis=1, keepdims=True) * z
    x = x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-9)
    return np.stack((x, np.cross(z, x), z), axis=1)
