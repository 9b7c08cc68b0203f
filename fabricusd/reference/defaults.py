"""Default lights for a scene without lights: a soft sky and a key light from the viewer's left."""

from __future__ import annotations

import math

import numpy as np

from fabricusd.scene.light_kinds import DISTANT, DOME
from fabricusd.scene.scene import Light, Scene


def default_lights(scene: Scene) -> list[Light]:
    """A grey dome and a distant key light as wide as a softbox; their irradiance is about 1."""
    up = np.array([0.0, 0.0, 1.0]) if scene.up_axis == "Z" else np.array([0.0, 1.0, 0.0])
    front = np.array([0.0, -1.0, 0.0]) if scene.up_axis == "Z" else np.array([0.0, 0.0, 1.0])
    towards = front - 0.7 * np.cross(up, front) + 1.1 * up
    towards = towards / np.linalg.norm(towards)
    x = np.cross(up, towards)
    x = x / np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2] = x, np.cross(towards, x), towards
    angle = math.radians(10.0)
    solid = 2 * math.pi * (1 - math.cos(angle / 2))
    key = 2.2 / solid
    return [
        Light(path="default dome", kind=DOME, radiance=(0.35, 0.36, 0.38)),
        Light(
            path="default key light",
            kind=DISTANT,
            radiance=(key, 0.97 * key, 0.92 * key),
            frame=frame,
            angle=angle,
        ),
    ]
