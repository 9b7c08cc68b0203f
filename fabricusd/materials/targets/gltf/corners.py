"""The triangles of a garment as glTF has them: corners with normal, tangent and UV, then vertices.

A vertex is a corner that all its triangles agree on. Where UVs are mirrored, the sign of the
bitangent differs, so that such a seam is always split.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from fabricusd.bake.layout.equal_rows import numbered_rows
from fabricusd.bake.layout.garment import Garment, fitted
from fabricusd.bake.layout.tangents import corner_tangents
from fabricusd.errors import FabricError
from fabricusd.materials.bake_folder import MapSet

Floats = NDArray[np.float32]

FIRST_TILE = 1001


@dataclass(frozen=True, kw_only=True, eq=False)
class Corners:
    """The corners of m triangles, in USD's conventions: UVs from the lower left.

    points : (m, 3, 3) [m]; normals : (m, 3, 3); tangents : (m, 3, 4), unit, with the bitangent's
        sign; uv : (m, 3, 2)
    lay : (m,) int - number of each triangle's fabric
    """

    points: Floats
    normals: Floats
    tangents: Floats
    uv: Floats
    lay: NDArray[np.int32]


@dataclass(frozen=True, kw_only=True, eq=False)
class Vertices:
    """n vertices and their triangles, as glTF has them: y is up, UVs count from the upper left.

    position : (n, 3) [m]; normal : (n, 3); tangent : (n, 4); uv : (n, 2); triangles : (m, 3) uint32
    """

    position: Floats
    normal: Floats
    tangent: Floats
    uv: Floats
    triangles: NDArray[np.uint32]


def placed_corners(garment: Garment, maps: MapSet) -> Corners:
    """The corners of a garment of the scene, in the UVs of its textures."""
    laid = garment if maps.own_uv else fitted(garment)
    names = [lay.name for lay in maps.lays]
    found = [
        names.index(one.fabric.name) if one.fabric.name in names else min(k, len(names) - 1)
        for k, one in enumerate(laid.lays)
    ]
    return Corners(
        points=laid.points[laid.triangles].astype(np.float32),
        normals=np.asarray(laid.normals, np.float32),
        tangents=corner_tangents(laid),
        uv=laid.uv.astype(np.float32),
        lay=np.array(found, np.int32)[laid.lay],
    )


def baked_corners(maps: MapSet) -> Corners:
    """The corners of the mesh that the bake wrote; FabricError if the mesh is missing."""
    if not maps.mesh.is_file():
        raise FabricError(
            str(maps.mesh), "is missing; bake again, or give the scene that was baked with --scene"
        )
    stage = Usd.Stage.Open(str(maps.mesh))
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    index = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(), np.int64).reshape(-1, 3)
    primvars = UsdGeom.PrimvarsAPI(mesh)

    def at_corners(name: str, width: int) -> Floats:
        flat = np.asarray(primvars.GetPrimvar(name).ComputeFlattened(), np.float32)
        return flat.reshape(-1, 3, width)

    lay = np.zeros(len(index), np.int32)
    for number, subset in enumerate(UsdGeom.Subset.GetAllGeomSubsets(mesh)):
        lay[np.asarray(subset.GetIndicesAttr().Get(), np.int64)] = number
    return Corners(
        points=np.asarray(mesh.GetPointsAttr().Get(), np.float32)[index],
        normals=at_corners("normals", 3),
        tangents=at_corners("tangents", 4),
        uv=at_corners("st", 2),
        lay=lay,
    )


def parts(corners: Corners, *, udim: bool) -> Iterator[tuple[int, int, Corners]]:
    """Yield (lay, UDIM number, triangles) for each fabric and tile; tiles are moved to the first.

    glTF has no tiles of textures, so each needs a material of its own.
    """
    middle = corners.uv.mean(axis=1)
    column, row = np.floor(middle).astype(np.int64).T if udim else np.zeros((2, len(middle)), int)
    tile = FIRST_TILE + column + 10 * row
    for lay, number in np.unique(np.stack((corners.lay, tile), axis=1), axis=0).tolist():
        mine = (corners.lay == lay) & (tile == number)
        low = np.array(((number - FIRST_TILE) % 10, (number - FIRST_TILE) // 10), np.float32)
        cut = {
            name: getattr(corners, name)[mine]
            for name in ("points", "normals", "tangents", "uv", "lay")
        }
        yield lay, number, replace(Corners(**cut), uv=cut["uv"] - low)


def vertices(corners: Corners, *, up_axis: str) -> Vertices:
    """Join equal corners, and convert them to glTF's axes and UVs.

    A normal map's green means the same in both: the bitangent points to where USD's v increases,
    which is where glTF's v decreases.
    """
    normals = _unit(corners.normals.reshape(-1, 3), corners)
    tangents = corners.tangents.reshape(-1, 4)
    along = _perpendicular(tangents[:, :3], normals)
    uv = corners.uv.reshape(-1, 2)
    rows = np.concatenate(
        (
            _y_up(corners.points.reshape(-1, 3), up_axis),
            _y_up(normals, up_axis), _y_up(along, up_axis),
            np.where(tangents[:, 3:] < 0, -1.0, 1.0),
            np.stack((uv[:, 0], 1.0 - uv[:, 1]), axis=1),
        ),
        axis=1,
    ).astype(np.float32)  # fmt: skip
    first, number = numbered_rows(rows.T)
    kept = rows[first]
    return Vertices(
        position=kept[:, :3], normal=kept[:, 3:6], tangent=kept[:, 6:10], uv=kept[:, 10:],
        triangles=number.reshape(-1, 3).astype(np.uint32),
    )  # fmt: skip


def _y_up(vectors: NDArray[np.floating], up_axis: str) -> NDArray[np.floating]:
    return vectors if up_axis == "Y" else vectors[:, (0, 2, 1)] * np.array((1.0, 1.0, -1.0))


def _unit(normals: Floats, corners: Corners) -> NDArray[np.float64]:
    """Unit normals, those of the triangle where a normal has no length."""
    edge = np.diff(corners.points.astype(np.float64), axis=1)
    face = np.repeat(np.cross(edge[:, 0], edge[:, 1]), 3, axis=0)
    length = np.linalg.norm(face, axis=1, keepdims=True)
    face = np.where(length > 0, face / np.maximum(length, 1e-300), (0.0, 0.0, 1.0))
    given = normals.astype(np.float64)
    length = np.linalg.norm(given, axis=1, keepdims=True)
    return np.where(length > 1e-6, given / np.maximum(length, 1e-6), face)


def _perpendicular(along: Floats, normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit tangents perpendicular to the normals; any direction where a tangent has no length."""
    flat = along - normals * np.sum(along * normals, axis=1, keepdims=True)
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    axis = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    other = np.cross(normals, axis)
    other /= np.linalg.norm(other, axis=1, keepdims=True)
    return np.where(length > 1e-6, flat / np.maximum(length, 1e-6), other)
