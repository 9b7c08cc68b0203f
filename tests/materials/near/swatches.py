"""Flat squares of cloth, and their bakes."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf, Usd, UsdGeom

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.fabric import Binding, Fabric
from fabricusd.materials.bake_folder import MapSet, read_bake_folder
from fabricusd.materials.near.maps import NEEDED
from fabricusd.schema import write_binding, write_fabric

MAPS = (*NEEDED, "weft_thread", "warp_thread", "lay", "opacity")


def write_square(path: Path, fabric: Fabric, threads: float, width: float = 1.0) -> Path:
    """A square whose UVs span `width` of the texture, with `threads` along the whole of it."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    mesh = UsdGeom.Mesh.Define(stage, "/World/Cloth")
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    mesh.CreatePointsAttr([(x, y, 0) for x, y in corners])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateExtentAttr([(0, 0, 0), (1, 1, 0)])
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    )
    st.Set([(width * x, width * y) for x, y in corners])
    write_fabric(stage, "/World/Fabric", fabric)
    laid = Binding(fabric=fabric, threads_per_uv=(threads, threads))
    write_binding(mesh.GetPrim(), "/World/Fabric", laid)
    stage.GetRootLayer().Save()
    return path


def bake_square(
    folder: Path, fabric: Fabric, *, threads: float, resolution: int, width: float = 1.0
) -> MapSet:
    """The maps of a square's bake."""
    scene = write_square(folder / "square.usda", fabric, threads, width)
    bake(scene, folder / "baked", Settings(resolution=resolution, maps=MAPS), workers=1)
    return read_bake_folder(folder / "baked").garments[0]
