"""A UsdGeomMesh as triangles: n-gons, subsets, orientation, normals, UVs of every interpolation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from fabricusd.reference.polygons import triangulate
from fabricusd.reference.scene import Mesh, Scene
from fabricusd.reference.usd_material import Materials, Resolved


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
    faces, corners = triangulate(points, counts, indices)
    holes = np.array(mesh.GetHoleIndicesAttr().Get(time) or [], np.int64)
    if len(holes):
        kept = ~np.isin(faces, holes)
        faces, corners = faces[kept], corners[kept]
    left_handed = mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded
    if left_handed != (np.linalg.det(matrix[:3, :3]) < 0):
        corners = corners[:, ::-1]
    resolved, which = _materials(prim, mesh, materials, len(counts))
    uv, missing = _uv(prim, resolved, which[faces], faces, corners, indices, time, where, scene)
    numbers = np.array([r.index for r in resolved], np.int32)[which[faces]]
    if missing.any():
        scene.note(where, "has no UVs for its fabric; it is rendered grey")
        numbers = np.where(missing, materials.without_uv().index, numbers)
    normals = _normals(prim, mesh, faces, corners, indices, time, matrix)
    world = points @ matrix[:3, :3].T + matrix[:3, 3]
    return Mesh(
        path=where,
        points=world * metres,
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
    prim: Usd.Prim, mesh: UsdGeom.Mesh, materials: Materials, faces: int
) -> tuple[list[Resolved], NDArray[np.int64]]:
    """The mesh's surfaces, and which of them each face has."""
    resolved = [materials.of(prim)]
    which = np.zeros(faces, np.int64)
    for subset in UsdGeom.Subset.GetAllGeomSubsets(mesh):
        own = materials.of(subset.GetPrim())
        if own is None or subset.GetElementTypeAttr().Get() != UsdGeom.Tokens.face:
            continue
        chosen = np.array(subset.GetIndicesAttr().Get() or [], np.int64)
        which[chosen[(chosen >= 0) & (chosen < faces)]] = len(resolved)
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
        values = _at_corners(primvar, faces, corners, indices, time) if primvar else None
        if values is None:
            missing |= mine & surface.is_fabric
            continue
        found = True
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
        kind = other.GetTypeName()
        if kind in (Sdf.ValueTypeNames.TexCoord2fArray, Sdf.ValueTypeNames.Float2Array) or (
            kind == Sdf.ValueTypeNames.TexCoord2dArray
        ):
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
) -> NDArray[np.float64] | None:
    """(m, 3, c) values of a primvar at the triangles' corners; None where its length is wrong."""
    values = primvar.ComputeFlattened(time)
    if values is None or not len(values):
        return None
    return _spread(
        np.array(values, np.float64), primvar.GetInterpolation(), faces, corners, indices
    )


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
) -> NDArray[np.float64] | None:
    """(m, 3, 3) authored normals in world space, or None; the primvar wins over the attribute."""
    values = None
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("normals")
    if primvar and primvar.HasValue():
        values = _at_corners(primvar, faces, corners, indices, time)
    else:
        authored = mesh.GetNormalsAttr().Get(time)
        if authored is not None and len(authored):
            values = _spread(
                np.array(authored, np.float64), mesh.GetNormalsInterpolation(), faces, corners,
                indices,
            )  # fmt: skip
    if values is None:
        return None
    # Normals turn by the inverse transpose; rows here are normals.
    return np.asarray(values @ np.linalg.pinv(matrix[:3, :3]))
