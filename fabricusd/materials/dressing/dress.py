"""Garments of mesh or USD files, worn in a fabric and lit in a studio, as one USD scene."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade, Vt

from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, Fabric
from fabricusd.files import require_writable
from fabricusd.materials.dressing.studio import define_studio
from fabricusd.materials.uniform import write_fabric_material
from fabricusd.scene.read import MESH_SUFFIXES, USD_SUFFIXES, read_scene
from fabricusd.scene.scene import FabricSurface, Mesh, Scene
from fabricusd.scene.size import mesh_words
from fabricusd.scene.studio import Subject
from fabricusd.schema import export, write_fabric
from fabricusd.schema.anysource import is_draft, load_any
from fabricusd.schema.names import free_name, prim_name
from fabricusd.schema.source import (
    PRESETS,
    find_fabric,
    no_warnings,
    open_stage,
    split_source,
    usd_errors,
    variants_of,
)
from fabricusd.schema.write import EXTENSIONS

ROOT = Sdf.Path("/World")
GARMENTS = ROOT.AppendChild("Garments")


@dataclass(frozen=True, kw_only=True)
class Dressed:
    """What was made.

    files : the scene, and the geometry of mesh files beside it
    meshes : one line for each mesh that wears the fabric: its size, and the threads across it
    notes : what was assumed or left out
    """

    files: tuple[Path, ...]
    meshes: tuple[str, ...]
    notes: tuple[str, ...]


def dress(
    garments: Sequence[str | os.PathLike[str]],
    output: str | os.PathLike[str],
    *,
    fabric: str,
    units: str | None = None,
    grain: float = 0.0,
    scale: float = 0.0,
    clobber: bool = True,
    write: bool = True,
) -> Dressed:
    """Write a scene in which the meshes of the files `garments` wear `fabric`.

    fabric : as for `load_any`; a USD file is referenced, all else is written into the scene
    units : of .obj and .ply files, see `read_scene`
    grain : from the meshes' u axis to the weft, counter-clockwise [rad]
    scale : length of one UV unit on the cloth [m]; 0 to measure it on each mesh

    The geometry of mesh files goes into a layer beside the scene; USD files are referenced. Raises
    FabricError, and writes nothing, if a file cannot be read, or if no mesh can wear the fabric.
    """
    target = Path(output)
    if target.suffix.lower() not in EXTENSIONS:
        raise FabricError(str(target), f"must end in one of {', '.join(EXTENSIONS)}")
    geometry_file = target.with_name(f"{target.stem}_geometry.usdc")
    for path in (target, geometry_file):
        require_writable(path, clobber=clobber)
    cloth, notes = load_any(fabric)
    binding = Binding(fabric=cloth, rotation=grain, metres_per_uv=scale)
    scene = _new_stage()
    geometry = _new_stage()
    told: list[str] = [*notes]
    worn: list[str] = []
    names: dict[str, None] = {}
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for garment in garments:
        path = Path(garment)
        own = path.suffix.lower() in MESH_SUFFIXES
        read = _worn(read_scene(path, fabric=binding, units=units if own else None), binding, own)
        told += read.notes
        cloths = {k for k, each in enumerate(read.materials) if isinstance(each, FabricSurface)}
        wearing = [mesh for mesh in read.meshes if set(mesh.material.tolist()) & cloths]
        worn += [f"{mesh.path}: {mesh_words(read, mesh)}" for mesh in wearing]
        name = free_name(prim_name(path.stem), names)
        names[name] = None
        place = GARMENTS.AppendChild(name)
        UsdGeom.Xform.Define(scene, place)
        # USD would warn of references that a layer in memory does not find.
        with no_warnings():
            if own:
                _write_meshes(geometry, place, read.meshes)
            else:
                _refer(scene, place, path, target)
        corners = _corners(read.bounds(), read.up_axis)
        low, high = np.minimum(low, corners[0]), np.maximum(high, corners[1])
    if not worn:
        raise FabricError(
            ", ".join(os.fspath(garment) for garment in garments),
            "has no mesh that can wear a fabric; a mesh needs UVs",
        )
    with usd_errors(str(target), "written"), no_warnings():
        _wear(scene, cloth, fabric, binding, target)
        define_studio(scene, ROOT.AppendChild("Studio"), Subject(low=low, high=high))
    files = [target]
    layer = scene.GetRootLayer()
    if geometry.GetPrimAtPath(GARMENTS).GetChildren():
        files.append(geometry_file)
        with no_warnings():
            layer.subLayerPaths.append(f"./{geometry_file.name}")
    if write:
        if len(files) > 1:
            export(geometry.GetRootLayer(), geometry_file, clobber=clobber)
        export(layer, target, clobber=clobber)
    return Dressed(files=tuple(files), meshes=tuple(worn), notes=tuple(dict.fromkeys(told)))


def _new_stage() -> Usd.Stage:
    """A stage in memory, in metres, +y up, with its default prim."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    world = UsdGeom.Xform.Define(stage, ROOT).GetPrim()
    Usd.ModelAPI(world).SetKind(Kind.Tokens.group)
    stage.SetDefaultPrim(world)
    UsdGeom.Xform.Define(stage, GARMENTS)
    return stage


def _worn(scene: Scene, binding: Binding, own: bool) -> Scene:
    """`scene` with the fabric on all meshes that have UVs, as the dressed scene's binding puts it.

    In a USD file (not `own`), meshes may have materials, which `read_scene` leaves on them.
    """
    if own:
        return scene
    scene.materials.append(FabricSurface(name=binding.fabric.name, binding=binding))
    cloth = len(scene.materials) - 1
    scene.meshes = [
        mesh if mesh.uv is None else replace(mesh, material=np.full_like(mesh.material, cloth))
        for mesh in scene.meshes
    ]
    return scene


def _corners(bounds: tuple[np.ndarray, np.ndarray], up_axis: str) -> tuple[np.ndarray, np.ndarray]:
    """A bounding box in the scene's +y up."""
    low, high = bounds
    if up_axis != "Z":
        return low, high
    return np.array([low[0], low[2], -high[1]]), np.array([high[0], high[2], -low[1]])


def _write_meshes(stage: Usd.Stage, place: Sdf.Path, meshes: Sequence[Mesh]) -> None:
    """Define the meshes of one file below `place`."""
    UsdGeom.Xform.Define(stage, place)
    names: dict[str, None] = {}
    for mesh in meshes:
        name = free_name(prim_name(mesh.path.rpartition(":")[2]), names)
        names[name] = None
        prim = UsdGeom.Mesh.Define(stage, place.AppendChild(name))
        points = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(mesh.points, np.float32))
        triangles = np.ascontiguousarray(mesh.triangles, np.int32)
        prim.CreatePointsAttr(points)
        prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(triangles), 3, np.int32)))
        prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(triangles.ravel()))
        prim.CreateSubdivisionSchemeAttr("none")
        prim.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
        api = UsdGeom.PrimvarsAPI(prim)
        if mesh.uv is not None:
            uv = np.ascontiguousarray(mesh.uv.reshape(-1, 2), np.float32)
            api.CreatePrimvar(
                "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
            ).Set(Vt.Vec2fArray.FromNumpy(uv))
        if mesh.normals is not None:
            normals = np.ascontiguousarray(np.asarray(mesh.normals).reshape(-1, 3), np.float32)
            prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
            prim.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)


def _refer(stage: Usd.Stage, place: Sdf.Path, path: Path, target: Path) -> None:
    """Reference a USD file below `place`, in metres and with +y up."""
    if path.suffix.lower() not in USD_SUFFIXES:
        raise FabricError(str(path), "is no scene")
    asset, _ = open_stage(path)
    root = asset.GetDefaultPrim() or next(iter(asset.GetPseudoRoot().GetChildren()), None)
    if not root:
        raise FabricError(str(path), "holds no prim")
    above = UsdGeom.Xformable(stage.GetPrimAtPath(place))
    metres = UsdGeom.GetStageMetersPerUnit(asset)
    if UsdGeom.GetStageUpAxis(asset) == UsdGeom.Tokens.z:
        above.AddRotateXOp().Set(-90.0)
    if metres != 1.0:
        above.AddScaleOp().Set(Gf.Vec3f(metres))
    prim = stage.DefinePrim(place.AppendChild(prim_name(root.GetName())))
    prim.GetReferences().AddReference(_relative(path, target), root.GetPath())


def _relative(path: Path, target: Path) -> str:
    """How a layer at `target` names the file `path`."""
    try:
        name = os.path.relpath(path, target.parent)
    except ValueError:  # another drive
        return str(path.resolve())
    return Path(name).as_posix() if name.startswith(".") else f"./{Path(name).as_posix()}"


def _wear(stage: Usd.Stage, cloth: Fabric, source: str, binding: Binding, target: Path) -> None:
    """Define the fabric, a material that carries it, and bind all garments to that."""
    for group in ("Fabrics", "Looks"):
        UsdGeom.Scope.Define(stage, ROOT.AppendChild(group))
    path = ROOT.AppendPath(f"Fabrics/{prim_name(cloth.name)}")
    file, _ = split_source(source)
    if is_draft(source) or PRESETS in file.parents:
        write_fabric(stage, path, cloth)
    else:
        layer, name = open_stage(source)
        found = find_fabric(layer, name, split_source(source)[1])
        prim = stage.DefinePrim(path)
        prim.GetReferences().AddReference(_relative(file, target), found.GetPath())
        for which, variant in variants_of(source):
            prim.GetVariantSets().SetSelection(which, variant)
    material = write_fabric_material(
        stage, ROOT.AppendPath(f"Looks/{prim_name(cloth.name)}"), path, binding
    )
    garments = stage.GetPrimAtPath(GARMENTS)
    UsdShade.MaterialBindingAPI.Apply(garments).Bind(
        material, UsdShade.Tokens.strongerThanDescendants
    )
