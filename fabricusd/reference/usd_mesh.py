"""A UsdGeomMesh as triangles: n-gons, subsets, orientation, normals, UVs of every interpolation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from fabricusd.errors import FabricError
from fabricusd.reference.fineness import Fineness
from fabricusd.reference.limit_grid import triangles_at
from fabricusd.reference.scene import Mesh, Scene
from fabricusd.reference.tessellation import (
    CageTessellation,
    RefinedTessellation,
    Refinement,
    Tessellation,
)
from fabricusd.reference.usd_material import Materials, Resolved
from fabricusd.reference.usd_subdivision import read_refinement

MOST_TRIANGLES = 4_000_000
"""Triangles that a scene's surfaces are refined to, together: some 3 GB with all that is done."""

_OF_UVS = (
    Sdf.ValueTypeNames.TexCoord2fArray,
    Sdf.ValueTypeNames.TexCoord2dArray,
    Sdf.ValueTypeNames.TexCoord2hArray,
    Sdf.ValueTypeNames.Float2Array,
)
"""Types of primvars that are taken for UVs whatever their name."""

_FARTHEST = 1e9
"""Metres from the origin: beyond it squares of areas leave the range of 32-bit numbers."""


def read_mesh(
    prim: Usd.Prim,
    time: Usd.TimeCode,
    matrix: NDArray[np.float64],
    metres: float,
    materials: Materials,
    scene: Scene,
    fineness: Fineness,
) -> Mesh | None:
    """The mesh in world space and metres, or None with a note where it has no usable faces.

    matrix : (4, 4) local to world, in scene units of `metres`
    """
    where = str(prim.GetPath())
    mesh = UsdGeom.Mesh(prim)
    points = np.array(mesh.GetPointsAttr().Get(time) or [], np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or [], np.int64)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or [], np.int64)
    problem = _problem(points, counts, indices)
    if problem:
        scene.note(where, f"{problem}, left out")
        return None
    if (counts < 3).any():
        scene.note(where, f"has {int((counts < 3).sum())} faces below three corners, left out")
    points = _near(points, matrix, metres, where, scene)
    mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
    scheme = _scheme(mesh, time)
    level = None
    if scheme not in ("none", "bilinear"):
        world = (points @ matrix[:3, :3].T + matrix[:3, 3]) * metres
        level = fineness.level(world, counts, indices)
        if scheme == "catmullClark" and fineness.is_auto and not level:
            # Its cage is as good.
            level = None
    cut = _tessellate(mesh, time, points, counts, indices, scene, level, mirrored=mirrored)
    resolved, which = _materials(prim, mesh, materials, len(counts), time, scene)
    uv, missing = _uv(prim, resolved, which[cut.faces], cut, time, where, scene)
    numbers = np.array([r.index for r in resolved], np.int32)[which[cut.faces]]
    if missing.any():
        scene.note(where, "has no UVs for its fabric; it is rendered grey")
        numbers = np.where(missing, materials.without_uv().index, numbers)
    normals = _authored_normals(prim, mesh, cut, time, scene) if scheme == "none" else cut.normals
    if normals is not None:
        # Normals turn by the inverse transpose; rows here are normals.
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
    """The points, NaN where they lie beyond what can be traced, which is noted."""
    world = (points @ matrix[:3, :3].T + matrix[:3, 3]) * metres
    beyond = (np.abs(world) > _FARTHEST).any(axis=1)
    far = np.asarray(np.isfinite(world).all(axis=1) & beyond)
    if not far.any():
        return points
    scene.note(where, f"has {int(far.sum())} points beyond {_FARTHEST:g} m, which do not count")
    return np.where(far[:, None], np.nan, points)


def _scheme(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> str:
    return str(mesh.GetSubdivisionSchemeAttr().Get(time) or "none")


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
    """The faces as triangles, refined where a level is given and they are a surface that can be."""
    left_handed = mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded
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
    """`level`, or with a note a lower one for which there is memory."""
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
    """(f,) which faces are holes."""
    hidden = np.zeros(count, bool)
    holes = np.array(mesh.GetHoleIndicesAttr().Get(time) or [], np.int64)
    known = (holes >= 0) & (holes < count)
    if not known.all():
        bad = holes[np.argmin(known)]
        scene.note(
            str(mesh.GetPath()), f"holeIndices has {bad}; it must be from 0 to {count - 1}; ignored"
        )
    hidden[holes[known]] = True
    return hidden


def _problem(points: Any, counts: Any, indices: Any) -> str:
    """Why faces cannot be made of these arrays, or an empty string."""
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
    """The mesh's surfaces, and which of them each face has."""
    resolved = [materials.of(prim)]
    which = np.zeros(faces, np.int64)
    for subset in UsdGeom.Subset.GetAllGeomSubsets(mesh):
        own = materials.of(subset.GetPrim())
        if own is None or subset.GetElementTypeAttr().Get() != UsdGeom.Tokens.face:
            continue
        named = np.array(subset.GetIndicesAttr().Get(time) or [], np.int64)
        chosen = named[(named >= 0) & (named < faces)]
        where = str(subset.GetPath())
        if len(chosen) < len(named):
            scene.note(where, f"names {len(named) - len(chosen)} faces that are none, left out")
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
    """(m, 3, 2) UVs, each triangle's from the set that its surface names, and which fabrics
    have none."""
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
            known[name] = _at_corners(primvar, cut, time, 2) if primvar else None
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
    """The UV set by name; where that is missing, the first set there is, with a note."""
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
    primvar: Any, cut: Tessellation, time: Usd.TimeCode, width: int
) -> NDArray[np.float64] | None:
    """(m, 3, width) values of a primvar at the triangles' corners; None where its type or its
    length are others."""
    values = primvar.Get(time)
    try:
        array = np.array([] if values is None else values, np.float64)
    except (TypeError, ValueError):
        return None
    if array.ndim != 2 or array.shape[1] < width:
        return None
    indices = np.array(primvar.GetIndices(time), np.int64) if primvar.IsIndexed() else None
    return cut.spread(array[:, :width], str(primvar.GetInterpolation()), indices)


def _authored_normals(
    prim: Usd.Prim, mesh: UsdGeom.Mesh, cut: Tessellation, time: Usd.TimeCode, scene: Scene
) -> NDArray[np.float64] | None:
    """(m, 3, 3) normals of the file, or None; the primvar wins over the attribute."""
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("normals")
    authored = mesh.GetNormalsAttr().Get(time)
    if primvar and primvar.HasValue():
        values = _at_corners(primvar, cut, time, 3)
    elif authored is not None and len(authored):
        values = cut.spread(np.array(authored, np.float64), str(mesh.GetNormalsInterpolation()))
    else:
        return None
    if values is None:
        scene.note(str(prim.GetPath()), "has normals that do not fit its faces; it is smoothed")
    return values
