"""A UsdGeomMesh as triangles: n-gons, subsets, orientation, normals, UVs of every interpolation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from fabricusd.reference.polygons import triangulate
from fabricusd.reference.scene import Mesh, Scene
from fabricusd.reference.usd_material import Materials, Resolved

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
    scheme = str(mesh.GetSubdivisionSchemeAttr().Get(time) or "none")
    if scheme != "none":
        scene.note(where, f"is a subdivision surface ({scheme}), rendered at its cage")
    if (counts < 3).any():
        scene.note(where, f"has {int((counts < 3).sum())} faces below three corners, left out")
    faces, corners = triangulate(points, counts, indices)
    holes = np.array(mesh.GetHoleIndicesAttr().Get(time) or [], np.int64)
    if len(holes):
        kept = ~np.isin(faces, holes)
        faces, corners = faces[kept], corners[kept]
    left_handed = mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded
    if left_handed != (np.linalg.det(matrix[:3, :3]) < 0):
        corners = corners[:, ::-1]
    resolved, which = _materials(prim, mesh, materials, len(counts), time, scene)
    uv, missing = _uv(prim, resolved, which[faces], faces, corners, indices, time, where, scene)
    numbers = np.array([r.index for r in resolved], np.int32)[which[faces]]
    if missing.any():
        scene.note(where, "has no UVs for its fabric; it is rendered grey")
        numbers = np.where(missing, materials.without_uv().index, numbers)
    normals = _normals(prim, mesh, faces, corners, indices, time, matrix, scene)
    world = (points @ matrix[:3, :3].T + matrix[:3, 3]) * metres
    far = np.isfinite(world).all(axis=1) & (np.abs(world) > _FARTHEST).any(axis=1)
    if far.any():
        scene.note(where, f"has {int(far.sum())} points beyond {_FARTHEST:g} m, which do not count")
        world[far] = np.nan
    return Mesh(
        path=where,
        points=world,
        triangles=indices[corners],
        normals=normals,
        uv=uv,
        material=numbers,
    )


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
    faces: NDArray[np.int64],
    corners: NDArray[np.int64],
    indices: NDArray[np.int64],
    time: Usd.TimeCode,
    where: str,
    scene: Scene,
) -> tuple[NDArray[np.float64] | None, NDArray[np.bool_]]:
    """(m, 3, 2) UVs, each triangle's from the set that its surface names, and which fabrics
    have none."""
    uv = np.zeros((len(faces), 3, 2))
    missing = np.zeros(len(faces), bool)
    found = False
    for k, surface in enumerate(resolved):
        mine = which == k
        if not mine.any():
            continue
        primvar = _uv_primvar(prim, surface, where, scene)
        values = _at_corners(primvar, faces, corners, indices, time, 2) if primvar else None
        if primvar and values is None:
            scene.note(
                where, f"has a UV set '{primvar.GetPrimvarName()}' that does not fit its faces"
            )
        if values is None:
            missing |= mine & surface.is_fabric
            if surface.is_textured:
                scene.note(where, "has no UVs for its textures; they are read at (0, 0)")
            continue
        found = True
        broken = ~np.isfinite(values[mine])
        if broken.any():
            count = int(broken.any(axis=(1, 2)).sum())
            scene.note(where, f"has UVs that are not finite on {count} triangles; they count as 0")
        uv[mine] = values[mine]
    return (uv if found else None), missing


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
    primvar: Any,
    faces: NDArray[np.int64],
    corners: NDArray[np.int64],
    indices: NDArray[np.int64],
    time: Usd.TimeCode,
    width: int,
) -> NDArray[np.float64] | None:
    """(m, 3, width) values of a primvar at the triangles' corners; None where its type or its
    length are others."""
    values = primvar.ComputeFlattened(time)
    try:
        array = np.array([] if values is None else values, np.float64)
    except (TypeError, ValueError):
        return None
    if array.ndim != 2 or array.shape[1] < width:
        return None
    return _spread(array[:, :width], primvar.GetInterpolation(), faces, corners, indices)


def _spread(
    array: NDArray[np.float64], interpolation: str, faces: Any, corners: Any, indices: Any
) -> NDArray[np.float64] | None:
    if interpolation == UsdGeom.Tokens.faceVarying:
        pick = corners
    elif interpolation in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying):
        pick = indices[corners]
    elif interpolation == UsdGeom.Tokens.uniform:
        pick = np.repeat(faces[:, None], 3, axis=1)
    else:
        pick = np.zeros_like(corners)
    if pick.size and int(pick.max()) >= len(array):
        return None
    return np.asarray(array[pick])


def _normals(
    prim: Usd.Prim,
    mesh: UsdGeom.Mesh,
    faces: NDArray[np.int64],
    corners: NDArray[np.int64],
    indices: NDArray[np.int64],
    time: Usd.TimeCode,
    matrix: NDArray[np.float64],
    scene: Scene,
) -> NDArray[np.float64] | None:
    """(m, 3, 3) authored normals in world space, or None; the primvar wins over the attribute."""
    values = None
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("normals")
    authored = mesh.GetNormalsAttr().Get(time)
    if primvar and primvar.HasValue():
        values = _at_corners(primvar, faces, corners, indices, time, 3)
    elif authored is not None and len(authored):
        values = _spread(
            np.array(authored, np.float64), mesh.GetNormalsInterpolation(), faces, corners, indices
        )
    else:
        return None
    if values is None:
        scene.note(str(prim.GetPath()), "has normals that do not fit its faces; it is smoothed")
        return None
    # Normals turn by the inverse transpose; rows here are normals.
    return np.asarray(values @ np.linalg.pinv(matrix[:3, :3]))
