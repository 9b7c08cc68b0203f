"""The studio as USD prims: what `fabricusd.scene.studio` describes."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.scene import Camera
from fabricusd.scene.studio import (
    GREY,
    ROUGHNESS,
    Subject,
    backdrop,
    studio_camera,
    studio_lights,
)


def define_studio(stage: Usd.Stage, root: Sdf.Path, subject: Subject) -> None:
    """Define backdrop, lights and camera below `root`; the stage is in metres."""
    # Blender takes what lies below a prim without a type off its parent, and does not turn it z up.
    UsdGeom.Xform.Define(stage, root)
    UsdGeom.Xform.Define(stage, root.AppendChild("Lights"))
    UsdGeom.Scope.Define(stage, root.AppendChild("Looks"))
    _backdrop(stage, root, subject)
    for light in studio_lights(subject):
        name = light.path.removeprefix("studio ").title().replace(" ", "")
        path = root.AppendPath(f"Lights/{name}")
        if light.kind == DOME:
            prim: Any = UsdLux.DomeLight.Define(stage, path)
        else:
            prim = UsdLux.RectLight.Define(stage, path)
            prim.CreateWidthAttr(light.width)
            prim.CreateHeightAttr(light.height)
            prim.AddTransformOp().Set(_matrix(light.frame))
        # The brightest channel is the intensity, so that the colour is at most 1.
        brightest = max(light.radiance)
        prim.CreateIntensityAttr(brightest)
        prim.CreateColorAttr(Gf.Vec3f(*(channel / brightest for channel in light.radiance)))
    define_camera(stage, root.AppendChild("Camera"), studio_camera(subject))


def define_camera(stage: Usd.Stage, path: Sdf.Path, camera: Camera) -> None:
    """Define a camera; the stage is in metres."""
    prim = UsdGeom.Camera.Define(stage, path)
    # USD measures lengths on the film in tenths of a scene unit.
    prim.CreateFocalLengthAttr(camera.focal_length * 10)
    prim.CreateHorizontalApertureAttr(camera.aperture[0] * 10)
    prim.CreateVerticalApertureAttr(camera.aperture[1] * 10)
    prim.CreateFocusDistanceAttr(camera.focus_distance)
    near, far = camera.focus_distance * 0.01, camera.focus_distance * 100
    prim.CreateClippingRangeAttr(Gf.Vec2f(near, far))
    prim.AddTransformOp().Set(_matrix(camera.frame))


def _backdrop(stage: Usd.Stage, root: Sdf.Path, subject: Subject) -> None:
    points, quads = backdrop(subject)
    mesh = UsdGeom.Mesh.Define(stage, root.AppendChild("Backdrop"))
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray([4] * len(quads)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(quads.ravel())))
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
    material = UsdShade.Material.Define(stage, root.AppendPath("Looks/Backdrop"))
    shader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("Surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*GREY))
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(ROUGHNESS)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def _matrix(frame: Any) -> Gf.Matrix4d:
    """A frame, whose columns are axes and place, as USD writes it: in rows."""
    return Gf.Matrix4d(*np.asarray(frame, np.float64).T.ravel().tolist())
