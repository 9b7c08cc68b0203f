"""Write the look's layer: it references a garment and adds the variant set `fabricLook`.

Variants are stronger than references but weaker than sublayers. The layer therefore references each
root prim of the garment instead of sublayering its file, whose own material bindings would win.
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
from fabricusd.materials.bound_prims import BoundPrim, BoundScene, NewUV
from fabricusd.materials.networks.graph import Graph, Value
from fabricusd.materials.targets.paths import asset_path
from fabricusd.materials.targets.write_usd import write_material
from fabricusd.schema import export, write_binding, write_fabric
from fabricusd.schema.access import remove_binding
from fabricusd.schema.names import prim_name
from fabricusd.schema.source import usd_errors

VARIANT_SET = "fabricLook"
VARIANTS = ("baked", "procedural", "off")
"""Textures; the fabric itself, with constants for tools that cannot render it; neither."""

SCOPE = "FabricLooks"


@dataclass(frozen=True, kw_only=True)
class MaterialRecipe:
    """A material to write: its name, its networks with their name prefixes, and its inputs."""

    name: str
    graphs: tuple[tuple[str, Graph], ...]
    parameters: Mapping[str, Value]


Recipes = Mapping[tuple[str, int, str], MaterialRecipe]
"""Materials by garment, lay number and variant, "baked" or "procedural"."""


def write_baked_look(
    path: Path, sets: Sequence[MapSet], recipes: Recipes, custom: Mapping[str, Any], up_axis: str
) -> None:
    """Write a look for the meshes that the bake wrote, whatever the scene's file format was."""
    with _new_layer(path, custom, up_axis, 1.0) as stage:
        root = UsdGeom.Xform.Define(stage, "/Garment").GetPrim()
        stage.SetDefaultPrim(root)
        Usd.ModelAPI(root).SetKind("component")
        bound = []
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
            bound += [
                BoundPrim(path=place, maps=one, lay=k, binds_fabric=False)
                for k, place in enumerate(places)
            ]
        _bind_materials(stage, path, bound, (), recipes)


def write_scene_look(
    path: Path, scene: Path, bound: BoundScene, recipes: Recipes, custom: Mapping[str, Any]
) -> None:
    """Write a look for the prims of a scene; the scene's file is not modified.

    Moved UVs are written to `<name>.uv.usdc` beside the layer.
    """
    source = bound.stage
    if bound.uv:
        _write_uv(path.with_suffix(".uv.usdc"), bound.uv)
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
            first = Sdf.Path(bound.prims[0].path).GetPrefixes()[0]
            stage.SetDefaultPrim(stage.GetPrimAtPath(first))
        _bind_materials(stage, path, bound.prims, bound.uv, recipes)


@contextmanager
def _new_layer(
    path: Path, custom: Mapping[str, Any], up_axis: str, metres: float
) -> Iterator[Usd.Stage]:
    """Open a stage whose layer becomes `path` when the block succeeds.

    The layer is in the folder of `path` from the start, so that relative paths resolve meanwhile.
    """
    with usd_errors(str(path), "written"), whole_file(path) as temporary:
        layer = Sdf.Layer.CreateNew(str(temporary))
        stage = Usd.Stage.Open(layer)
        UsdGeom.SetStageUpAxis(stage, up_axis)
        UsdGeom.SetStageMetersPerUnit(stage, metres)
        yield stage
        layer.documentation = f"Look of a baked fabric, written by fabricusd {__version__}"
        layer.customLayerData = {"fabricusd": dict(custom)}
        layer.Save()


def _bind_materials(
    stage: Usd.Stage, path: Path, bound: Sequence[BoundPrim], uv: Sequence[NewUV], recipes: Recipes
) -> None:
    """Write materials and fabrics under each root prim, and the variants that bind them."""
    roots = {str(Sdf.Path(w.path).GetPrefixes()[0]) for w in bound}
    for root in sorted(roots):
        prim = stage.GetPrimAtPath(root)
        mine = [w for w in bound if Sdf.Path(w.path).HasPrefix(root)]
        scope = Sdf.Path(root).AppendChild(SCOPE)
        UsdGeom.Scope.Define(stage, scope)
        _write_looks(stage, scope, mine, recipes, path.parent)
        variants = prim.GetVariantSets().AddVariantSet(VARIANT_SET)
        for name in VARIANTS:
            variants.AddVariant(name)
            variants.SetVariantSelection(name)
            with variants.GetVariantEditContext():
                for one in mine:
                    _fill(stage, name, one, scope, recipes)
                if name == "baked":
                    _refer_uv(stage, path, [u for u in uv if Sdf.Path(u.path).HasPrefix(root)])
        variants.SetVariantSelection("baked")


def _write_looks(
    stage: Usd.Stage, scope: Sdf.Path, bound: Sequence[BoundPrim], recipes: Recipes, folder: Path
) -> None:
    for one in bound:
        for variant in ("baked", "procedural"):
            recipe = recipes[one.maps.name, one.lay, variant]
            where = scope.AppendChild(recipe.name)
            if not stage.GetPrimAtPath(where):
                write_material(stage, where, list(recipe.graphs), dict(recipe.parameters), folder)
        fabric = one.maps.lays[one.lay].fabric
        if fabric is not None and not one.binds_fabric:
            where = scope.AppendChild(prim_name(fabric.name))
            if not stage.GetPrimAtPath(where):
                write_fabric(stage, where, fabric)


def _fill(
    stage: Usd.Stage, variant: str, one: BoundPrim, scope: Sdf.Path, recipes: Recipes
) -> None:
    """Write one prim in one variant; `off` is the garment as tools show it without fabrics."""
    prim = stage.OverridePrim(one.path)
    lay = one.maps.lays[one.lay]
    if variant == "procedural":
        if not one.binds_fabric and lay.fabric is not None:
            write_binding(prim, scope.AppendChild(prim_name(lay.fabric.name)), binding_of(lay))
    elif one.binds_fabric:
        remove_binding(prim)
        prim.CreateRelationship("fabric:binding", custom=False).SetTargets([])
    if variant != "off":
        recipe = recipes[one.maps.name, one.lay, variant]
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(
            UsdShade.Material(stage.GetPrimAtPath(scope.AppendChild(recipe.name))),
            UsdShade.Tokens.strongerThanDescendants
            if one.forced
            else UsdShade.Tokens.fallbackStrength,
        )


def binding_of(lay: BakedLay) -> Binding:
    """Return the binding whose weave coordinates are `lay.matrix @ uv + lay.offset`."""
    assert lay.fabric is not None
    scale = np.linalg.norm(lay.matrix, axis=1)
    return Binding(
        fabric=lay.fabric,
        threads_per_uv=(float(scale[0]), float(scale[1])),
        rotation=math.atan2(lay.matrix[0, 1], lay.matrix[0, 0]),
        offset=(float(lay.offset[0] / scale[0]), float(lay.offset[1] / scale[1])),
    )


def _write_uv(path: Path, uv: Sequence[NewUV]) -> None:
    """Write a crate file with one root prim per mesh, which holds the primvar `st`."""
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
