"""Unwrap a mesh without UVs or with overlapping UVs by xatlas, and restore the fabric's grain.

An unwrapper rotates each UV shell arbitrarily. The warp therefore follows a given world axis: each
shell gets its own lay, rotated so that the axis, projected onto the cloth, is V of the weave.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.layout.garment import (
    FLATTEST,
    Garment,
    Lay,
    check_shape,
    lay_of,
    signed_area,
    twice_areas,
)
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding
from fabricusd.scene.scene import FabricSurface, Mesh, Scene
from fabricusd.scene.surface.normals import measured_scale, smooth_normals

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def unwrapped(axis: str, binding: Binding | None, scene: Scene, mesh: Mesh) -> Garment | None:
    """Return a garment of `mesh` with UVs by xatlas and the warp along the world's `axis`.

    The fabric keeps its physical size: the new UVs have another unit, so a binding's threads per UV
    unit do not apply to them.

    binding : fabric of a mesh without UVs, to which the scene's reader gives a grey material

    Returns None if the mesh wears no fabric. Raises FabricError for an unknown axis and for a mesh
    that xatlas cannot unwrap.
    """
    if axis not in AXES:
        raise FabricError(
            f"--unwrap '{axis}'", f"is not an axis; it must be one of {', '.join(AXES)}"
        )
    fabrics = {
        k: surface.binding.fabric
        for k, surface in enumerate(scene.materials)
        if isinstance(surface, FabricSurface)
    }
    if mesh.uv is None and binding is not None:
        fabrics = {int(k): binding.fabric for k in np.unique(mesh.material)} | fabrics
    worn = np.isin(mesh.material, list(fabrics))
    if not worn.any():
        return None
    tri, material = np.asarray(mesh.triangles)[worn], np.asarray(mesh.material)[worn]
    check_shape(mesh.path, mesh.points, tri, np.zeros((len(tri), 3, 2)))
    uv = _xatlas(mesh, tri)
    keep = np.abs(signed_area(uv)) >= FLATTEST
    tri, material, uv = tri[keep], material[keep], uv[keep]
    corners = mesh.points[tri]
    metres = measured_scale(uv, twice_areas(corners))
    shells = _shells(uv)
    lays: list[Lay] = []
    lay = np.zeros(len(tri), np.int32)
    for shell in np.unique(shells):
        turn = _grain(corners[shells == shell], uv[shells == shell], np.array(AXES[axis]))
        for index in np.unique(material[shells == shell]):
            laid = Binding(fabric=fabrics[int(index)], metres_per_uv=metres, rotation=turn)
            lay[(shells == shell) & (material == index)] = len(lays)
            lays.append(lay_of(laid, metres))
    return Garment(
        name="",
        points=mesh.points,
        triangles=tri,
        normals=smooth_normals(mesh.points, tri),
        uv=uv,
        lays=tuple(lays),
        lay=lay,
        mirrored=signed_area(uv) < 0,
        copies=(mesh.path,),
        notes=(
            f"{mesh.path} is unwrapped into {len(np.unique(shells))} UV shells, warp along {axis}",
        ),
        own_uv=False,
    )


def _xatlas(mesh: Mesh, tri: NDArray[Any]) -> NDArray[np.float64]:
    """(m, 3, 2) UVs in the unit square, in the order of `tri`."""
    import xatlas

    try:
        _, faces, coordinates = xatlas.parametrize(
            np.ascontiguousarray(mesh.points, np.float32), np.ascontiguousarray(tri, np.uint32)
        )
    except Exception as error:
        raise FabricError(mesh.path, f"cannot be unwrapped: {error}") from error
    if len(faces) != len(tri):
        raise FabricError(
            mesh.path, f"cannot be unwrapped: xatlas returned {len(faces)} of {len(tri)} triangles"
        )
    return np.asarray(coordinates, np.float64)[np.asarray(faces, np.int64)]


def _shells(uv: NDArray[np.float64]) -> NDArray[np.int64]:
    """(m,) number of each triangle's connected UV shell."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    corner = np.unique(np.round(uv.reshape(-1, 2) * 1e7), axis=0, return_inverse=True)[1]
    corner = corner.reshape(-1, 3)
    a = np.concatenate((corner[:, 0], corner[:, 1]))
    c = np.concatenate((corner[:, 1], corner[:, 2]))
    n = int(corner.max()) + 1
    _, labels = connected_components(coo_array((np.ones(len(a)), (a, c)), shape=(n, n)))
    return np.asarray(labels[corner[:, 0]], np.int64)


def _grain(
    corners: NDArray[np.float64], uv: NDArray[np.float64], axis: NDArray[np.float64]
) -> float:
    """Return the rotation [rad] that aligns a shell's warp with `axis`, averaged by area."""
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    normal = np.cross(e1, e2)
    square = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-300)[:, None]
    # The rates at which u and v change along the axis give its direction in UV.
    along, up = np.cross(e2, normal) / square, np.cross(normal, e1) / square
    share = np.stack((along @ axis, up @ axis), axis=1)
    flat = share[:, :1] * d1 + share[:, 1:] * d2
    total = (flat * np.sqrt(square)).sum(axis=0)
    if not np.linalg.norm(total) > 1e-9 * np.sqrt(square).sum():
        return 0.0
    # V of the weave points along (-sin r, cos r).
    return float(np.arctan2(-total[0], total[1]))
