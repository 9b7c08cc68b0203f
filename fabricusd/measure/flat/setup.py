"""Where camera and lamps stand around flat cloth, in heights of the camera above it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.ranges import RANGES

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Setup:
    """The camera looks straight down at the middle of the cloth; x is right, y up in the picture.

    light : (3,) float - the lamp before the cloth, over the camera's height; z above 0
    back_light : (3,) float or None - the lamp behind the cloth; z below 0
    view_angle : float - field of view across the picture [degrees]
    width : float - length of cloth across the picture [m]; 0 if it is not known
    """

    light: tuple[float, float, float]
    back_light: tuple[float, float, float] | None = None
    view_angle: float = 53.0
    width: float = field(default=0.0)

    def __post_init__(self) -> None:
        for name, lamp, side in (("light", self.light, 1), ("back-light", self.back_light, -1)):
            if lamp is None:
                continue
            if len(lamp) != 3 or not all(math.isfinite(x) for x in lamp):
                raise FabricError(f"--{name}", f"is {lamp}; it must be three finite numbers, X Y Z")
            if not side * lamp[2] > 0:
                where = "above 0: before the cloth" if side > 0 else "below 0: behind the cloth"
                raise FabricError(f"--{name}", f"has z {lamp[2]:g}; it must be {where}")
        RANGES["view_angle"].require("--view-angle", self.view_angle)
        if not (math.isfinite(self.width) and self.width >= 0):
            raise FabricError("--cloth-width", f"is {100 * self.width:g} cm; it must be above 0")

    @property
    def half(self) -> float:
        """Half the width of the cloth in the picture, over the camera's height."""
        return math.tan(math.radians(0.5 * self.view_angle))

    def places(self, shape: tuple[int, int], step: int = 1) -> Floats:
        """(n, 3) places on the cloth seen by the middles of squares of `step` pixels, rows first.

        shape : (height, width) of the picture in pixels
        """
        height, width = shape
        x = ((np.arange(width // step) + 0.5) * step / width * 2 - 1) * self.half
        y = (1 - (np.arange(height // step) + 0.5) * step / height * 2) * self.half * height / width
        grid: Any = np.meshgrid(x, y)
        return np.stack((grid[0].ravel(), grid[1].ravel(), np.zeros(grid[0].size)), axis=1)

    def pairs(self, places: Floats, *, behind: bool = False) -> tuple[Floats, Floats, Floats]:
        """((n, 3) to the lamp, (n, 3) to the camera, (n,) squared distance of the lamp)."""
        lamp = self.back_light if behind else self.light
        if lamp is None:
            raise FabricError("--back-light", "is missing; where was the lamp behind the cloth?")
        to_lamp = np.asarray(lamp, np.float64) - places
        to_camera = np.array([0.0, 0.0, 1.0]) - places
        square = (to_lamp**2).sum(axis=1)
        return (
            to_lamp / np.sqrt(square)[:, None],
            to_camera / np.linalg.norm(to_camera, axis=1)[:, None],
            square,
        )


def turned(w: Floats, angle: float) -> Floats:
    """(n, 3) directions in the frame of cloth whose weft lies at `angle` to the picture's x."""
    c, s = math.cos(angle), math.sin(angle)
    return np.stack((c * w[:, 0] + s * w[:, 1], -s * w[:, 0] + c * w[:, 1], w[:, 2]), axis=1)
