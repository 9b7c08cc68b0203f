"""Read the looks of a stage: what a material of fabricusd says beside UsdPreviewSurface.

This module knows USD and not Blender.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from . import threads
from .threads import Threads

SURFACE = "ND_open_pbr_surface_surfaceshader"

Color = tuple[float, float, float]

FITTED = (
    "base_color_scale", "specular_ior", "specular_tint", "smooth_scale", "rough_scale",
    "fuzz_weight", "fuzz_color", "fuzz_roughness",
)  # fmt: skip
"""Parameters that every OpenPBR network of ours has."""


class LookError(ValueError):
    """A look that lacks something; the message says where and what, in one line."""


MAPS = (
    "base_color", "roughness_along", "roughness_across", "opacity", "normal", "tangent",
    "specular_tint_map", "transmission_color",
)  # fmt: skip
"""Names of the shaders that read the textures."""

CONSTANTS = {
    "base_color": ("base_scaled", "in1"),
    "roughness_along": ("smooth_root", "in1"),
    "roughness_across": ("rough_root", "in1"),
    "tangent": ("tangent_x", "in"),
    "specular_tint_map": ("tint_scaled", "in1"),
    "transmission_color": ("through_scaled", "in1"),
}
"""The inputs of shaders, in OpenPBR networks, that hold the constant of a map without texture."""


@dataclass(frozen=True, kw_only=True)
class Lobe:
    """A lobe about a tilted normal, or a pair of opposite tilt; see docs/lobes.md.

    along : "weft" or "warp"
    gaussian : whether its distribution is Beckmann's; else it is that of GGX
    """

    along: str
    tilt: float
    paired: bool
    alpha_along: float
    alpha_across: float
    color: Color
    facing: float
    crossing: float
    upright: float
    gaussian: bool


@dataclass(frozen=True, kw_only=True)
class Mixture:
    """A sum of lobes, a diffuse part and sheen, as fitted to Cycles.

    view : coefficients of V, seven for each polynomial
    """

    diffuse: Color
    diffuse_power: float
    sheen: Color
    sheen_roughness: float
    sheen_power: float
    view: tuple[float, ...]
    lobes: tuple[Lobe, ...]


@dataclass(frozen=True, kw_only=True)
class Look:
    """A material of fabricusd.

    path, name : of the prim
    fabric : its name, "" if the look does not say it
    values : the parameters fitted to the Principled BSDF, by name; empty without an OpenPBR network
    maps : files of textures by the names in MAPS, with `<UDIM>` for tiles; those in a package
        are `FILE.usdz[FILE]`
    constants : what replaces a map that has no texture
    transparent : whether the cloth has gaps
    mixture : the lobes, if the look has them; weft, warp : directions of threads in texture space
    threads : the single threads that the lobes show near by, if the look has them
    """

    path: str
    name: str
    fabric: str
    values: dict[str, Any]
    maps: dict[str, str]
    constants: dict[str, Any]
    transparent: bool
    mixture: Mixture | None
    weft: tuple[float, float] = (1.0, 0.0)
    warp: tuple[float, float] = (0.0, 1.0)
    threads: Threads | None = None

    @property
    def is_known(self) -> bool:
        """Whether the look has a surface that this add-on can build."""
        return bool(self.mixture or self.values)

    @property
    def lit_through(self) -> bool:
        """Whether light that the threads scatter comes through the cloth."""
        return "transmission_scale" in self.values


def read(stage: Any) -> list[Look]:
    """Return the looks of a stage; raises LookError if one of them is incomplete."""
    found = (_Material(prim) for prim in _materials(stage))
    return [one.look() for one in found if one.is_fabric]


def _materials(stage: Any) -> Iterator[Any]:
    """Materials, those in prototypes of instances included."""
    for root in (stage.GetPseudoRoot(), *stage.GetPrototypes()):
        waiting = [root]
        while waiting:
            prim = waiting.pop(0)
            waiting = [*prim.GetChildren(), *waiting]
            if prim.GetTypeName() == "Material":
                yield prim


class _Material:
    """A material prim and its shaders by name."""

    def __init__(self, prim: Any) -> None:
        from pxr import UsdShade

        self.material = UsdShade.Material(prim)
        self.shaders = {
            p.GetName(): UsdShade.Shader(p) for p in prim.GetChildren() if p.IsA(UsdShade.Shader)
        }
        surface = self.shaders.get("surface")
        self.is_openpbr = bool(surface and surface.GetIdAttr().Get() == SURFACE)

    @property
    def is_fabric(self) -> bool:
        """Whether `fabricusd material` wrote the material."""
        return bool(self._input("rough_scale") or self._input("cycles:diffuse"))

    def look(self) -> Look:
        """Return what the material says."""
        prim = self.material.GetPrim()
        surface = self.shaders.get("surface")
        opacity = "geometry_opacity" if self.is_openpbr else "opacity"
        transparent = bool(surface and surface.GetInput(opacity))
        constants = {name: self._fixed(*where) for name, where in CONSTANTS.items()}
        constants["opacity"] = self._fixed("surface", opacity) if transparent else None
        mixture = self._mixture()
        return Look(
            path=str(prim.GetPath()), name=prim.GetName(),
            fabric=str(self._value("cycles:fabric") or ""),
            values=self._fitted() if self.is_openpbr else {},
            maps={name: file for name in MAPS if (file := self._file(name)) is not None},
            constants={name: value for name, value in constants.items() if value is not None},
            transparent=transparent, mixture=mixture, threads=self._threads(mixture),
            weft=_pair(self._value("cycles:weft"), (1.0, 0.0)),
            warp=_pair(self._value("cycles:warp"), (0.0, 1.0)),
        )  # fmt: skip

    def _input(self, name: str) -> Any:
        return self.material.GetInput(name)

    def _value(self, name: str) -> Any:
        given = self._input(name)
        return given.Get() if given else None

    def _fitted(self) -> dict[str, Any]:
        """Each parameter as fitted to the Principled BSDF, or else to OpenPBR."""
        found = {}
        for given in self.material.GetInputs():
            name = given.GetBaseName()
            if ":" not in name:
                own = self._input(f"principled:{name}")
                found[name] = _plain((own or given).Get())
        for name in FITTED:
            self._require(found.get(name), name)
        return found

    def _require(self, value: Any, name: str) -> Any:
        if value is None:
            where = f"{self.material.GetPath()}.inputs:{name}"
            raise LookError(f"lacks {where}; write the look again with 'fabricusd material'")
        return value

    def _file(self, name: str) -> str | None:
        """Return a map's texture; None if a constant replaces it."""
        shader = self.shaders.get(name)
        if shader is None:
            return None
        return self._resolved(shader.GetInput("file"))

    def _resolved(self, given: Any) -> str | None:
        """Return the file that an input names; None if there is no such input or value."""
        asset = given.Get() if given else None
        if asset is None:
            return None
        if "<UDIM>" in asset.path:
            from pxr import UsdShade

            layer = given.GetAttr().GetPropertyStack()[0].layer
            return str(UsdShade.UdimUtils.ResolveUdimPath(asset.path, layer) or asset.path)
        return str(asset.resolvedPath or asset.path)

    def _fixed(self, shader: str, name: str) -> Any:
        """Return the constant on a shader's input; None if the input is connected or absent."""
        found = self.shaders.get(shader)
        given = found.GetInput(name) if found else None
        return _plain(given.Get()) if given and not given.HasConnectedSource() else None

    def _threads(self, mixture: Mixture | None) -> Threads | None:
        if mixture is None:
            return None
        count = sum(2 if one.paired else 1 for one in mixture.lobes)
        return threads.read(
            lambda name: _plain(self._value(f"cycles:near:{name}") or ()),
            lambda name: self._resolved(self._input(f"cycles:near:{name}")),
            count,
        )

    def _mixture(self) -> Mixture | None:
        if not self._input("cycles:diffuse"):
            return None

        def value(name: str) -> Any:
            return _plain(self._require(self._value(f"cycles:{name}"), f"cycles:{name}"))

        lobes: list[Lobe] = []
        while self._input(f"cycles:lobe{len(lobes)}:tilt"):
            at = f"lobe{len(lobes)}:"
            # Looks from before there was a choice have GGX.
            gaussian = bool(self._value(f"cycles:{at}gaussian"))
            names = (name for name in Lobe.__dataclass_fields__ if name != "gaussian")
            lobes.append(Lobe(**{name: value(at + name) for name in names}, gaussian=gaussian))
        others = ("diffuse", "diffuse_power", "sheen", "sheen_roughness", "sheen_power")
        return Mixture(
            lobes=tuple(lobes), view=_plain(self._value("cycles:view") or ()),
            **{name: value(name) for name in others},
        )  # fmt: skip


def _plain(value: Any) -> Any:
    """Return USD's vectors and arrays as tuples."""
    if isinstance(value, str) or not hasattr(value, "__len__"):
        return value
    return tuple(float(x) for x in value)


def _pair(value: Any, instead: tuple[float, float]) -> tuple[float, float]:
    return instead if value is None else (float(value[0]), float(value[1]))
