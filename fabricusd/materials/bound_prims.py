"""Find the prims of a scene that baked materials are bound to, and their UVs."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdShade

from fabricusd.bake.layout.copies import are_alike
from fabricusd.bake.layout.garment import Garment, fitted, garments
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding
from fabricusd.materials.bake_folder import MapSet
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import Scene
from fabricusd.scene.usd.worn import Bound, bound
from fabricusd.schema import open_stage, read_binding
from fabricusd.schema.access import targets


@dataclass(frozen=True, kw_only=True, eq=False)
class Worn:
    """The fabric that the scene itself binds to a prim.

    owner : path of the prim whose `fabric:binding` counts: the prim, one above it, or a material
    fabric : path of the WovenFabric prim
    """

    owner: str
    fabric: str
    binding: Binding


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundPrim:
    """A mesh or subset that a baked material is bound to.

    path : of the prim in the scene
    maps : its textures; lay : number of its fabric among theirs
    worn : what the scene makes it wear; None where the fabric was named for the bake alone
    forced : the binding must outdo those below, since `path` is an instance's root
    purpose : of the scene's own material binding, "" for all purposes
    outdone : a binding on the prim itself would not count, since another one is stronger
    """

    path: str
    maps: MapSet
    lay: int
    worn: Worn | None
    forced: bool = False
    purpose: str = ""
    outdone: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class NewUV:
    """A mesh's UVs in the textures' layout: values and indices of primvar `st`.

    fabricless : whether the scene binds no fabric there, which would lie in the UVs as they are
    """

    path: str
    values: NDArray[np.float32]
    indices: NDArray[np.int32] | None
    interpolation: str
    fabricless: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundScene:
    """A scene and the prims in it that a look binds materials to.

    placed : the baked garments as they are in the scene now, by prim path
    """

    stage: Usd.Stage
    prims: tuple[BoundPrim, ...]
    uv: tuple[NewUV, ...]
    notes: tuple[str, ...]
    placed: Mapping[str, Garment]


def find_bound_prims(scene: Path, sets: tuple[MapSet, ...]) -> BoundScene:
    """Find the prims of `scene` that the textures belong to.

    Raises FabricError if the scene is not a USD layer, has none of the baked prims, or was baked
    with `--unwrap`.
    """
    if scene.suffix.lower() not in (".usd", ".usda", ".usdc"):
        raise FabricError(
            str(scene),
            "is not a USD layer; leave --scene out to bind the look to the baked meshes",
        )
    stage, _ = open_stage(scene)
    now = _garments(scene, sets)
    found: list[BoundPrim] = []
    uv: list[NewUV] = []
    notes: list[str] = []
    for maps in sets:
        for path in maps.prims:
            # A garment of an .obj is named after its file, which may not be a valid prim path.
            whole = Sdf.Path.IsValidPathString(path) and Sdf.Path(path).IsAbsolutePath()
            prim = stage.GetPrimAtPath(path) if whole else None
            if not prim:
                notes.append(f"{path} is no longer in {scene.name}; it gets no look")
                continue
            _compare(maps, now.get(path), [now[k] for k in maps.prims if k in now], path, notes)
            mine = _of(prim, maps, notes)
            found += mine
            name = next((one.worn.binding.uv_set for one in mine if one.worn), "st")
            if mine and path in now and not (maps.own_uv and name == "st"):
                uv.append(_moved(prim, name, maps, now[path], fabricless=mine[0].worn is None))
    if not found:
        raise FabricError(str(scene), "has none of the prims that were baked; bake it again")
    return BoundScene(stage=stage, prims=tuple(found), uv=tuple(uv), notes=tuple(notes), placed=now)


def _garments(scene: Path, sets: tuple[MapSet, ...]) -> dict[str, Garment]:
    """Return the baked garments as they are in the scene now, by prim path."""
    found = {}
    read: dict[str, Scene] = {}
    for maps in sets:
        lay = maps.lays[0]
        if lay.name not in read:
            read[lay.name] = read_scene(scene, fabric=lay.fabric)
        for path in maps.prims:
            # Prims that are no longer garments are reported by `_compare`.
            with suppress(FabricError):
                found[path] = garments(read[lay.name], path)[0]
    return found


def _compare(
    maps: MapSet, now: Garment | None, sharing: list[Garment], path: str, notes: list[str]
) -> None:
    """Append a note if a garment has changed since it was baked.

    sharing : the garments of all prims that share these textures
    """
    if now is None:
        notes.append(f"{path} no longer wears a fabric; its textures are bound nevertheless")
        return
    # The fingerprint is that of one of the copies, which differ in their positions.
    for one in sharing:
        same = one.fingerprint == maps.fingerprint or (
            not maps.own_uv and fitted(one).fingerprint == maps.fingerprint
        )
        if same and (one is now or are_alike(one, now)):
            return
    notes.append(
        f"{path} has changed since it was baked; bake again if its UVs or fabric have changed"
    )


def _of(prim: Usd.Prim, maps: MapSet, notes: list[str]) -> list[BoundPrim]:
    """Return the mesh itself, or those of its subsets that bind fabrics of their own."""
    if prim.IsInstanceProxy():
        return _instance(prim, maps, notes)
    whole = bound(prim)
    found = []
    for one in (prim, *map(Usd.SchemaBase.GetPrim, _subsets(prim))):
        said = whole if one == prim else bound(one)
        worn = None if one != prim and said.place == whole.place else _worn(said)
        if worn is not None:
            found.append(_bound_prim(one, maps, said, worn))
    return found or [_bound_prim(prim, maps, whole, None)]


def _subsets(prim: Usd.Prim) -> list[UsdGeom.Subset]:
    return list(UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(prim)))


def _bound_prim(prim: Usd.Prim, maps: MapSet, said: Bound, worn: Worn | None) -> BoundPrim:
    name = Sdf.Path(worn.fabric).name if worn else ""
    lay = next((k for k, lay in enumerate(maps.lays) if lay.name == name), 0)
    return BoundPrim(
        path=str(prim.GetPath()), maps=maps, lay=lay, worn=worn, purpose=said.purpose,
        outdone=_outdoes_direct(said.relationship, prim),
    )  # fmt: skip


def _worn(said: Bound) -> Worn | None:
    """What a prim wears in the scene, None where it wears no fabric that can be read."""
    for owner in said.fabrics:
        with suppress(FabricError):
            binding = read_binding(owner)
            fabric = targets(owner, "fabric:binding")[0]
            return Worn(owner=str(owner.GetPath()), fabric=str(fabric), binding=binding)
    return None


def _outdoes_direct(relationship: Usd.Relationship | None, prim: Usd.Prim) -> bool:
    """Whether a material's binding goes before one that is authored on `prim` directly."""
    if relationship is None or not prim.GetPath().HasPrefix(relationship.GetPrim().GetPath()):
        return False
    if relationship.GetPrim() == prim:
        return "collection" in relationship.SplitName()
    strength = UsdShade.MaterialBindingAPI.GetMaterialBindingStrength(relationship)
    return bool(strength == UsdShade.Tokens.strongerThanDescendants)


def _instance(prim: Usd.Prim, maps: MapSet, notes: list[str]) -> list[BoundPrim]:
    root = prim
    while root.IsInstanceProxy():
        root = root.GetParent()
    meshes = [p for p in Usd.PrimRange(root, Usd.TraverseInstanceProxies()) if p.IsA(UsdGeom.Mesh)]
    others = "other meshes" if len(meshes) > 1 else "several fabrics" * (len(maps.lays) > 1)
    if others:
        notes.append(
            f"{prim.GetPath()} is in an instance with {others}, which cannot be changed one by "
            "one; it gets no look: bake and dress what the instance refers to"
        )
        return []
    said = bound(prim)
    return [
        BoundPrim(
            path=str(root.GetPath()), maps=maps, lay=0, worn=_worn(said), forced=True,
            purpose=said.purpose, outdone=_outdoes_direct(said.relationship, root),
        )
    ]  # fmt: skip


def _moved(prim: Usd.Prim, name: str, maps: MapSet, now: Garment, *, fabricless: bool) -> NewUV:
    """UVs where `bake --fit` put them, old = span * new + low, as primvar `st`."""
    if prim.IsInstanceProxy():
        raise FabricError(
            str(prim.GetPath()),
            "is in an instance, where its UVs cannot be moved to where its textures have them; "
            "bake it in UVs of its own named 'st' without --fit, or leave --scene out",
        )
    old, new = now.lays[0], maps.lays[0]
    span = float(np.linalg.norm(new.matrix) / np.linalg.norm(old.matrix))
    low = np.linalg.solve(old.matrix, new.offset - old.offset)
    if not np.allclose(new.matrix, old.matrix * span, rtol=1e-6, atol=1e-9):
        raise FabricError(
            str(prim.GetPath()),
            "was baked with --unwrap, so only the baked mesh has its UVs; leave --scene out",
        )
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not primvar:
        raise FabricError(
            str(prim.GetPath()), f"has no primvar '{name}', which the textures use; bake again"
        )
    values = (np.asarray(primvar.Get(), np.float64) - low) / span
    indices = np.asarray(primvar.GetIndices(), np.int32) if primvar.IsIndexed() else None
    return NewUV(
        path=str(prim.GetPath()), values=values.astype(np.float32), indices=indices,
        interpolation=str(primvar.GetInterpolation()), fabricless=fabricless,
    )  # fmt: skip
