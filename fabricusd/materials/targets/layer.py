"""The look layer: a garment, by reference, with the variant set `fabricLook` over it.

Variants are stronger than references and weaker than sublayers. The garment is therefore
referenced, prim by root prim, and not a sublayer, whose own material bindings would win.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade, Vt

from fabricusd import __version__
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding
from fabricusd.files import whole_file
from fabricusd.materials.bake_folder import BakedLay, MapSet
from fabricusd.materials.networks.graph import Graph, Value
from fabricusd.materials.targets.paths import asset_path
from fabricusd.materials.targets.write_usd import write_material
from fabricusd.materials.wearers import Dressed, NewUV, Wearer
from fabricusd.schema import export, write_binding, write_fabric
from fabricusd.schema.access import remove_binding
from fabricusd.schema.names import prim_name
from fabricusd.schema.source import usd_errors

VARIANT_SET = "fabricLook"
VARIANTS = ("baked", "procedural", "off")
"""Textures; the fabric itself, with constants for tools that do not know it; neither."""

SCOPE = "FabricLooks"


@dataclass(frozen=True, kw_only=True)
class MaterialRecipe:
    """A material to be written: its name, networks by name prefix, and own inputs."""

    name: str
    graphs: tuple[tuple[str, Graph], ...]
    parameters: Mapping[str, Value]


Recipes = Mapping[tuple[str, int, str], MaterialRecipe]
"""By garment, number of the lay and variant, "baked" or "procedural"."""


def write_baked_look(
    path: Path, sets: Sequence[MapSet], recipes: Recipes, custom: Mapping[str, Any], up_axis: str
) -> None:
    """A look over the meshes that the bake wrote, for garments of any file."""
    with _new_layer(path, custom, up_axis, 1.0) as stage:
        root = UsdGeom.Xform.Define(stage, "/Garment").GetPrim()
        stage.SetDefaultPrim(root)
        Usd.ModelAPI(root).SetKind("component")
        wearers = []
        for one in sets:
            mesh = root.GetPath().AppendChild(prim_name(one.name))
            prim = stage.OverridePrim(mesh)
            prim.GetReferences().AddReference(asset_path(one.mesh, path.parent))
            subsets = UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(prim))
            places = [str(s.GetPath()) for s in subsets] or [str(mesh)]
            if one.mesh.is_file() and len(places) != len(one.lays):
                raise FabricError(
                    str(one.mesh),
                    f"has {len(places)} parts; the manifest says {len(one.lays)} lays, bake again",
                )
            wearers += [
                Wearer(path=place, maps=one, lay=k, worn=False) for k, place in enumerate(places)
            ]
        _dress(stage, path, wearers, (), recipes)


def write_scene_look(
    path: Path, scene: Path, dressed: Dressed, recipes: Recipes, custom: Mapping[str, Any]
) -> None:
    """A look over the prims of a scene; the scene's own file is not touched.

    Moved UVs go into `<name>.uv.usdc` beside the layer.
    """
    source = dressed.stage
    if dressed.uv:
        _write_uv(path.with_suffix(".uv.usdc"), dressed.uv)
    axis, metres = UsdGeom.GetStageUpAxis(source), UsdGeom.GetStageMetersPerUnit(source)
    with _new_layer(path, custom, axis, metres) as stage:
        for prim in source.GetPseudoRoot().GetAllChildren():
            over = stage.DefinePrim(prim.GetPath())
            over.GetReferences().AddReference(asset_path(scene, path.parent), prim.GetPath())
            if prim == source.GetDefaultPrim():
                stage.SetDefaultPrim(over)
        for name in ("startTimeCode", "endTimeCode", "timeCodesPerSecond", "framesPerSecond"):
            if source.HasAuthoredMetadata(name):
                stage.SetMetadata(name, source.GetMetadata(name))
        if not stage.HasDefaultPrim():
            first = Sdf.Path(dressed.wearers[0].path).GetPrefixes()[0]
            stage.SetDefaultPrim(stage.GetPrimAtPath(first))
        _dress(stage, path, dressed.wearers, dressed.uv, recipes)


@contextmanager
def _new_layer(
    path: Path, custom: Mapping[str, Any], up_axis: str, metres: float
) -> Iterator[Usd.Stage]:
    """A stage whose layer becomes `path` when the block succeeds.

    The layer is in `path`'s folder from the start, so relative paths resolve while it is made.
    """
    with usd_errors(str(path), "written"), whole_file(path) as temporary:
        layer = Sdf.Layer.CreateNew(str(temporary))
        stage = Usd.Stage.Open(layer)
        UsdGeom.SetStageUpAxis(stage, up_axis)
        UsdGeom.SetStageMetersPerUnit(stage, metres)
        yield stage
        layer.documentation = f"Look of a baked fabric, made by fabricusd {__version__}"
        layer.customLayerData = {"fabricusd": dict(custom)}
        layer.Save()


def _dress(
    stage: Usd.Stage, path: Path, wearers: Sequence[Wearer], uv: Sequence[NewUV], recipes: Recipes
) -> None:
    """Materials and fabrics under each root, and the variants that bind them."""
    roots = {str(Sdf.Path(w.path).GetPrefixes()[0]) for w in wearers}
    for root in sorted(roots):
        prim = stage.GetPrimAtPath(root)
        mine = [w for w in wearers if Sdf.Path(w.path).HasPrefix(root)]
        scope = Sdf.Path(root).AppendChild(SCOPE)
        UsdGeom.Scope.Define(stage, scope)
        _write_looks(stage, scope, mine, recipes, path.parent)
        variants = prim.GetVariantSets().AddVariantSet(VARIANT_SET)
        for name in VARIANTS:
            variants.AddVariant(name)
            variants.SetVariantSelection(name)
            with variants.GetVariantEditContext():
                for wearer in mine:
                    _fill(stage, name, wearer, scope, recipes)
                if name == "baked":
                    _refer_uv(stage, path, [u for u in uv if Sdf.Path(u.path).HasPrefix(root)])
        variants.SetVariantSelection("baked")


def _write_looks(
    stage: Usd.Stage, scope: Sdf.Path, wearers: Sequence[Wearer], recipes: Recipes, folder: Path
) -> None:
    for wearer in wearers:
        for variant in ("baked", "procedural"):
            recipe = recipes[wearer.maps.name, wearer.lay, variant]
            where = scope.AppendChild(recipe.name)
            if not stage.GetPrimAtPath(where):
                write_material(stage, where, list(recipe.graphs), dict(recipe.parameters), folder)
        fabric = wearer.maps.lays[wearer.lay].fabric
        if fabric is not None and not wearer.worn:
            where = scope.AppendChild(prim_name(fabric.name))
            if not stage.GetPrimAtPath(where):
                write_fabric(stage, where, fabric)


def _fill(
    stage: Usd.Stage, variant: str, wearer: Wearer, scope: Sdf.Path, recipes: Recipes
) -> None:
    """One prim in one variant: `off` is the garment as any tool shows it without fabrics."""
    prim = stage.OverridePrim(wearer.path)
    lay = wearer.maps.lays[wearer.lay]
    if variant == "procedural":
        if not wearer.worn and lay.fabric is not None:
            write_binding(prim, scope.AppendChild(prim_name(lay.fabric.name)), binding_of(lay))
    elif wearer.worn:
        remove_binding(prim)
        prim.CreateRelationship("fabric:binding", custom=False).SetTargets([])
    if variant != "off":
        recipe = recipes[wearer.maps.name, wearer.lay, variant]
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(
            UsdShade.Material(stage.GetPrimAtPath(scope.AppendChild(recipe.name))),
            UsdShade.Tokens.strongerThanDescendants
            if wearer.forced
            else UsdShade.Tokens.fallbackStrength,
        )


def binding_of(lay: BakedLay) -> Binding:
    """The binding whose weave coordinates are `lay.matrix @ uv + lay.offset`."""
    assert lay.fabric is not None
    scale = np.linalg.norm(lay.matrix, axis=1)
    return Binding(
        fabric=lay.fabric,
        threads_per_uv=(float(scale[0]), float(scale[1])),
        rotation=math.atan2(lay.matrix[0, 1], lay.matrix[0, 0]),
        offset=(float(lay.offset[0] / scale[0]), float(lay.offset[1] / scale[1])),
    )


def _write_uv(path: Path, uv: Sequence[NewUV]) -> None:
    """A crate with one root prim a mesh, holding primvar `st`."""
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    for number, one in enumerate(uv):
        prim = stage.OverridePrim(_uv_prim(number))
        if number == 0:
            stage.SetDefaultPrim(prim)
        primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, one.interpolation
        )
        primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(one.values)))
        if one.indices is not None:
            primvar.SetIndices(Vt.IntArray.FromNumpy(np.ascontiguousarray(one.indices)))
    export(layer, path)


def _uv_prim(number: int) -> str:
    return f"/UV{number}"


def _refer_uv(stage: Usd.Stage, path: Path, uv: Sequence[NewUV]) -> None:
    for number, one in enumerate(uv):
        prim = stage.OverridePrim(one.path)
        prim.GetReferences().AddReference(f"./{path.stem}.uv.usdc", _uv_prim(number))
