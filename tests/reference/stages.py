"""Small stages, and what the path tracer makes of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import Scene
from fabricusd.schema import preset_names
from fabricusd.schema.source import PRESETS

# Importing the schema registers it, before a stage is made.
assert "linen_plain" in preset_names()
SQUARE = [(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)]


def new_stage(tmp_path: Path, metres: float = 1.0, up: str = "Y") -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(tmp_path / "scene.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    UsdGeom.SetStageUpAxis(stage, up)
    return stage


def square(stage: Usd.Stage, path: str = "/square", *, uv: bool = True) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(SQUARE)
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 3, 2, 1])
    mesh.CreateSubdivisionSchemeAttr("none")
    if uv:
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
        )
        primvar.Set([(0, 0), (1, 0), (1, 1), (0, 1)])
    return mesh


def bind_fabric(stage: Usd.Stage, prim: Usd.Prim, preset: str = "linen_plain") -> None:
    fabric = stage.DefinePrim("/Looks/Cloth")
    fabric.GetReferences().AddReference(str(PRESETS / f"{preset}.usda"))
    prim.ApplyAPI("WovenBindingAPI")
    prim.GetRelationship("fabric:binding").SetTargets([fabric.GetPath()])


def read(stage: Usd.Stage, **settings) -> Scene:
    stage.GetRootLayer().Save()
    return read_scene(stage.GetRootLayer().realPath, **settings)


def area(scene: Scene) -> float:
    total = 0.0
    for mesh in scene.meshes:
        p = mesh.points[mesh.triangles]
        total += 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()
    return float(total)


def up_share(scene: Scene) -> float:
    """Mean y of the triangles' normals."""
    normals = []
    for mesh in scene.meshes:
        p = mesh.points[mesh.triangles]
        n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        normals.append(n / np.linalg.norm(n, axis=1)[:, None])
    return float(np.concatenate(normals)[:, 1].mean())
