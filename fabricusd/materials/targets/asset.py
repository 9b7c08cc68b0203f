"""An asset as studios lay one out: a root that is light to read, geometry and looks as a payload.

    NAME.usda            kind, assetInfo, extents; the payload
    payload.usda         the two layers below, one over the other
    look.usda            variant set `colorway`: a reference to each of `colorways`
    geometry.usdc        the baked meshes
    colorways/X.usda     materials, fabrics and bindings of one bake
    textures/X/          its textures

Another bake of the same garment adds a colourway. Nothing in the folder names anything outside.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pxr import Sdf, Usd, UsdGeom

from fabricusd import __version__
from fabricusd.errors import FabricError
from fabricusd.files import whole_file
from fabricusd.materials.bake_folder import MapSet
from fabricusd.materials.bound_prims import BoundPrim
from fabricusd.materials.networks.graph import Graph, Texture
from fabricusd.materials.targets import Job
from fabricusd.materials.targets.layer import VARIANT_SET, MaterialRecipe, Recipes, dress
from fabricusd.schema import export
from fabricusd.schema.names import prim_name
from fabricusd.schema.source import no_warnings, usd_errors

COLORWAYS = "colorway"
"""The variant set of bakes of one garment."""

GEOMETRY = "geo"
"""Scope of the meshes, below the asset's root prim."""


def check(where: Path, clobber: bool) -> None:
    """Refuse a folder that is not an asset of ours, or that has no parent folder."""
    if not where.parent.is_dir():
        raise FabricError(f"--asset '{where}'", f"is in '{where.parent}', which is not a directory")
    if where.exists() and not where.is_dir():
        raise FabricError(f"--asset '{where}'", "is a file; it must be a folder")
    if where.is_dir() and any(where.iterdir()) and not _is_ours(_root_path(where)):
        raise FabricError(
            f"--asset '{where}'",
            "holds files that are not an asset of fabricusd; it must be new",
        )


def folder(look: Path, where: Path) -> Path:
    """The folder itself."""
    return where


def write(job: Job, where: Path) -> list[Path]:
    """The asset, or in one that is there a colourway more.

    Raises FabricError where the asset has another garment's geometry, or with `--no-clobber` the
    colourway already.
    """
    name = prim_name(where.name, ascii_only=True)
    colorway = prim_name(job.colorway or "_".join(job.fabrics) or "baked", ascii_only=True)
    geometry = _geometry(job.garments, name)
    _refuse(where, colorway, geometry, job.clobber)
    for inside in (where, where / "colorways", where / "textures", where / "textures" / colorway):
        inside.mkdir(exist_ok=True)
    copies = _Copies(where / "textures" / colorway)
    made = [where / "colorways" / f"{colorway}.usda"]
    export(_colorway(job, name, made[0], copies, geometry), made[0])
    root = Sdf.Path(f"/{name}")
    up_axis = UsdGeom.GetStageUpAxis(Usd.Stage.Open(geometry))
    shown = _first_colorway(where / f"{name}.usda", root) or colorway
    # On their stages in memory relative paths lead nowhere yet.
    with no_warnings():
        layers = {
            "geometry.usdc": geometry,
            "look.usda": _look(where, root, up_axis),
            "payload.usda": _payload(root, up_axis),
            f"{name}.usda": _root(root, geometry, shown),
        }
    for file, layer in layers.items():
        export(layer, where / file)
        made.append(where / file)
    return [*copies.written, *made]


def _root_path(where: Path) -> Path:
    return where / f"{prim_name(where.name, ascii_only=True)}.usda"


def _is_ours(path: Path) -> bool:
    if not path.is_file():
        return False
    with usd_errors(str(path), "read as USD"):
        layer = Sdf.Layer.FindOrOpen(str(path))
    return layer is not None and "fabricusd" in (layer.customLayerData or {})


def _refuse(where: Path, colorway: str, geometry: Sdf.Layer, clobber: bool) -> None:
    there = where / "geometry.usdc"
    if there.is_file():
        old = Sdf.Layer.OpenAsAnonymous(str(there))
        if old.ExportToString() != geometry.ExportToString():
            raise FabricError(
                str(where), "holds another garment's geometry; a colourway is a bake of the same "
                "meshes, and another garment needs another folder",
            )  # fmt: skip
    if not clobber and (where / "colorways" / f"{colorway}.usda").exists():
        raise FabricError(
            str(where), f"has the colourway '{colorway}'; it must be a new name with --no-clobber"
        )


def _new(root: Sdf.Path, up_axis: str, what: str) -> tuple[Sdf.Layer, Usd.Stage]:
    """A layer whose default prim is an Xform at `root`, in metres, and its stage."""
    # What a stage makes by itself goes with the stage.
    layer = Sdf.Layer.CreateAnonymous(".usda")
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, up_axis)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, root).GetPrim())
    layer.documentation = f"{what}, made by fabricusd {__version__}"
    layer.customLayerData = {"fabricusd": {"version": __version__}}
    return layer, stage


def _geometry(sets: Sequence[MapSet], name: str) -> Sdf.Layer:
    """The meshes of all garments, as they were baked."""
    scope = Sdf.Path(f"/{name}").AppendChild(GEOMETRY)
    layer = stage = None
    for one in sets:
        if not one.mesh.is_file():
            raise FabricError(str(one.mesh), "is missing; an asset needs it, bake again")
        source = Sdf.Layer.OpenAsAnonymous(str(one.mesh))
        baked = Usd.Stage.Open(source)
        if layer is None:
            up_axis = UsdGeom.GetStageUpAxis(baked)
            layer, stage = _new(scope.GetParentPath(), up_axis, "Geometry")
            UsdGeom.Scope.Define(stage, scope)
        path = scope.AppendChild(prim_name(one.name))
        Sdf.CopySpec(source, baked.GetDefaultPrim().GetPath(), layer, path)
        for subset in UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable.Get(stage, path)):
            # It is named after the fabric, which is the colourway's.
            subset.GetPrim().ClearDocumentation()
    assert layer is not None
    return layer


class _Copies:
    """Copies of textures in a folder, each made once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.written: list[Path] = []

    def of(self, texture: Texture) -> Texture:
        """The texture in the folder, with all its tiles."""
        name = texture.path.name
        for source in sorted(texture.path.parent.glob(name.replace("<UDIM>", "[0-9]" * 4))):
            target = self.folder / source.name
            if target not in self.written:
                with whole_file(target) as temporary:
                    shutil.copyfile(source, temporary)
                self.written.append(target)
        return replace(texture, path=self.folder / name)

    def in_recipe(self, recipe: MaterialRecipe) -> MaterialRecipe:
        """The recipe with its textures in the folder."""
        return replace(
            recipe,
            graphs=tuple((n, self._in_graph(g)) for n, g in recipe.graphs),
            parameters={
                name: self.of(one) if isinstance(one, Texture) else one
                for name, one in recipe.parameters.items()
            },
        )

    def _in_graph(self, graph: Graph) -> Graph:
        nodes = tuple(
            replace(
                node,
                inputs={
                    name: self.of(source) if isinstance(source, Texture) else source
                    for name, source in node.inputs.items()
                },
            )
            for node in graph.nodes
        )
        return replace(graph, nodes=nodes)


def _colorway(job: Job, name: str, path: Path, copies: _Copies, geometry: Sdf.Layer) -> Sdf.Layer:
    """Materials and bindings of the bake, without the meshes."""
    meshes = Usd.Stage.Open(geometry)
    layer, stage = _new(Sdf.Path(f"/{name}"), UsdGeom.GetStageUpAxis(meshes), "Colourway")
    bound = []
    for one in job.garments:
        mesh = Sdf.Path(f"/{name}").AppendChild(GEOMETRY).AppendChild(prim_name(one.name))
        subsets = UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable.Get(meshes, mesh))
        places = [str(s.GetPath()) for s in subsets] or [str(mesh)]
        if len(places) != len(one.lays):
            raise FabricError(
                str(one.mesh),
                f"has {len(places)} parts; the manifest says {len(one.lays)} lays, bake again",
            )
        bound += [
            BoundPrim(path=place, maps=one, lay=k, worn=None) for k, place in enumerate(places)
        ]
    recipes: Recipes = {key: copies.in_recipe(one) for key, one in job.recipes.items()}
    dress(stage, path, bound, (), recipes)
    return layer


def _look(where: Path, root: Sdf.Path, up_axis: str) -> Sdf.Layer:
    """A variant for each colourway in the folder."""
    layer, stage = _new(root, up_axis, "Looks")
    variants = stage.GetDefaultPrim().GetVariantSets().AddVariantSet(COLORWAYS)
    for name in sorted(path.stem for path in (where / "colorways").glob("*.usda")):
        variants.AddVariant(name)
        spec = layer.GetPrimAtPath(root.AppendVariantSelection(COLORWAYS, name))
        spec.referenceList.Prepend(Sdf.Reference(f"./colorways/{name}.usda"))
    return layer


def _payload(root: Sdf.Path, up_axis: str) -> Sdf.Layer:
    layer, _ = _new(root, up_axis, "Payload")
    layer.subLayerPaths = ["./look.usda", "./geometry.usdc"]
    return layer


def _root(root: Sdf.Path, geometry: Sdf.Layer, colorway: str) -> Sdf.Layer:
    """What is read without the payload: what the asset is, and how large."""
    meshes = Usd.Stage.Open(geometry)
    layer, stage = _new(root, UsdGeom.GetStageUpAxis(meshes), "Asset")
    prim = stage.GetDefaultPrim()
    model = Usd.ModelAPI(prim)
    model.SetKind("component")
    model.SetAssetName(root.name)
    model.SetAssetIdentifier(f"./{root.name}.usda")
    model.SetPayloadAssetDependencies([Sdf.AssetPath("./payload.usda")])
    extents = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    hint = UsdGeom.ModelAPI(meshes.GetDefaultPrim()).ComputeExtentsHint(extents)
    UsdGeom.ModelAPI.Apply(prim).SetExtentsHint(hint)
    spec = layer.GetPrimAtPath(root)
    spec.payloadList.Prepend(Sdf.Payload("./payload.usda"))
    spec.variantSelections[COLORWAYS] = colorway
    spec.variantSelections[VARIANT_SET] = "baked"
    return layer


def _first_colorway(path: Path, root: Sdf.Path) -> str:
    """The colourway that the asset at `path` shows; an empty string where there is no asset yet."""
    layer = Sdf.Layer.OpenAsAnonymous(str(path)) if path.is_file() else None
    spec = layer.GetPrimAtPath(root) if layer else None
    return str(spec.variantSelections.get(COLORWAYS, "")) if spec else ""
