"""Write the baked mesh as a USD layer, with the UVs of the textures, normals and tangents."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, Vt

from fabricusd.bake.layout.equal_rows import numbered_rows
from fabricusd.bake.layout.garment import Garment
from fabricusd.bake.layout.tangents import corner_tangents
from fabricusd.schema import export
from fabricusd.schema.names import prim_name


def write_mesh_layer(path: str | os.PathLike[str], garment: Garment, up_axis: str) -> None:
    """Write `garment` as prim `/<name>`, in metres.

    It has the indexed faceVarying primvars `st`, `normals` and `tangents` (float4). Tangents follow
    MikkTSpace's convention; the fourth number is the sign of the bitangent.
    """
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, up_axis)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    mesh = UsdGeom.Mesh.Define(stage, f"/{prim_name(garment.name)}")
    stage.SetDefaultPrim(mesh.GetPrim())
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(garment.points.astype(np.float32)))
    count = len(garment.triangles)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(count, 3, np.int32)))
    indices = np.ascontiguousarray(garment.triangles, np.int32).ravel()
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(indices))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
    primvars = UsdGeom.PrimvarsAPI(mesh)
    types = Sdf.ValueTypeNames
    _primvar(primvars, "st", types.TexCoord2fArray, Vt.Vec2fArray, garment.uv)
    _primvar(primvars, "normals", types.Normal3fArray, Vt.Vec3fArray, garment.normals)
    _primvar(primvars, "tangents", types.Float4Array, Vt.Vec4fArray, corner_tangents(garment))
    for k, lay in enumerate(garment.lays if len(garment.lays) > 1 else ()):
        faces = Vt.IntArray.FromNumpy(np.flatnonzero(garment.lay == k).astype(np.int32))
        UsdGeom.Subset.CreateGeomSubset(
            mesh, f"lay_{k}", UsdGeom.Tokens.face, faces, "materialBind", "partition"
        ).GetPrim().SetDocumentation(lay.fabric.name)
    export(layer, path)


def _primvar(primvars: Any, name: str, kind: Any, array: Any, corners: NDArray[Any]) -> None:
    """Write an indexed faceVarying primvar with values (m, 3, c) at the corners."""
    flat = np.ascontiguousarray(corners.reshape(-1, corners.shape[-1]), np.float32)
    first, number = numbered_rows(flat.T)
    one = primvars.CreatePrimvar(name, kind, UsdGeom.Tokens.faceVarying)
    one.Set(array.FromNumpy(flat[first]))
    one.SetIndices(Vt.IntArray.FromNumpy(number))
