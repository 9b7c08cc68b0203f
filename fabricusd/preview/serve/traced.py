"""A picture by the path tracer of what the page shows, for its wipe."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.levels import LEVELS
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, Fabric
from fabricusd.preview.lights import Lights
from fabricusd.preview.page.arrays import array
from fabricusd.preview.reference import scene_of_shape
from fabricusd.preview.serve.said import number, numbers, whole
from fabricusd.preview.shapes import SHAPES, Shape
from fabricusd.reference.render import render_scene
from fabricusd.scene.scene import Camera
from fabricusd.stop import Stop

MOST_SIZE, MOST_SAMPLES = 1024, 1024
"""Pixels along a side of a picture, and samples of a pixel."""

FIRST = 256, 64
"""Pixels along a side, and samples of a pixel, of the picture that goes into a page."""

VIEW: Mapping[str, type] = {
    "level": str, "size": int, "samples": int, "eye": list, "right": list, "up": list,
    "focal": float, "grain": float, "azimuth": float, "elevation": float, "key": float,
    "even": float, "slope": float,
}  # fmt: skip
"""What a request says of the picture: see `view_of`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A square picture. grain : turn of the cloth on the shape [rad]"""

    level: str
    size: int
    samples: int
    camera: Camera
    lights: Lights
    grain: float = 0.0


def view_of(said: Mapping[str, Any]) -> View:
    """The view of a request; FabricError where it is none.

    eye : (3,) place of the camera [m]; right, up : (3,) its axes; focal : focal length over half of
    the width of what is seen; azimuth, elevation, grain : in degrees
    """
    level = said.get("level", LEVELS[0])
    if level not in LEVELS:
        raise FabricError("level", f"is unknown; it must be one of {', '.join(LEVELS)}")
    frame = np.eye(4)
    frame[:3, 3] = numbers("eye", said.get("eye"), 3, -1e4, 1e4)
    right, up = (
        np.array(numbers(name, said.get(name), 3, -1.01, 1.01)) for name in ("right", "up")
    )
    axes = np.stack((right, up, np.cross(right, up)), axis=1)
    if np.abs(axes.T @ axes - np.eye(3)).max() > 1e-3:
        raise FabricError("right and up", "are not at right angles and one long")
    # The numbers are rounded; the camera's axes are not.
    turned, _, back = np.linalg.svd(axes)
    frame[:3, :3] = turned @ back
    focal = number("focal", said.get("focal"), 0.01, 1000.0)
    width = 0.036
    slope = number("slope", said.get("slope", 0.0), -100.0, 100.0)
    even = number("even", said.get("even", 0.0), 0.0, 100.0)
    if abs(slope) > even:
        raise FabricError("slope", f"is {slope:g}; it must be at most {even:g}, as even is")
    return View(
        level=level,
        size=whole("size", said.get("size", 256), 16, MOST_SIZE),
        samples=whole("samples", said.get("samples", 64), 1, MOST_SAMPLES),
        camera=Camera(
            path="page", frame=frame, focal_length=0.5 * width * focal, aperture=(width, width)
        ),
        lights=Lights(
            azimuth=math.radians(number("azimuth", said.get("azimuth", 0.0), -360, 360)),
            elevation=math.radians(number("elevation", said.get("elevation", 0.0), -90, 90)),
            key=number("key", said.get("key", 0.0), 0.0, 1000.0),
            zenith=even + slope, nadir=even - slope,
        ),
        grain=math.radians(number("grain", said.get("grain", 0.0), -360, 360)),
    )  # fmt: skip


def traced(fabric: Fabric, shape: Shape, view: View, stop: Stop | None = None) -> dict[str, Any]:
    """Radiance and cover as the page takes them, without bounces, and the time that took [s].

    Raises KeyboardInterrupt where `stop` was asked.
    """
    begun = time.perf_counter()
    binding = Binding(fabric=fabric, metres_per_uv=1.0, rotation=view.grain)
    scene = scene_of_shape(binding, shape, view.lights, view.camera)
    result = render_scene(
        scene, width=view.size, height=view.size, spp=view.samples, max_bounces=0,
        level=view.level, shadow="horizon", stop=stop,
    )  # fmt: skip
    if not result.complete:
        raise KeyboardInterrupt
    pixels: NDArray[np.float32] = np.asarray(result.layers["beauty"], np.float32)
    return {
        "size": view.size, "samples": view.samples, "level": view.level,
        "pixels": array(pixels, "f4"), "seconds": round(time.perf_counter() - begun, 3),
        "sampling": round(result.seconds, 3),
    }  # fmt: skip


def first_reference(
    fabric: Fabric, mesh: Shape | None, lights: Lights, samples: int | None
) -> dict[str, Any]:
    """The view that a page begins with, at level `far`; samples : of a pixel, None for FIRST[1]."""
    shape = SHAPES["cylinder"](fabric) if mesh is None else mesh
    size, most = FIRST
    view = View(
        level=LEVELS[0], size=size, samples=samples or most, camera=shape.camera(), lights=lights
    )
    return traced(fabric, shape, view)
