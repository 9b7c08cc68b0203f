"""Find the prims of a scene that baked materials are bound to, and their UVs."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from fabricusd.bake.layout.copies import are_alike
from fabricusd.bake.layout.garment import Garment, fitted, garments
from fabricusd.errors import FabricError
from fabricusd.materials.bake_folder import MapSet
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import Scene
from fabricusd.schema import open_stage
from fabricusd.schema.access import applies_binding, targets, value


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundPrim:
    """A mesh or subset that a baked material is bound to.

    path : of the prim in the scene
    maps : its textures; lay : index of its fabric in `maps.lays`
    binds_fabric : whether the scene itself binds the fabric to the prim
    forced : the binding must be stronger than those of descendants: `path` is an instance's root
    """

    path: str
    maps: MapSet
    lay: int
    binds_fabric: bool
    forced: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class NewUV:
    """A mesh's UVs in the layout of the textures: values and indices of primvar `st`."""

    path: str
    values: NDArray[np.float32]
    indices: NDArray[np.int32] | None
    interpolation: str


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundScene:
    """A scene and the prims in it that a look binds materials to."""

    stage: Usd.Stage
    prims: tuple[BoundPrim, ...]
    uv: tuple[NewUV, ...]
    notes: tuple[str, ...]


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
    bound: list[BoundPrim] = []
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
            bound += _of(prim, maps, notes)
            name = _uv_name(prim)
            if path in now and not (maps.own_uv and name == "st"):
                uv.append(_moved(prim, name, maps, now[path]))
    if not bound:
        raise FabricError(str(scene), "has none of the prims that were baked; bake again")
    return BoundScene(stage=stage, prims=tuple(bound), uv=tuple(uv), notes=tuple(notes))


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
    found = []
    for one in (prim, *UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(prim))):
        one = one.GetPrim() if not isinstance(one, Usd.Prim) else one
        if applies_binding(one):
            found_at = targets(one, "fabric:binding")
            name = found_at[0].name if found_at else ""
            lay = next((k for k, lay in enumerate(maps.lays) if lay.name == name), 0)
            found.append(BoundPrim(path=str(one.GetPath()), maps=maps, lay=lay, binds_fabric=True))
    return found or [BoundPrim(path=str(prim.GetPath()), maps=maps, lay=0, binds_fabric=False)]


def _instance(prim: Usd.Prim, maps: MapSet, notes: list[str]) -> list[BoundPrim]:
    root = prim
    while root.IsInstanceProxy():
        root = root.GetParent()
    meshes = [p for p in Usd.PrimRange(root, Usd.TraverseInstanceProxies()) if p.IsA(UsdGeom.Mesh)]
    if len(meshes) > 1:
        notes.append(
            f"{prim.GetPath()} gets no look: it shares an instance with other meshes, which cannot "
            "be changed individually; bake the prim that the instance refers to"
        )
        return []
    return [BoundPrim(path=str(root.GetPath()), maps=maps, lay=0, binds_fabric=False, forced=True)]


def _uv_name(prim: Usd.Prim) -> str:
    """Return the name of the UV set that the fabric uses."""
    return str(value(prim, "fabric:binding:uvSet") or "st")


def _moved(prim: Usd.Prim, name: str, maps: MapSet, now: Garment) -> NewUV:
    """Return the UVs as `bake --fit` moved them: old = span * new + low."""
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
        interpolation=str(primvar.GetInterpolation()),
    )  # fmt: skip
