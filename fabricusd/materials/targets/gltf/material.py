"""glTF materials: cloth, with the extensions for its lobes, and plain surfaces."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.materials.networks.look import Look
from fabricusd.materials.targets.gltf.document import Document
from fabricusd.materials.targets.gltf.layers import Layers, beside_through
from fabricusd.scene.scene import PreviewSurface
from fabricusd.srgb import srgb_encode

Floats = NDArray[np.floating[Any]]

LEAST_STRENGTH = 0.02
"""Strength of anisotropy below which the extension is left out."""


def cloth(
    document: Document, name: str, layers: Layers, look: Look, mode: str, *, through: bool = False
) -> int:
    """Add the material of a fabric; return its number.

    mode : "OPAQUE", "MASK" or "BLEND"
    through : add the light that comes through the cloth, for readers that know the extension
    """
    base, extensions = layers.base, {}
    if through and layers.through is not None:
        base, weight, color = beside_through(layers.base, layers.through)
        key = document.used("KHR_materials_diffuse_transmission")
        extensions[key] = _diffuse_transmission(document, name, weight, color)
    _add_anisotropy(document, name, layers, extensions)
    extensions[document.used("KHR_materials_ior")] = {"ior": look.specular_ior}
    _add_specular(document, name, layers, look, extensions)
    sheen = np.clip(np.array(look.fuzz_color) * look.fuzz_weight, 0.0, 1.0)
    if sheen.max() > 0.0:
        extensions[document.used("KHR_materials_sheen")] = {
            "sheenColorFactor": sheen.tolist(),
            "sheenRoughnessFactor": min(max(look.fuzz_roughness, 0.0), 1.0),
        }
    fields: dict[str, Any] = {"alphaMode": mode}
    if mode == "MASK":
        fields["alphaCutoff"] = 0.5
    if layers.normal.shape[:2] != (1, 1) or abs(layers.normal[0, 0, 2] - 1.0) > 1e-4:
        codes = _codes(layers.normal)
        fields["normalTexture"] = document.texture(codes, f"{name}_normal", color=False)
    return document.material(
        name=name, doubleSided=True, extensions=extensions,
        pbrMetallicRoughness=_metallic_roughness(document, name, layers, base, mode), **fields,
    )  # fmt: skip


def plain(document: Document, name: str, surface: PreviewSurface) -> int:
    """Add what the garment wears without its fabric, as constants; return its number."""

    def mean(field: str, otherwise: Any) -> Any:
        texture = surface.textures.get(field)
        if texture is None:
            return otherwise
        found = texture.pixels.mean(axis=(0, 1), dtype=np.float64)
        return found if len(found) == 3 else float(found[0])

    color = np.broadcast_to(np.clip(mean("diffuse", np.array(surface.diffuse)), 0.0, 1.0), 3)
    opacity = min(max(float(np.mean(mean("opacity", surface.opacity))), 0.0), 1.0)
    roughness = float(np.clip(np.mean(mean("roughness", surface.roughness)), 0.0, 1.0))
    metallic = float(np.clip(np.mean(mean("metallic", surface.metallic)), 0.0, 1.0))
    extensions = {}
    if surface.ior != 1.5:
        extensions[document.used("KHR_materials_ior")] = {"ior": max(surface.ior, 1.0)}
    return document.material(
        name=name, doubleSided=True, extensions=extensions,
        alphaMode="OPAQUE" if opacity >= 1.0 else "BLEND",
        pbrMetallicRoughness={
            "baseColorFactor": [*color.tolist(), opacity],
            "metallicFactor": metallic, "roughnessFactor": roughness,
        },
    )  # fmt: skip


def _metallic_roughness(
    document: Document, name: str, layers: Layers, base: Floats, mode: str
) -> dict[str, Any]:
    cover = layers.cover if mode != "OPAQUE" else np.ones((1, 1, 1))
    found: dict[str, Any] = {"metallicFactor": 0.0}
    if _is_constant(base, cover):
        found["baseColorFactor"] = [*base[0, 0].tolist(), float(cover[0, 0, 0])]
    else:
        encoded = np.asarray(srgb_encode(base))
        pixels = encoded if mode == "OPAQUE" else _stacked(encoded, cover)
        found["baseColorTexture"] = document.texture(_codes(pixels), f"{name}_color", color=True)
    if _is_constant(layers.roughness):
        found["roughnessFactor"] = float(layers.roughness[0, 0, 0])
    else:
        # Red is free for occlusion, of which there is none; blue is metalness.
        rough = layers.roughness
        pixels = _stacked(np.ones_like(rough), rough, np.zeros_like(rough))
        texture = document.texture(_codes(pixels), f"{name}_roughness", color=False)
        found["metallicRoughnessTexture"] = texture
    return found


def _add_anisotropy(
    document: Document, name: str, layers: Layers, extensions: dict[str, Any]
) -> None:
    if layers.strength.max() < LEAST_STRENGTH:
        return
    told: dict[str, Any] = {}
    if _is_constant(layers.strength, layers.direction):
        x, y = layers.direction[0, 0]
        told = {"anisotropyStrength": float(layers.strength[0, 0, 0])}
        told["anisotropyRotation"] = math.atan2(y, x)
    else:
        pixels = _stacked(0.5 * layers.direction + 0.5, layers.strength)
        told = {"anisotropyStrength": 1.0}
        told["anisotropyTexture"] = document.texture(
            _codes(pixels), f"{name}_anisotropy", color=False
        )
    extensions[document.used("KHR_materials_anisotropy")] = told


def _add_specular(
    document: Document, name: str, layers: Layers, look: Look, extensions: dict[str, Any]
) -> None:
    factor, tint = np.array(look.specular_tint), layers.tint
    textured = not _is_constant(tint)
    # A texture holds at most 1; the factor may be greater.
    scale = max(float(tint.max()), 1.0) if textured else 1.0
    factor = factor * (scale if textured else tint[0, 0])
    if not textured and np.allclose(factor, 1.0, atol=1e-6):
        return
    told: dict[str, Any] = {"specularColorFactor": factor.tolist()}
    if textured:
        codes = _codes(np.asarray(srgb_encode(np.clip(tint / scale, 0.0, 1.0))))
        told["specularColorTexture"] = document.texture(codes, f"{name}_tint", color=True)
    extensions[document.used("KHR_materials_specular")] = told


def _diffuse_transmission(
    document: Document, name: str, weight: Floats, color: Floats
) -> dict[str, Any]:
    if _is_constant(weight, color):
        return {
            "diffuseTransmissionFactor": float(weight[0, 0, 0]),
            "diffuseTransmissionColorFactor": color[0, 0].tolist(),
        }
    # One picture for both: the colour, and in its fourth channel the weight.
    pixels = _stacked(np.asarray(srgb_encode(color)), weight)
    texture = document.texture(_codes(pixels), f"{name}_through", color=True)
    return {
        "diffuseTransmissionFactor": 1.0, "diffuseTransmissionTexture": texture,
        "diffuseTransmissionColorTexture": dict(texture),
    }  # fmt: skip


def _is_constant(*arrays: Floats) -> bool:
    return all(one.shape[:2] == (1, 1) for one in arrays)


def _stacked(*arrays: Floats) -> Floats:
    """The channels of all arrays, each as large as the largest."""
    size = max(one.shape[:2] for one in arrays)
    return np.concatenate([np.broadcast_to(a, (*size, a.shape[2])) for a in arrays], axis=2)


def _codes(pixels: Floats) -> NDArray[np.uint8]:
    return np.asarray(np.rint(np.clip(pixels, 0.0, 1.0) * 255.0).astype(np.uint8))
