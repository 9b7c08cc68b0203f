"""Reads a UsdGeomMesh as triangles: n-gons, subsets, orientation, normals, UVs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from fabricusd.errors import FabricError
from fabricusd.scene.scene import Mesh, Scene
from fabricusd.scene.surface.fineness import Fineness
from fabricusd.scene.surface.limit_grid import triangles_at
from fabricusd.scene.surface.tessellation import (
    CageTessellation,
    RefinedTessellation,
    Refinement,
    Tessellation,
)
from fabricusd.scene.usd.material import Materials, Resolved
from fabricusd.scene.usd.skeleton import Pose
from fabricusd.scene.usd.subdivision import read_refinement
from fabricusd.scene.usd.value import array_of, value_of
from fabricusd.schema.access import applies_binding

MOST_TRIANGLES = 4_000_000
"""Most triangles that all surfaces of a scene are refined to: some 3 GB of memory."""

_OF_UVS = (
    Sdf.ValueTypeNames.TexCoord2fArray,
    Sdf.ValueTypeNames.TexCoord2dArray,
    Sdf.ValueTypeNames.TexCoord2hArray,
    Sdf.ValueTypeNames.Float2Array,
)
"""Types of primvars that are taken as UVs whatever their name is."""

FARTHEST = 1e9
"""Largest distance from the origin [m]: beyond it squares of areas leave the range of 32-bit
numbers."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """A mesh's prim and its place in the world.

    matrix : (4, 4) from the mesh's points to the world, in scene units
    mirrored : whether the prim's own transform mirrors the mesh
    pose : the points that a skeleton has moved; None where the prim's own points count
    places : (k, 4, 4) - `matrix` at each place where the mesh stands, None for only that one
    """

    prim: Usd.Prim
    matrix: NDArray[np.float64]
    mirrored: bool
    pose: Pose | None = None
    places: NDArray[np.float64] | None = None


def is_mirrored(matrix: NDArray[np.float64]) -> bool:
    """Whether a (4, 4) transform changes the handedness."""
    return bool(np.linalg.det(matrix[:3, :3]) < 0)


def read_mesh(
    placed: Placed,
    time: Usd.TimeCode,
    metres: float,
    materials: Materials,
    scene: Scene,
    fineness: Fineness,
) -> Mesh | None:
    """The mesh in world space and metres; None, with a note, where it has no usable faces.

    metres : in one scene unit
    """
    prim, matrix, pose, mirrored = placed.prim, placed.matrix, placed.pose, placed.mirrored
    where = str(prim.GetPath())
    mesh = UsdGeom.Mesh(prim)
    points = pose.points if pose else array_of(mesh.GetPointsAttr(), time, scene, width=3)
    counts = array_of(mesh.GetFaceVertexCountsAttr(), time, scene, np.int64)
    indices = array_of(mesh.GetFaceVertexIndicesAttr(), time, scene, np.int64)
    problem = _problem(points, counts, indices)
    if problem:
        scene.note(where, f"{problem}, left out")
        return None
    if (counts < 3).any():
        scene.note(
            where, f"has {int((counts < 3).sum())} faces with fewer than three corners, left out"
        )
    points = _near(points, matrix, metres, where, scene)
    scheme = str(value_of(mesh.GetSubdivisionSchemeAttr(), time, scene) or "none")
    level = None
    if scheme not in ("none", "bilinear"):
        places = matrix[None] if placed.places is None else placed.places
        level = fineness.finest(points, places[:, :3] * metres, counts, indices)
        if scheme == "catmullClark" and fineness.is_auto and not level:
            # No edge would be halved: the cage is as good.
            level = None
    cut = _tessellate(mesh, time, points, counts, indices, scene, level, mirrored=mirrored)
    resolved, which = _materials(prim, mesh, materials, len(counts), time, scene)
    uv, missing = _uv(prim, resolved, which[cut.faces], cut, time, where, scene)
    numbers = np.array([r.index for r in resolved], np.int32)[which[cut.faces]]
    if missing.any():
        scene.note(where, "has no UVs for its fabric; it is rendered grey")
        numbers = np.where(missing, materials.without_uv().index, numbers)
    normals: NDArray[np.floating] | None = (
        _authored_normals(placed, mesh, cut, time, scene) if scheme == "none" else cut.normals
    )
    if normals is not None:
        # Normals transform by the inverse transpose; here they are rows.
        turn = np.linalg.pinv(matrix[:3, :3]).astype(np.float32)
        normals = np.asarray(normals, np.float32) @ turn
    return Mesh(
        path=where,
        points=(cut.points @ matrix[:3, :3].T + matrix[:3, 3]) * metres,
        triangles=cut.triangles,
        normals=normals,
        smooth=scheme != "bilinear",
        uv=uv,
        material=numbers,
    )


def _near(
    points: NDArray[np.float64],
    matrix: NDArray[np.float64],
    metres: float,
    where: str,
    scene: Scene,
) -> NDArray[np.float64]:
    """The points, with NaN, and a note, for those that lie too far away to be traced."""
    world = (points @ matrix[:3, :3].T + matrix[:3, 3]) * metres
    beyond = (np.abs(world) > FARTHEST).any(axis=1)
    far = np.asarray(np.isfinite(world).all(axis=1) & beyond)
    if not far.any():
        return points
    scene.note(where, f"has {int(far.sum())} points beyond {FARTHEST:g} m, which do not count")
    return np.where(far[:, None], np.nan, points)


def _tessellate(
    mesh: UsdGeom.Mesh,
    time: Usd.TimeCode,
    points: NDArray[np.float64],
    counts: NDArray[np.int64],
    indices: NDArray[np.int64],
    scene: Scene,
    level: int | None,
    *,
    mirrored: bool,
) -> Tessellation:
    """The faces as triangles, refined where there is a level and the surface can be refined."""
    orientation = value_of(mesh.GetOrientationAttr(), time, scene)
    left_handed = orientation == UsdGeom.Tokens.leftHanded
    hidden = _holes(mesh, time, len(counts), scene)
    if level is not None:
        refinement = read_refinement(mesh, time, points, counts, indices, hidden, scene, level)
        level = 0 if refinement is None else _affordable(mesh, refinement, level, scene)
        if refinement is not None and level:
            try:
                return RefinedTessellation(
                    refinement, level, left_handed=left_handed, reverse=left_handed != mirrored
                )
            except FabricError as error:
                scene.note(str(mesh.GetPath()), f"is rendered at its cage: {error}")
    return CageTessellation(points, counts, indices, hidden=hidden, reverse=left_handed != mirrored)


def _affordable(mesh: UsdGeom.Mesh, refinement: Refinement, level: int, scene: Scene) -> int:
    """`level`, or, with a note, a lower level that fits into memory."""
    topology = refinement.cage.topology
    wanted, asked = scene.refined + triangles_at(topology, level), level
    while level and scene.refined + triangles_at(topology, level) > MOST_TRIANGLES:
        level -= 1
    if level:
        scene.refined += triangles_at(topology, level)
    if level < asked:
        scene.note(
            str(mesh.GetPath()),
            f"has its edges halved {level} times, not {asked}: that would make "
            f"{wanted / 1e6:.3g} million triangles; at most {MOST_TRIANGLES / 1e6:g} are made",
        )
    return level


def _holes(mesh: UsdGeom.Mesh, time: Usd.TimeCode, count: int, scene: Scene) -> NDArray[np.bool_]:
    """(f,) bool - which faces are holes."""
    hidden = np.zeros(count, bool)
    holes = array_of(mesh.GetHoleIndicesAttr(), time, scene, np.int64)
    known = (holes >= 0) & (holes < count)
    if not known.all():
        bad = holes[np.argmin(known)]
        scene.note(
            str(mesh.GetPath()), f"holeIndices has {bad}; it must be from 0 to {count - 1}; ignored"
        )
    hidden[holes[known]] = True
    return hidden


def _problem(points: Any, counts: Any, indices: Any) -> str:
    """Why these arrays make no faces, or an empty string."""
    if not len(points) or not len(counts):
        return "has no faces"
    if counts.min() < 0 or counts.sum() != len(indices):
        return f"has {len(indices)} face vertex indices for {int(counts.sum())} face corners"
    if len(indices) and (indices.min() < 0 or indices.max() >= len(points)):
        bad = int(indices.max()) if indices.max() >= len(points) else int(indices.min())
        return f"names point {bad} of {len(points)}"
    return ""


def _materials(
    prim: Usd.Prim,
    mesh: UsdGeom.Mesh,
    materials: Materials,
    faces: int,
    time: Usd.TimeCode,
    scene: Scene,
) -> tuple[list[Resolved], NDArray[np.int64]]:
    """The mesh's surfaces, and the index among them of each face's."""
    resolved = [materials.of(prim)]
    which = np.zeros(faces, np.int64)
    for subset in UsdGeom.Subset.GetAllGeomSubsets(mesh):
        where = str(subset.GetPath())
        kind = value_of(subset.GetElementTypeAttr(), time, scene)
        if kind != UsdGeom.Tokens.face:
            if applies_binding(subset.GetPrim()):
                scene.note(
                    where, f"is a subset of the type '{kind}', left out: only faces wear a fabric"
                )
            continue
        own = materials.of(subset.GetPrim())
        if own is None:
            continue
        named = array_of(subset.GetIndicesAttr(), time, scene, np.int64)
        chosen = named[(named >= 0) & (named < faces)]
        if len(chosen) < len(named):
            scene.note(where, f"names {len(named) - len(chosen)} faces that do not exist, left out")
        if (which[chosen] > 0).any():
            taken = int((which[chosen] > 0).sum())
            scene.note(where, f"takes {taken} faces from another subset; the last one has them")
        which[chosen] = len(resolved)
        resolved.append(own)
    first = resolved[0] or (materials.fallback(prim) if (which == 0).any() else resolved[-1])
    return [first, *(r for r in resolved[1:] if r is not None)], which  # type: ignore[list-item]


def _uv(
    prim: Usd.Prim,
    resolved: list[Resolved],
    which: NDArray[np.int64],
    cut: Tessellation,
    time: Usd.TimeCode,
    where: str,
    scene: Scene,
) -> tuple[NDArray[np.float64] | None, NDArray[np.bool_]]:
    """(m, 3, 2) UVs, and (m,) bool: which triangles wear a fabric and have no UVs.

    Each triangle's UVs are those of the set that its surface names.
    """
    uv = np.zeros((len(cut.faces), 3, 2))
    missing = np.zeros(len(cut.faces), bool)
    known: dict[str, NDArray[np.float64] | None] = {}
    for k, surface in enumerate(resolved):
        mine = which == k
        if not mine.any():
            continue
        primvar = _uv_primvar(prim, surface, where, scene)
        name = primvar.GetName() if primvar else ""
        if name not in known:
            known[name] = _at_corners(primvar, cut, time, 2, scene) if primvar else None
        values = known[name]
        if primvar and values is None:
            scene.note(
                where, f"has a UV set '{primvar.GetPrimvarName()}' that does not fit its faces"
            )
        if values is None:
            missing |= mine & surface.is_fabric
            if surface.is_textured:
                scene.note(where, "has no UVs for its textures; they are read at (0, 0)")
            continue
        broken = ~np.isfinite(values[mine])
        if broken.any():
            count = int(broken.any(axis=(1, 2)).sum())
            scene.note(where, f"has UVs that are not finite on {count} triangles; they count as 0")
        if mine.all():
            uv = values
        else:
            uv[mine] = values[mine]
    return (uv if any(v is not None for v in known.values()) else None), missing


def _uv_primvar(
    prim: Usd.Prim, surface: Resolved, where: str, scene: Scene
) -> UsdGeom.Primvar | None:
    """The UV set that the surface names; where there is none, the first UV set, with a note."""
    api = UsdGeom.PrimvarsAPI(prim)
    name = surface.uv_set or "st"
    primvar = api.GetPrimvar(name)
    if primvar and primvar.HasValue():
        return primvar
    for other in api.GetPrimvarsWithValues():
        if other.GetTypeName() in _OF_UVS:
            if surface.uv_set:
                scene.note(
                    where, f"has no UV set '{name}'; '{other.GetPrimvarName()}' is taken instead"
                )
            return other
    return None


def _at_corners(
    primvar: Any, cut: Tessellation, time: Usd.TimeCode, width: int, scene: Scene
) -> NDArray[np.float64] | None:
    """(m, 3, width) values of a primvar at the triangles' corners; None where its type or its
    length does not fit."""
    values = value_of(primvar.GetAttr(), time, scene)
    try:
        array = np.array([] if values is None else values, np.float64)
    except (TypeError, ValueError):
        return None
    if array.ndim != 2 or array.shape[1] < width:
        return None
    indices = None
    if primvar.IsIndexed():
        indices = array_of(primvar.GetIndicesAttr(), time, scene, np.int64)
    return cut.spread(array[:, :width], str(primvar.GetInterpolation()), indices)


def _authored_normals(
    placed: Placed, mesh: UsdGeom.Mesh, cut: Tessellation, time: Usd.TimeCode, scene: Scene
) -> NDArray[np.float64] | None:
    """(m, 3, 3) authored normals, posed as the mesh is, or None. The primvar `normals` takes
    precedence over the attribute."""
    prim, pose = placed.prim, placed.pose
    where = str(prim.GetPath())
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("normals")
    if primvar and primvar.HasValue():
        values = _at_corners(primvar, cut, time, 3, scene)
    else:
        authored = array_of(mesh.GetNormalsAttr(), time, scene, width=3)
        if not len(authored):
            return None
        values = cut.spread(authored, str(mesh.GetNormalsInterpolation()))
    if values is None:
        scene.note(where, "has normals that do not fit its faces; it is smoothed")
        return None
    posed = values if pose is None else pose.normals(values, cut.triangles)
    if posed is None:
        scene.note(where, "has normals that its blend shapes do not move; it is smoothed")
    return posed
