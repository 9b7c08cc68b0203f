"""The lights of a preview: a key light from one direction, and a sky that is brighter above."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.light_kinds import DISTANT, DOME
from fabricusd.scene.scene import Light
from fabricusd.scene.studio import looking

Vector = NDArray[np.float64]

_SKY_ROWS = 512
"""Rows of the sky's picture, for renderers that light scenes by one."""


@dataclass(frozen=True, kw_only=True)
class Lights:
    """One key light and a sky, as seen from the camera's side of the subject.

    azimuth : of the key light about the vertical, from the front to the right [rad]
    elevation : of the key light above the horizon [rad]
    key : irradiance of a surface that faces the key light [W/m2]
    zenith, nadir : radiance of the sky straight above and straight below [W/m2/sr]; in between it
        is linear in the sine of the elevation
    """

    azimuth: float = math.radians(-35.0)
    elevation: float = math.radians(40.0)
    key: float = 2.0
    zenith: float = 0.5
    nadir: float = 0.1

    @property
    def even(self) -> float:
        """Radiance of the sky at the horizon."""
        return 0.5 * (self.zenith + self.nadir)

    @property
    def slope(self) -> float:
        """By how much the sky's radiance grows from the horizon to the zenith."""
        return 0.5 * (self.zenith - self.nadir)

    def direction(self, axes: Vector) -> Vector:
        """(3,) unit vector to the key light; axes : (3, 3), columns right, up and front."""
        flat = math.cos(self.elevation)
        towards = (
            flat * math.sin(self.azimuth), math.sin(self.elevation), flat * math.cos(self.azimuth)
        )  # fmt: skip
        return np.asarray(axes @ np.array(towards))


def scene_lights(lights: Lights, axes: Vector) -> list[Light]:
    """The same lights for the path tracer; axes : see `Lights.direction`."""
    towards, up = lights.direction(axes), axes[:, 1]
    turned = np.eye(4)
    # A dome's pole is +y, and its picture's first row is above.
    turned[:3, :3] = axes
    height = np.cos(math.pi * (np.arange(_SKY_ROWS) + 0.5) / _SKY_ROWS)
    radiance = lights.even + lights.slope * height
    image = np.repeat(np.repeat(radiance[:, None], 2, axis=1)[..., None], 3, axis=2)
    return [
        Light(
            path="/key", kind=DISTANT, radiance=(lights.key,) * 3,
            frame=looking(towards, np.zeros(3), up),
        ),
        Light(
            path="/sky", kind=DOME, radiance=(1.0, 1.0, 1.0), frame=turned,
            image=np.ascontiguousarray(image, np.float32), hidden=True,
        ),
    ]  # fmt: skip
