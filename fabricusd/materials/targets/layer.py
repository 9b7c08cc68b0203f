"""Write the look's layer: it references a garment and adds the variant set `fabricLook`.

Variants are stronger than references but weaker than sublayers. The layer therefore references each
root prim of the garment instead of sublayering its file, whose own material bindings would win.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
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
from fabricusd.materials.networks.graph import Graph, Texture, Value
from fabricusd.materials.networks.look import Look
from fabricusd.materials.networks.surfaces import Inputs
from fabricusd.materials.targets.flat import SCOPE
from fabricusd.materials.targets.paths import asset_path
from fabricusd.materials.targets.write_usd import write_material
from fabricusd.schema import export, write_binding, write_fabric
from fabricusd.schema.access import remove_binding
from fabricusd.schema.names import free_name, prim_name
from fabricusd.schema.source import usd_errors

VARIANT_SET = "fabricLook"
VARIANTS = ("baked", "procedural", "off")
"""Textures; the fabric itself, with constants for tools that cannot render it; neither."""


@dataclass(frozen=True, kw_only=True)
class MaterialRecipe:
    """A material to write: its name, its networks with their name prefixes, and its inputs.

    inputs, looks : what the networks were made of: the maps of all surfaces except
        UsdPreviewSurface, and the look of each surface
    opaque : whether the cloth has no gaps
    """

    name: str
    graphs: tuple[tuple[str, Graph], ...]
    parameters: Mapping[str, Value | Texture]
    inputs: Inputs = field(default_factory=dict)
    looks: Mapping[str, Look] = field(default_factory=dict)
    opaque: bool = False


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
        _name_asset(root, path)
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
                BoundPrim(path=place, maps=one, lay=k, worn=None) for k, place in enumerate(places)
            ]
        dress(stage, path, bound, (), recipes)


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
            _name_asset(over, path)
            if prim == source.GetDefaultPrim():
                stage.SetDefaultPrim(over)
        for name in ("startTimeCode", "endTimeCode", "timeCodesPerSecond", "framesPerSecond"):
            if source.HasAuthoredMetadata(name):
                stage.SetMetadata(name, source.GetMetadata(name))
        if not stage.HasDefaultPrim():
            first = Sdf.Path(bound.prims[0].path).GetPrefixes()[0]
            stage.SetDefaultPrim(stage.GetPrimAtPath(first))
        dress(stage, path, bound.prims, bound.uv, recipes)


def _name_asset(root: Usd.Prim, path: Path) -> None:
    """The look's own name: a garment's would come through the reference."""
    model = Usd.ModelAPI(root)
    model.SetAssetIdentifier(f"./{path.name}")
    model.SetAssetName(path.stem)
    if model.GetAssetVersion():
        model.SetAssetVersion("")


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


def dress(
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
                below = [u for u in uv if Sdf.Path(u.path).HasPrefix(root)]
                # A fabric that the scene binds lies in the UVs that the scene has.
                moved = {"baked": below, "procedural": [u for u in below if u.fabricless]}
                _refer_uv(stage, path, moved.get(name, []), uv)
        variants.SetVariantSelection("baked")
        _put_first(prim, mine, recipes)


def _put_first(root: Usd.Prim, bound: Sequence[BoundPrim], recipes: Recipes) -> None:
    """Order the look's collections on `root` before those of the scene.

    On the prim, not in its variants: USD's text format loses the order of a variant's properties.
    """
    api = UsdShade.MaterialBindingAPI(root)
    names = [
        api.GetCollectionBindingRel(_collection(recipes[w.maps.name, w.lay, variant].name), purpose)
        for w in bound
        if w.outdone
        for variant in ("baked", "procedural")
        for purpose in _purposes(w)
    ]
    if names:
        root.SetPropertyOrder(list(dict.fromkeys(one.GetName() for one in names)))


def _purposes(one: BoundPrim) -> list[str]:
    """Those that the look binds for."""
    return list(dict.fromkeys((UsdShade.Tokens.allPurpose, one.purpose)))


def _collection(material: str) -> str:
    """Name of the collection of all that wears a material of the look."""
    return f"{VARIANT_SET}_{material}"


def _write_looks(
    stage: Usd.Stage, scope: Sdf.Path, bound: Sequence[BoundPrim], recipes: Recipes, folder: Path
) -> None:
    """The materials of `bound` below `scope`; the procedural ones carry their fabrics."""
    fabrics = scope.AppendChild(free_name("Fabrics", {one.name for one in recipes.values()}))
    for one in bound:
        for variant in ("baked", "procedural"):
            recipe = recipes[one.maps.name, one.lay, variant]
            where = scope.AppendChild(recipe.name)
            if stage.GetPrimAtPath(where):
                continue
            material = write_material(
                stage, where, list(recipe.graphs), dict(recipe.parameters), folder
            )
            binding = _binding(one)
            if variant == "procedural" and binding is not None:
                fabric = _fabric_path(stage, fabrics, one, binding)
                write_binding(material.GetPrim(), fabric, binding)


def _binding(one: BoundPrim) -> Binding | None:
    """How the fabric lies: as the scene says, or else where the bake laid it."""
    if one.worn is not None:
        return one.worn.binding
    lay = one.maps.lays[one.lay]
    return None if lay.fabric is None else binding_of(lay)


def _fabric_path(stage: Usd.Stage, fabrics: Sdf.Path, one: BoundPrim, binding: Binding) -> Sdf.Path:
    """The scene's own fabric where the look can name it, or else a copy below `fabrics`."""
    root = fabrics.GetPrefixes()[0]
    if one.worn is not None and Sdf.Path(one.worn.fabric).HasPrefix(root):
        own = stage.GetPrimAtPath(one.worn.fabric)
        if own and not own.IsInstanceProxy():
            return own.GetPath()
    UsdGeom.Scope.Define(stage, fabrics)
    where = fabrics.AppendChild(prim_name(binding.fabric.name))
    if not stage.GetPrimAtPath(where):
        write_fabric(stage, where, binding.fabric)
    return where


def _fill(
    stage: Usd.Stage, variant: str, one: BoundPrim, scope: Sdf.Path, recipes: Recipes
) -> None:
    """One prim in one variant: `off` is the garment as any tool shows it without fabrics."""
    prim = stage.OverridePrim(one.path)
    worn = one.worn
    if worn is not None and (variant == "off" or (variant, worn.owner) == ("baked", one.path)):
        _take_off(stage, worn.owner, Sdf.Path(one.path).GetPrefixes()[0])
    if variant != "off":
        recipe = recipes[one.maps.name, one.lay, variant]
        material = UsdShade.Material(stage.GetPrimAtPath(scope.AppendChild(recipe.name)))
        for purpose in _purposes(one):
            _bind(stage, prim, material, one, purpose)
        _show_both_sides(stage, prim)


def _show_both_sides(stage: Usd.Stage, prim: Usd.Prim) -> None:
    """State that cloth has two sides, unless the garment says how many it has.

    By USD's fallback a renderer may leave out the faces that are turned away.
    """
    mesh = prim.GetParent() if prim.IsA(UsdGeom.Subset) else prim
    if not mesh.IsA(UsdGeom.Gprim) or mesh.IsInstanceProxy():
        return
    if not UsdGeom.Gprim(mesh).GetDoubleSidedAttr().HasAuthoredValue():
        UsdGeom.Gprim(stage.OverridePrim(mesh.GetPath())).CreateDoubleSidedAttr(True)


def _take_off(stage: Usd.Stage, owner: str, root: Sdf.Path) -> None:
    """Empty a prim's `fabric:binding`. What an instance holds, or another root, keeps it."""
    prim = stage.GetPrimAtPath(owner)
    if not prim or not prim.GetPath().HasPrefix(root) or prim.IsInstanceProxy():
        return
    remove_binding(prim)
    prim.CreateRelationship("fabric:binding", custom=False).SetTargets([])


def _bind(
    stage: Usd.Stage, prim: Usd.Prim, material: UsdShade.Material, one: BoundPrim, purpose: str
) -> None:
    """Bind a material to a one: directly, or where that is outdone in a collection at the root.

    No binding is stronger than one at the root that is stronger than all below; of several
    collections there, the first counts.
    """
    strong = UsdShade.Tokens.strongerThanDescendants
    if not one.outdone:
        strength = strong if one.forced else UsdShade.Tokens.fallbackStrength
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, strength, purpose)
        return
    root = stage.GetPrimAtPath(prim.GetPath().GetPrefixes()[0])
    name = _collection(material.GetPath().name)
    collection = Usd.CollectionAPI.Apply(root, name)
    collection.IncludePath(prim.GetPath())
    api = UsdShade.MaterialBindingAPI.Apply(root)
    api.Bind(collection, material, name, strong, purpose)


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


def _refer_uv(stage: Usd.Stage, path: Path, uv: Sequence[NewUV], written: Sequence[NewUV]) -> None:
    """Refer the meshes of `uv` to their UVs; `written` : those of the layer, in its order."""
    for number, one in enumerate(written):
        if any(one is mine for mine in uv):
            prim = stage.OverridePrim(one.path)
            prim.GetReferences().AddReference(f"./{path.stem}.uv.usdc", _uv_prim(number))
