"""UsdPreviewSurface alone, with 8-bit PNG textures that hold what readers of the web ignore.

three.js and AR Quick Look read neither EXR nor half floats, and not all of them heed `scale` and
`bias`; so the scale is in the texture. Normals keep theirs, which the specification asks for.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdShade

from fabricusd.images.files import read_mip_level, write_png
from fabricusd.materials.targets.flat import remove_schemas
from fabricusd.srgb import srgb_encode


def simplify(layer: Sdf.Layer, folder: Path) -> None:
    """Leave of each material in `layer` what UsdPreviewSurface needs, with textures in `folder`."""
    stage = Usd.Stage.Open(layer)
    made: dict[tuple[str, tuple[float, ...]], str] = {}
    for prim in list(stage.Traverse()):
        if prim and prim.IsA(UsdShade.Material):
            _leave_preview(stage, UsdShade.Material(prim))
    for prim in stage.Traverse():
        shader = UsdShade.Shader(prim) if prim.IsA(UsdShade.Shader) else None
        if shader and shader.GetIdAttr().Get() == "UsdUVTexture":
            _as_png(shader, folder, made)


def _leave_preview(stage: Usd.Stage, material: UsdShade.Material) -> None:
    surface = material.ComputeSurfaceSource()[0]
    needed = {surface.GetPath()} if surface else set()
    waiting = [surface] if surface else []
    while waiting:
        for given in waiting.pop().GetInputs():
            for source in given.GetConnectedSources()[0]:
                if source.source.GetPath() not in needed:
                    needed.add(source.source.GetPath())
                    waiting.append(UsdShade.Shader(source.source.GetPrim()))
    prim = material.GetPrim()
    for child in prim.GetAllChildren():
        if child.GetPath() not in needed:
            stage.RemovePrim(child.GetPath())
    remove_schemas(prim, ("MaterialXConfigAPI",))
    for name in prim.GetAuthoredPropertyNames():
        if name.startswith(("config:mtlx", "inputs:", "outputs:mtlx")):
            prim.RemoveProperty(name)


def _as_png(
    texture: UsdShade.Shader, folder: Path, made: dict[tuple[str, tuple[float, ...]], str]
) -> None:
    """Write a texture's picture, or its tiles, as PNG, and name that instead."""
    given = texture.GetInput("file")
    asset = given.Get()
    path = asset.resolvedPath or asset.path
    is_normal = not _is_scale_alone(texture)
    scale = (1.0,) * 4 if is_normal else tuple(_four(texture, "scale", 1.0))
    is_color = texture.GetOutput("rgb") and not is_normal
    key = path, scale
    if key not in made:
        name = f"{len(made)}_{Path(path).stem}.png"
        tiles = [("", path)]
        if UsdShade.UdimUtils.IsUdimIdentifier(path):
            found = UsdShade.UdimUtils.ResolveUdimTilePaths(path, given.GetAttr().GetStage()
                                                            .GetRootLayer())  # fmt: skip
            tiles = [(number, file) for file, number in found]
        for number, file in tiles:
            pixels = read_mip_level(file)
            channels = pixels.shape[2]
            values = np.clip(pixels * np.array(scale[:channels], np.float32), 0.0, 1.0)
            codes = np.rint(255 * (srgb_encode(values) if is_color else values))
            write_png(
                folder / name.replace("<UDIM>", number),
                codes.astype(np.uint8), color_space="sRGB" if is_color else "raw",
            )  # fmt: skip
        made[key] = name
    given.Set(Sdf.AssetPath(str(folder / made[key])))
    given.GetAttr().SetColorSpace("srgb_rec709_scene" if is_color else "raw")
    texture.GetInput("sourceColorSpace").Set("sRGB" if is_color else "raw")
    if not is_normal:
        for name in ("inputs:scale", "inputs:bias"):
            texture.GetPrim().RemoveProperty(name)


def _is_scale_alone(texture: UsdShade.Shader) -> bool:
    return not any(_four(texture, "bias", 0.0))


def _four(texture: UsdShade.Shader, name: str, otherwise: float) -> tuple[float, ...]:
    given = texture.GetInput(name)
    value = given.Get() if given else None
    return (otherwise,) * 4 if value is None else tuple(map(float, value))
