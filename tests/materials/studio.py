"""A garment as a studio lays it out: an asset of a payload and variants, placed as instances, bound
by a collection to a material that carries a fabric."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf, Usd, UsdGeom, UsdShade

from fabricusd.fabric import Binding
from fabricusd.materials.uniform import write_fabric_material
from fabricusd.schema import load, write_fabric

STRONG = UsdShade.Tokens.strongerThanDescendants


def _new(path: Path) -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    return stage


def write_geometry(path: Path) -> Path:
    """`/Coat` with the variant set `cut`: `/Coat/Body`, one face, or two in `long`."""
    stage = _new(path)
    root = UsdGeom.Xform.Define(stage, "/Coat").GetPrim()
    stage.SetDefaultPrim(root)
    cuts = root.GetVariantSets().AddVariantSet("cut")
    for name, faces in (("short", 1), ("long", 2)):
        cuts.AddVariant(name)
        cuts.SetVariantSelection(name)
        with cuts.GetVariantEditContext():
            body(stage, "/Coat/Body", faces)
    cuts.SetVariantSelection("short")
    stage.GetRootLayer().Save()
    return path


def body(stage: Usd.Stage, path: str, faces: int) -> UsdGeom.Mesh:
    """Faces of 1 m beside each other in a plane that stands upright, UVs in metres over 2."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    columns = range(faces + 1)
    mesh.CreatePointsAttr([(float(x), float(y), 0.0) for y in (0, 1) for x in columns])
    mesh.CreateExtentAttr([(0, 0, 0), (faces, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([4] * faces)
    turn = faces + 1
    corners = [k for x in range(faces) for k in (x, x + 1, x + turn + 1, x + turn)]
    mesh.CreateFaceVertexIndicesAttr(corners)
    mesh.CreateSubdivisionSchemeAttr("none")
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    )
    st.Set([(x / 2, y / 2) for y in (0, 1) for x in columns])
    return mesh


def write_asset(path: Path) -> Path:
    """`/Coat`, whose geometry comes by a payload, in the variant `long`."""
    write_geometry(path.with_name("coat_geometry.usda"))
    stage = _new(path)
    root = UsdGeom.Xform.Define(stage, "/Coat").GetPrim()
    stage.SetDefaultPrim(root)
    Usd.ModelAPI(root).SetKind("component")
    root.GetPayloads().AddPayload("./coat_geometry.usda")
    stage.GetRootLayer().Save()
    return path


def write_shot(path: Path, *, strong: bool = False, purpose: str = "") -> Path:
    """`/World/One` and `/World/Two`, instances of the asset cut long, in one collection of linen;
    a camera and a light."""
    write_asset(path.with_name("coat.usda"))
    stage = _new(path)
    world = UsdGeom.Xform.Define(stage, "/World").GetPrim()
    stage.SetDefaultPrim(world)
    Usd.ModelAPI(world).SetKind("assembly")
    for k, name in enumerate(("One", "Two")):
        one = UsdGeom.Xform.Define(stage, f"/World/{name}")
        one.AddTranslateOp().Set((2.5 * k, 0.0, 0.0))
        one.GetPrim().GetReferences().AddReference("./coat.usda")
        one.GetPrim().GetVariantSets().SetSelection("cut", "long")
        one.GetPrim().SetInstanceable(True)
    UsdGeom.Scope.Define(stage, "/World/Looks")
    linen = load("linen_plain")
    write_fabric(stage, "/World/Looks/linen_plain", linen)
    laid = Binding(fabric=linen, threads_per_uv=(24.0, 24.0))
    material = write_fabric_material(stage, "/World/Looks/Linen", "/World/Looks/linen_plain", laid)
    collection = Usd.CollectionAPI.Apply(world, "cloth")
    for name in ("One", "Two"):
        collection.IncludePath(f"/World/{name}")
    UsdShade.MaterialBindingAPI.Apply(world).Bind(
        collection, material, "cloth", STRONG if strong else UsdShade.Tokens.fallbackStrength,
        purpose or UsdShade.Tokens.allPurpose,
    )  # fmt: skip
    _see(stage)
    stage.GetRootLayer().Save()
    return path


def _see(stage: Usd.Stage) -> None:
    from pxr import UsdLux

    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.AddTranslateOp().Set((2.25, 0.5, 10.0))
    camera.CreateHorizontalApertureAttr(0.36)
    camera.CreateVerticalApertureAttr(0.36)
    camera.CreateFocalLengthAttr(0.7)
    camera.CreateClippingRangeAttr((0.1, 100.0))
    UsdLux.DomeLight.Define(stage, "/World/Light").CreateIntensityAttr(1.0)
