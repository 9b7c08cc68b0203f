"""Which surface a face has: a fabric by FabricBindingAPI, a UsdPreviewSurface, or a grey."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from fabricusd.errors import FabricError
from fabricusd.fabric import Binding
from fabricusd.images import read_image
from fabricusd.reference.scene import FabricSurface, PreviewSurface, Scene, Texture
from fabricusd.schema import read_binding

_LARGEST = 4096
"""Pixels a side that a texture is shrunk to."""

_NUMBERS = {
    "metallic": "metallic",
    "roughness": "roughness",
    "ior": "ior",
    "opacity": "opacity",
    "opacityThreshold": "opacity_threshold",
}
_COLORS = {"diffuseColor": "diffuse", "emissiveColor": "emissive"}
_TEXTURED = {
    "diffuseColor": "diffuse",
    "emissiveColor": "emissive",
    "metallic": "metallic",
    "roughness": "roughness",
    "opacity": "opacity",
}


@dataclass(frozen=True)
class Resolved:
    """A material's number in the scene, and the UV set that it asks for ("" for any)."""

    index: int
    uv_set: str
    is_fabric: bool


class Materials:
    """The scene's materials, each made once.

    binding : the fabric for what has no material of its own, or None
    """

    def __init__(self, scene: Scene, binding: Binding | None, time: Usd.TimeCode) -> None:
        self.scene, self.binding, self.time = scene, binding, time
        self._known: dict[Any, Resolved] = {}

    def of(self, prim: Usd.Prim) -> Resolved | None:
        """The surface of a mesh or subset, None where it says nothing about it."""
        where = str(prim.GetPath())
        if "FabricBindingAPI" in prim.GetAppliedSchemas():
            try:
                binding = read_binding(prim)
            except (FabricError, IndexError) as error:
                words = str(error) if isinstance(error, FabricError) else "names no fabric"
                line = words if words.startswith(where) else f"{where} {words}"
                self.scene.note(line, "- rendered without a fabric")
            else:
                return self._fabric(binding)
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        if not material:
            return None
        path = material.GetPath()
        if path not in self._known:
            surface, uv_set = self._preview(material)
            self._known[path] = self._add(surface, uv_set)
        return self._known[path]

    def fallback(self, prim: Usd.Prim) -> Resolved:
        """The surface of a mesh that has none: the given fabric, its display colour, or grey."""
        if self.binding is not None:
            return self._fabric(self.binding)
        color = None
        primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("displayColor")
        if primvar and primvar.HasValue():
            values = primvar.Get(self.time)
            if values is not None and len(values):
                color = tuple(float(c) for c in np.mean(np.array(values), axis=0))
        if color not in self._known:
            surface = PreviewSurface(
                name="displayColor" if color else "grey",
                diffuse=color or (0.18, 0.18, 0.18),  # type: ignore[arg-type]
                roughness=0.6,
            )
            self._known[color] = self._add(surface, "")
        return self._known[color]

    def without_uv(self) -> Resolved:
        """The surface where a fabric cannot lie, since there are no UVs."""
        if "no uv" not in self._known:
            self._known["no uv"] = self._add(PreviewSurface(name="no UVs", roughness=0.6), "")
        return self._known["no uv"]

    def _add(self, surface: Any, uv_set: str) -> Resolved:
        self.scene.materials.append(surface)
        return Resolved(len(self.scene.materials) - 1, uv_set, isinstance(surface, FabricSurface))

    def _fabric(self, binding: Binding) -> Resolved:
        for key, known in self._known.items():
            if isinstance(key, tuple) and key[0] == "fabric":
                other = self.scene.materials[known.index]
                if isinstance(other, FabricSurface) and other.binding == binding:
                    return known
        surface = FabricSurface(name=binding.fabric.name, binding=binding)
        known = self._add(surface, binding.uv_set)
        self._known["fabric", known.index] = known
        return known

    def _preview(self, material: UsdShade.Material) -> tuple[PreviewSurface, str]:
        """The material's UsdPreviewSurface and the UV set that its textures read."""
        where = str(material.GetPath())
        shader, _, _ = material.ComputeSurfaceSource()
        if not shader or shader.GetIdAttr().Get() != "UsdPreviewSurface":
            self.scene.note(where, "has no UsdPreviewSurface; it is rendered grey")
            return PreviewSurface(name=where), ""
        values: dict[str, Any] = {}
        textures: dict[str, Texture] = {}
        uv_set = ""
        for name, field in {**_NUMBERS, **_COLORS}.items():
            source = self._source(shader, name)
            if source is None:
                continue
            if not isinstance(source, UsdShade.Shader):
                values[field] = (
                    tuple(float(c) for c in source) if name in _COLORS else float(source)
                )
            elif name in _TEXTURED:
                texture, asked = self._texture(shader.GetInput(name), source, where)
                uv_set = asked or uv_set
                if texture is not None:
                    textures[_TEXTURED[name]] = texture
        if self._source(shader, "useSpecularWorkflow") == 1:
            self.scene.note(where, "asks for the specular workflow; the metallic one is rendered")
        return PreviewSurface(name=where, textures=textures, **values), uv_set

    def _source(self, shader: UsdShade.Shader, name: str) -> Any:
        """An input's value, or the shader that it is connected to; None where neither is."""
        given = shader.GetInput(name)
        if not given:
            return None
        for attribute in UsdShade.Utils.GetValueProducingAttributes(given):
            producer = UsdShade.Shader(attribute.GetPrim())
            if UsdShade.Output.IsOutput(attribute) and producer:
                return producer
            return attribute.Get(self.time)
        return None

    def _texture(
        self, given: UsdShade.Input, shader: UsdShade.Shader, where: str
    ) -> tuple[Texture | None, str]:
        """The picture behind a UsdUVTexture, one channel or three, and its UV set."""
        if shader.GetIdAttr().Get() != "UsdUVTexture":
            self.scene.note(where, f"reads {given.GetBaseName()} from an unknown kind of node")
            return None, ""
        file = self._source(shader, "file")
        fallback = self._source(shader, "fallback")
        color = given.GetBaseName() in _COLORS
        try:
            if file is None or not file.path:
                raise FabricError(where, "names no file")
            space = str(self._source(shader, "sourceColorSpace") or "auto")
            pixels = read_image(
                file.resolvedPath or file.path, color_space=space if color else "raw",
                most=_LARGEST,
            )  # fmt: skip
        except FabricError as error:
            self.scene.note(where, f"is rendered without a texture: {error}")
            if fallback is None:
                return None, ""
            pixels = np.array(fallback, np.float32)[:3].reshape(1, 1, 3)
        scale, bias = self._source(shader, "scale"), self._source(shader, "bias")
        if scale is not None:
            pixels = pixels * np.array(scale, np.float32)[: pixels.shape[2]]
        if bias is not None:
            pixels = pixels + np.array(bias, np.float32)[: pixels.shape[2]]
        if not color:
            output = given.GetConnectedSources()[0][0].sourceName
            channel = {"g": 1, "b": 2}.get(str(output), 0)
            pixels = pixels[..., min(channel, pixels.shape[2] - 1)][..., None]
        pixels = np.nan_to_num(pixels, nan=0.0, posinf=0.0, neginf=0.0)
        wraps = [str(self._source(shader, n) or "repeat") for n in ("wrapS", "wrapT")]
        known = [w if w in ("repeat", "clamp", "mirror", "black") else "repeat" for w in wraps]
        reader = self._source(shader, "st")
        name = ""
        if isinstance(reader, UsdShade.Shader):
            if reader.GetIdAttr().Get() == "UsdTransform2d":
                self.scene.note(where, "moves a texture by UsdTransform2d, which is left out")
                reader = self._source(reader, "in")
            if isinstance(reader, UsdShade.Shader):
                name = str(self._source(reader, "varname") or "")
        return Texture(pixels=pixels.astype(np.float32), wrap=(known[0], known[1])), name
