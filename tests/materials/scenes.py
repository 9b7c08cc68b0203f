"""A small garment as USD, and a bake of it."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf, Usd, UsdGeom, UsdShade

from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.fabric import Binding
from fabricusd.schema import load, write_binding, write_fabric

MAPS = ("base_color", "roughness_along", "roughness_across", "normal", "tangent", "opacity", "lay")


def write_shirt(path: Path, *, width: float = 0.99) -> Path:
    """`/Shirt/Body`: three faces beside each other in UV; the first wears linen, the second velvet,
    the third is a button with a material of its own. The mesh has an old material as well.

    width : of the layout in UV; beyond 1 it needs UDIM tiles
    """
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/Shirt").GetPrim())
    mesh = UsdGeom.Mesh.Define(stage, "/Shirt/Body")
    mesh.CreatePointsAttr([(x, y, 0.0) for y in (0.0, 1.0) for x in (0.0, 1.0, 2.0, 3.0)])
    mesh.CreateFaceVertexCountsAttr([4, 4, 4])
    corners = [k for x in range(3) for k in (x, x + 1, x + 5, x + 4)]
    mesh.CreateFaceVertexIndicesAttr(corners)
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateExtentAttr([(0, 0, 0), (3, 1, 0)])
    step = width / 3
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    st.Set([(x * step, y * 0.9) for y in (0, 1) for x in range(4)])
    st.SetIndices(corners)
    for number, (name, preset) in enumerate((("Linen", "linen_plain"), ("Pile", "velvet"))):
        subset = _subset(mesh, name, number)
        where = f"/Shirt/Fabrics/{preset}"
        write_fabric(stage, where, load(preset))
        binding = Binding(fabric=load(preset), threads_per_uv=(24.0, 24.0))
        write_binding(subset.GetPrim(), where, binding)
    # Neither UVs nor a material: nothing that a look has to do with.
    hanger = UsdGeom.Mesh.Define(stage, "/Shirt/Hanger")
    hanger.CreatePointsAttr([(0, 2, 0), (1, 2, 0), (0, 3, 0)])
    hanger.CreateFaceVertexCountsAttr([3])
    hanger.CreateFaceVertexIndicesAttr([0, 1, 2])
    hanger.CreateExtentAttr([(0, 2, 0), (1, 3, 0)])
    old = _material(stage, "/Shirt/Looks/Old")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(old)
    button = _subset(mesh, "Button", 2).GetPrim()
    UsdShade.MaterialBindingAPI.Apply(button).Bind(_material(stage, "/Shirt/Looks/Button"))
    stage.GetRootLayer().Save()
    return path


def _subset(mesh: UsdGeom.Mesh, name: str, face: int) -> UsdGeom.Subset:
    return UsdGeom.Subset.CreateGeomSubset(
        mesh, name, UsdGeom.Tokens.face, [face], "materialBind", "nonOverlapping"
    )


def _material(stage: Usd.Stage, path: str) -> UsdShade.Material:
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return material


def bake_shirt(folder: Path, *, udim: bool = False) -> tuple[Path, Path]:
    """The scene and its bake."""
    scene = write_shirt(folder / "shirt.usda", width=1.8 if udim else 0.99)
    bake(scene, folder / "baked", Settings(resolution=64, maps=MAPS, udim=udim), workers=1)
    return scene, folder / "baked"
