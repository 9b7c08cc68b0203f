"""Finds the surface of a face: a fabric, a UsdPreviewSurface, or grey."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade

from fabricusd.errors import FabricError
from fabricusd.fabric import Binding
from fabricusd.scene.scene import FabricSurface, PreviewSurface, Scene
from fabricusd.scene.usd.preview_network import PreviewNetwork
from fabricusd.scene.usd.value import value_of
from fabricusd.scene.usd.worn import Bound, bound
from fabricusd.schema import read_binding
from fabricusd.schema.access import applies_binding, targets


@dataclass(frozen=True)
class Resolved:
    """A material of the scene.

    index : in `Scene.materials`
    uv_set : that the material asks for, "" for any
    """

    index: int
    uv_set: str
    is_fabric: bool
    is_textured: bool


class Materials:
    """The scene's materials, each made once.

    binding : the fabric of meshes that have no material of their own, or None
    """

    def __init__(self, scene: Scene, binding: Binding | None, time: Usd.TimeCode) -> None:
        self.scene, self.binding, self.time = scene, binding, time
        self._known: dict[Any, Resolved] = {}
        self._fabrics: dict[Sdf.Path, Resolved | None] = {}

    def of(self, prim: Usd.Prim) -> Resolved | None:
        """The surface of a mesh or subset; None for a subset without one of its own, and for a mesh
        without any.

        The material's own surface shows where its fabric cannot be read.
        """
        found = bound(prim)
        whole = bound(prim.GetParent()) if prim.IsA(UsdGeom.Subset) else None
        if whole is not None and found.place == whole.place:
            # The subset has no binding of its own.
            return None
        self._note_what_is_left_out(prim, found)
        for source in found.fabrics:
            fabric = self._fabric_of(source)
            if fabric is not None:
                return fabric
        if whole is not None and found.owner is not None and found.is_bound_as(whole):
            # Its fabric cannot be read: the mesh's is nearer to it than the mesh's material.
            return None
        if found.material is None:
            # A subset that takes the mesh's fabric off.
            return None if whole is None or found.owner is not None else self.fallback(prim)
        path = found.material.GetPath()
        if path not in self._known:
            surface, uv_set = PreviewNetwork(found.material, self.time, self.scene).read()
            self._known[path] = self._add(surface, uv_set)
        return self._known[path]

    def look(self, prim: Usd.Prim) -> tuple[Any, ...]:
        """What decides the surfaces of a mesh, equal for instances that look alike."""
        own = self.of(prim)
        shown: Any = own.index if own is not None else None
        if own is None and self.binding is None:
            shown = self._display(prim, "displayColor", 3), self._display(prim, "displayOpacity", 1)
        return shown, self._of_subsets(prim)

    def worn(self, prim: Usd.Prim) -> list[int]:
        """Indices of the surfaces that a mesh and its subsets may wear."""
        own = self.of(prim) or (None if self.binding is None else self.fallback(prim))
        found = [None if own is None else own.index, *self._of_subsets(prim)]
        return [number for number in found if number is not None]

    def _of_subsets(self, prim: Usd.Prim) -> tuple[int | None, ...]:
        subsets = UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(prim))
        own = [self.of(subset.GetPrim()) for subset in subsets]
        return tuple(None if one is None else one.index for one in own)

    def _note_what_is_left_out(self, prim: Usd.Prim, found: Bound) -> None:
        """One line for each binding of `prim`, or of one above it, that binds nothing."""
        for owner in (prim, *_ancestors(prim)):
            where = str(owner.GetPath())
            if targets(owner, "fabric:binding") and not applies_binding(owner):
                self.scene.note(
                    where, "has fabric:binding but not WovenBindingAPI applied, left out"
                )
            path = UsdShade.MaterialBindingAPI(owner).GetDirectBinding().GetMaterialPath()
            if found.material is None and path and not path.isEmpty:
                self.scene.note(where, f"is bound to {path}, which is not a material; left out")

    def _fabric_of(self, source: Usd.Prim) -> Resolved | None:
        """The fabric that `source` names, None with a note where it cannot be read."""
        # Instances share what their prototype holds.
        own = source.GetPrimInPrototype() if source.IsInstanceProxy() else source
        key = own.GetPath()
        if key not in self._fabrics:
            where = str(source.GetPath())
            try:
                binding = read_binding(source, lambda line: self.scene.note(where, line))
                self._fabrics[key] = self._fabric(binding)
            except FabricError as error:
                words = str(error)
                line = words if words.startswith(where) else f"{where} {words}"
                self.scene.note(line, "- rendered without a fabric")
                self._fabrics[key] = None
        return self._fabrics[key]

    def fallback(self, prim: Usd.Prim) -> Resolved:
        """The surface of an unbound mesh: the given fabric, its display colour, or grey."""
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
        """The mean of a display primvar of `count` channels; None where no value can be used."""
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
        """The surface of faces that wear a fabric but have no UVs."""
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
    """The prims above a prim, the nearest first, without the pseudo-root."""
    found = []
    parent = prim.GetParent()
    while parent and not parent.IsPseudoRoot():
        found.append(parent)
        parent = parent.GetParent()
    return found
