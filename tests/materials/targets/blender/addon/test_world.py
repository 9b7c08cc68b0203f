"""The dome light: Cycles sees the sky that `fabricusd render` sees."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from fabricusd.images.files import read_exr_layers
from fabricusd.reference.render import render
from tests.materials.targets.blender.addon.blender import in_blender, interpreter

SIZE = (48, 32)

CASES = {
    # up axis, kind of dome, its pole, its turns about x, y, z [degrees]
    "y up": ("Y", "DomeLight", None, (0.0, 0.0, 0.0)),
    "y up, turned": ("Y", "DomeLight", None, (20.0, 130.0, -35.0)),
    "z up, turned": ("Z", "DomeLight", None, (70.0, 15.0, 40.0)),
    "z up, pole of the scene": ("Z", "DomeLight_1", "scene", (0.0, 0.0, 25.0)),
}


def write_sky(path):
    """Smooth, and different in every direction.

    Cycles mixes the first and the last row of a picture at its poles, so the rows are narrow.
    """
    h, w = 512, 1024
    v, u = np.meshgrid((np.arange(h) + 0.5) / h, (np.arange(w) + 0.5) / w, indexing="ij")
    a, b = 2.0 * np.pi * u, np.pi * v
    sky = np.stack((1.2 + np.sin(b) * np.sin(a), 1.2 + np.sin(b) * np.cos(a), 1.2 + np.cos(b)), -1)
    image = oiio.ImageBuf(oiio.ImageSpec(w, h, 3, "float"))
    image.set_pixels(image.roi, sky.astype(np.float32))
    assert image.write(str(path))


def write_scene(folder, name):
    """A camera in an empty dome, and a material of a look, without which nothing is imported."""
    up_axis, kind, pole, turns = CASES[name]
    path = folder / f"{name.replace(' ', '_').replace(',', '')}.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, up_axis)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    dome = getattr(UsdLux, kind).Define(stage, "/World/Sky")
    dome.CreateTextureFileAttr("./sky.exr")
    dome.CreateIntensityAttr(0.5)
    dome.CreateExposureAttr(1.0)
    dome.CreateColorAttr(Gf.Vec3f(1.0, 0.8, 0.6))
    if pole:
        dome.CreatePoleAxisAttr(pole)
    UsdGeom.Xformable(dome).AddRotateXYZOp().Set(Gf.Vec3f(*turns))
    UsdGeom.Xformable(stage.GetDefaultPrim()).AddRotateXYZOp().Set(Gf.Vec3f(10.0, 0.0, 30.0))
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.CreateFocalLengthAttr(12.0)
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(24.0)
    UsdGeom.Xformable(camera).AddRotateXYZOp().Set(Gf.Vec3f(35.0, 20.0, -15.0))
    behind = UsdGeom.Cube.Define(stage, "/World/Behind")
    behind.AddTranslateOp().Set(Gf.Vec3d(0.0, 0.0, 1e3))
    behind.AddScaleOp().Set(Gf.Vec3f(1e-3))
    material = UsdShade.Material.Define(stage, "/World/Cloth")
    material.CreateInput("rough_scale", Sdf.ValueTypeNames.Float).Set(1.0)
    stage.GetRootLayer().Save()
    return path


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    interpreter()
    folder = tmp_path_factory.mktemp("domes")
    write_sky(folder / "sky.exr")
    steps, found = [], {}
    for name in CASES:
        scene = write_scene(folder, name)
        truth, ours = scene.with_suffix(".truth.exr"), scene.with_suffix(".cycles.exr")
        render(scene, truth, width=SIZE[0], height=SIZE[1], spp=16, pixel_filter="box")
        steps += [
            {"do": "clear"}, {"do": "bring", "path": str(scene)},
            {"do": "look", "picture": str(ours), "size": SIZE, "spp": 16},
        ]  # fmt: skip
        found[name] = truth, ours
    in_blender(folder, *steps)
    return {k: [read_exr_layers(one)[0]["beauty"] for one in pair] for k, pair in found.items()}


@pytest.mark.parametrize("name", CASES)
def test_the_dome_is_where_it_was(pictures, name):
    truth, ours = pictures[name]
    assert truth[..., :3].std(axis=(0, 1)).min() > 0.05
    assert np.abs(ours[..., :3] - truth[..., :3]).max() < 0.02 * truth[..., :3].max()
