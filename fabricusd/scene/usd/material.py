"""Which surface a face has: a fabric by WovenBindingAPI, a UsdPreviewSurface, or a grey."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from fabricusd.errors import FabricError
from fabricusd.fabric import Binding
from fabricusd.scene.scene import FabricSurface, PreviewSurface, Scene
from fabricusd.scene.usd.preview_network import PreviewNetwork
from fabricusd.scene.usd.value import value_of
from fabricusd.schema import read_binding
from fabricusd.schema.access import applies_binding, targets

_PURPOSES = (UsdShade.Tokens.full, UsdShade.Tokens.preview)
"""Material purposes in the order in which they are looked for; each falls back on bindings without
a purpose."""


@dataclass(frozen=True)
class Resolved:
    """A material's number in the scene, the UV set that it asks for ("" for any), and what for."""

    index: int
    uv_set: str
    is_fabric: bool
    is_textured: bool


class Materials:
    """The scene's materials, each made once.

    binding : the fabric for what has no material of its own, or None
    """

    def __init__(self, scene: Scene, binding: Binding | None, time: Usd.TimeCode) -> None:
        self.scene, self.binding, self.time = scene, binding, time
        self._known: dict[Any, Resolved] = {}

    def of(self, prim: Usd.Prim) -> Resolved | None:
        """The surface of a mesh or subset, None where it says nothing about it."""
        fabric = self._bound_fabric(prim)
        if fabric is not None:
            return fabric
        material, relationship = self._bound_material(prim)
        if not material:
            return None
        if prim.IsA(UsdGeom.Subset) and relationship == self._bound_material(prim.GetParent())[1]:
            # The mesh's own, which goes behind a fabric that the mesh wears.
            return None
        path = material.GetPath()
        if path not in self._known:
            surface, uv_set = PreviewNetwork(material, self.time, self.scene).read()
            self._known[path] = self._add(surface, uv_set)
        return self._known[path]

    def _bound_fabric(self, prim: Usd.Prim) -> Resolved | None:
        where = str(prim.GetPath())
        if not applies_binding(prim):
            if targets(prim, "fabric:binding"):
                self.scene.note(
                    where, "has fabric:binding but not WovenBindingAPI applied, left out"
                )
            return None
        try:
            return self._fabric(read_binding(prim, lambda line: self.scene.note(where, line)))
        except (FabricError, IndexError) as error:
            words = str(error) if isinstance(error, FabricError) else "names no fabric"
            line = words if words.startswith(where) else f"{where} {words}"
            self.scene.note(line, "- rendered without a fabric")
            return None

    def _bound_material(self, prim: Usd.Prim) -> tuple[UsdShade.Material, Usd.Relationship]:
        """The material that USD binds to `prim`, and by which relationship; none is noted where
        one is named that is not there."""
        api = UsdShade.MaterialBindingAPI(prim)
        for purpose in _PURPOSES:
            material, relationship = api.ComputeBoundMaterial(purpose)
            if material:
                return material, relationship
        for owner in (prim, *_ancestors(prim)):
            path = UsdShade.MaterialBindingAPI(owner).GetDirectBinding().GetMaterialPath()
            if path and not path.isEmpty:
                self.scene.note(
                    str(owner.GetPath()), f"is bound to {path}, which is no material, left out"
                )
        return material, relationship

    def fallback(self, prim: Usd.Prim) -> Resolved:
        """The surface of a mesh that has none: the given fabric, its display colour, or grey."""
        if self.binding is not None:
            return self._fabric(self.binding)
        color = self._display(prim, "displayColor", 3)
        opacity = self._display(prim, "displayOpacity", 1)
        key = color, opacity
        if key not in self._known:
            surface = PreviewSurface(
                name="displayColor" if color else "grey",
                diffuse=color or (0.18, 0.18, 0.18),  # type: ignore[arg-type]
                roughness=0.6,
                opacity=min(max(opacity[0], 0.0), 1.0) if opacity else 1.0,
            )
            self._known[key] = self._add(surface, "")
        return self._known[key]

    def _display(self, prim: Usd.Prim, name: str, count: int) -> tuple[float, ...] | None:
        """The mean of a display primvar of `count` channels; None where it has no usable value."""
        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
        given = None
        if primvar and primvar.HasValue():
            given = value_of(primvar.GetAttr(), self.time, self.scene)
        if given is None or not hasattr(given, "__len__") or not len(given):
            return None
        where = str(prim.GetPath())
        try:
            values = np.array(given, np.float64).reshape(-1, count)
        except (TypeError, ValueError):
            self.scene.note(where, f"has {name} of the type {primvar.GetTypeName()}, left out")
            return None
        sound = values[np.isfinite(values).all(axis=1)]
        if len(sound) < len(values):
            self.scene.note(where, f"has {name} that is not finite, left out")
        if not len(sound):
            return None
        if np.ptp(sound, axis=0).any():
            self.scene.note(where, f"has {name} that varies; its mean is rendered")
        return tuple(float(x) for x in np.maximum(sound.mean(axis=0), 0.0))

    def without_uv(self) -> Resolved:
        """The surface where a fabric cannot lie, since there are no UVs."""
        if "no uv" not in self._known:
            self._known["no uv"] = self._add(PreviewSurface(name="no UVs", roughness=0.6), "")
        return self._known["no uv"]

    def _add(self, surface: Any, uv_set: str) -> Resolved:
        self.scene.materials.append(surface)
        is_fabric = isinstance(surface, FabricSurface)
        is_textured = not is_fabric and bool(surface.textures)
        return Resolved(len(self.scene.materials) - 1, uv_set, is_fabric, is_textured)

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


def _ancestors(prim: Usd.Prim) -> list[Usd.Prim]:
    """Parents of a prim, the nearest first, without the pseudo-root."""
    found = []
    parent = prim.GetParent()
    while parent and not parent.IsPseudoRoot():
        found.append(parent)
        parent = parent.GetParent()
    return found
