"""Cameras: where a point falls in the picture, against USD's own frustum, and how sharply."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import Gf, UsdGeom

from fabricusd.errors import FabricError
from fabricusd.reference.rays.camera import build_lens
from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.scene import Camera, Light, PreviewSurface, Scene
from tests.reference.scenes import grid, looking
from tests.reference.stages import new_stage, read

POINT = (1.0, 0.5, 0.0)
IDENTITY = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 10, 1))

VIEWS = {
    # name: (attributes, rows of the frame to replace, width, height, metres in a unit)
    "perspective": ({}, {}, 64, 64, 1.0),
    "in centimetres": ({}, {}, 64, 64, 0.01),
    "a shifted aperture": (
        {"horizontalApertureOffset": 3.0, "verticalApertureOffset": -2.0}, {}, 64, 64, 1.0,
    ),
    "orthographic": (
        {"projection": "orthographic", "horizontalAperture": 40.0, "verticalAperture": 40.0,
         "horizontalApertureOffset": 3.0, "verticalApertureOffset": -2.0}, {}, 64, 64, 1.0,
    ),
    "mirrored along x": ({}, {0: (-1, 0, 0, 0)}, 64, 64, 1.0),
    "mirrored along y": ({}, {1: (0, -1, 0, 0)}, 64, 64, 1.0),
    "scaled": ({}, {0: (3, 0, 0, 0), 2: (0, 0, 2, 0)}, 64, 64, 1.0),
    "sheared": ({}, {0: (1, 0.3, 0, 0)}, 64, 64, 1.0),
}  # fmt: skip


def camera_of(tmp_path, attributes, rows, metres):
    stage = new_stage(tmp_path, metres=metres)
    prim = UsdGeom.Camera.Define(stage, "/camera")
    for name, value in {
        "horizontalAperture": 20.0, "verticalAperture": 20.0, "focalLength": 50.0,
        "clippingRange": Gf.Vec2f(0.1, 100), **attributes,
    }.items():  # fmt: skip
        prim.GetPrim().GetAttribute(name).Set(value)
    matrix = [rows.get(k, row) for k, row in enumerate(IDENTITY)]
    prim.AddTransformOp().Set(Gf.Matrix4d(matrix))
    return prim.GetCamera(0).frustum, read(stage).camera


def pixel_of(camera, point, width, height):
    """(column, row) in which the middle ray of the lens meets `point`."""
    lens = build_lens(camera, width, height, np.zeros(3), "box")
    steps = np.stack([lens.across, lens.down, -(np.array(point) - lens.eye)], axis=1)
    if camera.orthographic:
        steps[:, 2] = lens.axis
        return np.linalg.solve(steps.astype(float), point - lens.eye - lens.forward)[:2]
    return np.linalg.solve(steps.astype(float), -lens.forward.astype(float))[:2]


@pytest.mark.parametrize("name", VIEWS)
def test_a_point_falls_where_usds_own_frustum_puts_it(tmp_path, name):
    attributes, rows, width, height, metres = VIEWS[name]
    frustum, camera = camera_of(tmp_path, attributes, rows, metres)
    seen = (frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()).Transform(
        Gf.Vec3d(*POINT)
    )
    expected = (0.5 * (seen[0] + 1) * width, 0.5 * (1 - seen[1]) * height)
    found = pixel_of(camera, np.array(POINT) * metres, width, height)
    assert found == pytest.approx(expected, abs=1e-3)


def test_the_width_of_the_aperture_is_kept_whatever_the_picture(tmp_path):
    _, camera = camera_of(tmp_path, {}, {}, 1.0)
    square, wide = (pixel_of(camera, POINT, 64, height) for height in (64, 32))
    assert wide[0] == pytest.approx(square[0])
    assert wide[1] - 16 == pytest.approx(square[1] - 32)


def test_exposure_is_that_of_all_its_attributes(tmp_path):
    attributes = {"exposure": 1.0, "exposure:iso": 400.0, "exposure:fStop": 2.0}
    _, camera = camera_of(tmp_path, attributes, {}, 1.0)
    assert camera.exposure == pytest.approx(1 + math.log2(4 / 2**2))


def test_a_camera_that_sees_nothing_is_passed_over_unless_it_is_named(tmp_path):
    stage = new_stage(tmp_path)
    UsdGeom.Camera.Define(stage, "/broken").CreateFocalLengthAttr(0.0)
    UsdGeom.Camera.Define(stage, "/sound")
    assert read(stage).camera.path == "/sound"
    with pytest.raises(FabricError, match="/broken has focalLength 0"):
        read(stage, camera="/broken")


def test_what_is_out_of_focus_is_as_wide_as_the_lens_makes_it():
    # A dot at 10 m through a lens of 0.1 m that is sharp at 5 m: a disc of 0.1 (10 - 5) / 5 there.
    lens, focus, distance = 0.1, 5.0, 10.0
    camera = Camera(
        frame=looking((0, distance, 0)), focal_length=0.2, f_stop=0.2 / lens,
        focus_distance=focus, aperture=(0.01, 0.01),
    )  # fmt: skip
    dot = PreviewSurface(diffuse=(0.0,) * 3, emissive=(1.0,) * 3, ior=1.0)
    scene = Scene(
        meshes=[grid(size=0.01)], materials=[dot], camera=camera,
        lights=[Light(path="none", kind=DOME, radiance=(0.0,) * 3)],
    )  # fmt: skip
    r = render_scene(scene, width=48, height=48, spp=2048, pixel_filter="box")
    seen = r.layers["beauty"][..., 0].astype(float)
    metres = (np.arange(48) + 0.5 - 24) * 0.01 * distance / 0.2 / 48
    spread = math.sqrt((seen.sum(axis=0) * metres**2).sum() / seen.sum())
    # The deviation of an even disc along one axis is a quarter of its diameter.
    assert spread == pytest.approx(lens * (distance - focus) / focus / 4, rel=0.03)
