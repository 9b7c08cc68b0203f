"""The dome light of a stage as Blender's world."""

from __future__ import annotations

from typing import Any

import bpy
from mathutils import Matrix

from .images import Images
from .nodes import Nodes

LATLONG = ("automatic", "latlong")

ABSENT = ("CylinderLight", "GeometryLight", "PortalLight", "PluginLight")
"""Lights that Blender's importer does not bring."""

TO_PICTURE = Matrix(((0, 0, 1), (1, 0, 0), (0, 1, 0)))
"""From a dome's axes to those of Blender's environment texture, whose pole is +z. The middle of
the picture is +z in USD, and -x in the texture."""


def bring_dome(stage: Any, scene: Any) -> tuple[bool, list[str]]:
    """Make the stage's first dome the scene's world; return whether, and what was left out."""
    from pxr import UsdGeom

    left_out, domes = [], []
    for prim in stage.Traverse():
        kind = str(prim.GetTypeName())
        if kind in ABSENT:
            left_out.append(f"{prim.GetPath()}, as Blender has no {kind}")
        is_seen = UsdGeom.Imageable(prim).ComputeVisibility() != UsdGeom.Tokens.invisible
        if kind in ("DomeLight", "DomeLight_1") and is_seen:
            domes.append(prim)
    if domes:
        scene.world = _world(stage, domes[0], left_out)
        left_out += [f"{one.GetPath()}, a second dome" for one in domes[1:]]
    return bool(domes), left_out


def _world(stage: Any, prim: Any, left_out: list[str]) -> Any:
    from pxr import UsdLux

    light = UsdLux.LightAPI(prim)
    world = bpy.data.worlds.new(prim.GetName())
    if world.node_tree is None:
        world.use_nodes = True
    nodes = Nodes(world.node_tree)
    nodes.tree.nodes.clear()
    color = tuple(light.GetColorAttr().Get())
    if light.GetEnableColorTemperatureAttr().Get():
        left_out.append(f"the colour temperature of {prim.GetPath()}")
    file = _picture(prim, left_out)
    if file is not None:
        turn = _rotation(stage, prim, left_out)
        coordinates = nodes.add("ShaderNodeTexCoord")
        turned = nodes.add(
            "ShaderNodeMapping", Vector=coordinates.outputs["Generated"],
            Rotation=turn.to_euler("XYZ"),
        )  # fmt: skip
        texture = nodes.add("ShaderNodeTexEnvironment", Vector=turned.outputs[0])
        texture.image = file
        color = nodes.vector("MULTIPLY", texture.outputs["Color"], color)
    strength = light.GetIntensityAttr().Get() * 2.0 ** light.GetExposureAttr().Get()
    background = nodes.add("ShaderNodeBackground", Color=color, Strength=strength)
    nodes.add("ShaderNodeOutputWorld", Surface=background.outputs[0])
    nodes.arrange()
    return world


def _picture(prim: Any, left_out: list[str]) -> Any:
    """Return the dome's image; None for a dome of one colour."""
    asset = prim.GetAttribute("inputs:texture:file").Get()
    if asset is None or not asset.path:
        return None
    layout = prim.GetAttribute("inputs:texture:format").Get() or "automatic"
    if layout not in LATLONG:
        left_out.append(f"the picture of {prim.GetPath()}, as its layout is '{layout}'")
        return None
    path = str(asset.resolvedPath or asset.path)
    image = Images()(path, data=False)
    if image is None:
        left_out.append(f"the picture of {prim.GetPath()}, as {path} cannot be read")
    elif not image.is_float:
        image.colorspace_settings.name = "sRGB"
    return image


def _rotation(stage: Any, prim: Any, left_out: list[str]) -> Any:
    """Return the rotation from Blender's world to the environment texture (3x3)."""
    from pxr import Gf, UsdGeom

    up_axis = str(UsdGeom.GetStageUpAxis(stage))
    matrix = UsdGeom.XformCache().GetLocalToWorldTransform(prim).RemoveScaleShear()
    if matrix.GetDeterminant() < 0:
        left_out.append(f"the mirroring of {prim.GetPath()}")
        matrix = Gf.Matrix4d(1.0)
    # USD's matrices apply to row vectors: this one applies to columns from the world to the dome.
    to_dome = Matrix([[matrix[r][c] for c in range(3)] for r in range(3)])
    pole = prim.GetAttribute("poleAxis")
    pole = pole.Get() if pole else None
    if (up_axis if pole == "scene" else pole) == "Z":
        to_dome = Matrix(((1, 0, 0), (0, 0, 1), (0, -1, 0))) @ to_dome
    to_usd = Matrix.Rotation(-1.5707963267948966, 3, "X") if up_axis == "Y" else Matrix.Identity(3)
    return TO_PICTURE @ to_dome @ to_usd
