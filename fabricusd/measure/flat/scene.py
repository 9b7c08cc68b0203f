"""The setup as a scene for the path tracer, so that the recovered cloth is seen as it was shot."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Binding, Fabric
from fabricusd.measure.flat.setup import Setup
from fabricusd.scene.light_kinds import SPHERE
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, Scene

Floats = NDArray[np.float64]

LAMP = 0.01
"""Radius of a lamp, over the height of the camera: small, so that its place is its whole light."""
APERTURE = 0.036


def scene_of(
    fabric: Fabric,
    setup: Setup,
    shape: tuple[int, int],
    *,
    pitch: tuple[float, float],
    turn: float,
    offset: tuple[float, float] = (0.0, 0.0),
    gain: float = 1.0,
    behind: bool = False,
) -> Scene:
    """Flat cloth under camera and lamp; lengths are heights of the camera.

    shape : (height, width) of the photograph; pitch : (ends, picks) in pixels
    turn : of the weft to the picture's x [rad]; offset : (ends, picks) in threads at its middle
    gain : of the lamp: irradiance face on at a distance of 1
    behind : whether the lamp behind the cloth shines, instead of the one before it
    """
    height, width = shape
    half = np.array([setup.half, setup.half * height / width])
    # The cloth reaches beyond the picture, so that its pixels at the border are whole.
    reach = 1.02
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * reach
    points = np.concatenate((corners * half, np.zeros((4, 1))), axis=1)
    uv = corners * [1.0, height / width] * (0.5 * width)
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    binding = Binding(
        fabric=fabric, threads_per_uv=(1 / pitch[0], 1 / pitch[1]), rotation=turn,
        offset=(offset[0] * pitch[0], offset[1] * pitch[1]),
    )  # fmt: skip
    mesh = Mesh(
        path="/Flat/Cloth", points=points, triangles=triangles, smooth=False,
        uv=uv[triangles], material=np.zeros(2, np.int32),
    )  # fmt: skip
    lamp = setup.back_light if behind else setup.light
    assert lamp is not None
    frame = np.eye(4)
    frame[:3, 3] = lamp
    radiance = gain / (math.pi * LAMP**2)
    light = Light(
        path="/Flat/Lamp", kind=SPHERE, radiance=(radiance,) * 3, frame=frame, radius=LAMP
    )
    eye = np.eye(4)
    eye[2, 3] = 1.0
    camera = Camera(
        path="/Flat/Camera", frame=eye, focal_length=APERTURE / (2 * setup.half),
        aperture=(APERTURE, APERTURE * height / width),
    )  # fmt: skip
    return Scene(
        meshes=[mesh], materials=[FabricSurface(name="Cloth", binding=binding)], lights=[light],
        camera=camera,
    )  # fmt: skip


def photograph_of(scene: Scene, shape: tuple[int, int], *, spp: int = 16, seed: int = 0) -> Floats:
    """(h, w, 3) linear picture of the scene by the path tracer, as bright as its light."""
    from fabricusd.reference.render import render_scene
    from fabricusd.stop import Stop

    stop = Stop()
    try:
        made = render_scene(
            replace(scene), width=shape[1], height=shape[0], spp=spp, max_bounces=0, seed=seed,
            stop=stop,
        )  # fmt: skip
    finally:
        stop.release()
    return np.asarray(made.layers["beauty"][..., :3], np.float64)
