"""How finely a subdivision surface is refined: as usdrecord is told to, or as a picture shows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.scene.scene import Camera
from fabricusd.scene.surface.subdivision import COMPLEXITIES, around_faces

AUTO = "auto"
OFF = 0.25
"""Pixels that triangles may be off from the surface where the mesh is nearest to the camera. An
estimate: on cages of a few large faces three times as much was seen in places."""
_MOST, _WORST = 0.95, 4.0
"""Share of the edges that this is asked of, and how many times as far off the others may be: a few
sharp ones, at a hem, do not refine all the rest, and a small part that is coarse is not left so."""
_LAST = 6
"""A cage of few large faces is refined further than `veryhigh`, but not without end."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fineness:
    """A complexity, and what `auto` needs to know: the picture's width [pixels] and its camera.

    Raises `FabricError` for a complexity that does not exist.
    """

    complexity: str = "low"
    width: int = 960
    camera: Camera | None = None

    def __post_init__(self) -> None:
        known = (AUTO, *COMPLEXITIES)
        if self.complexity not in known:
            raise FabricError(
                "complexity", f"is '{self.complexity}'; it must be one of {', '.join(known)}"
            )

    @property
    def is_auto(self) -> bool:
        """Whether the level depends on the mesh."""
        return self.complexity == AUTO

    def level(
        self, points: NDArray[np.float64], counts: NDArray[Any], indices: NDArray[Any]
    ) -> int:
        """How often a cage's edges are halved. points : (n, 3) float64 [m] in the world."""
        if not self.is_auto:
            return COMPLEXITIES[self.complexity]
        finite = np.isfinite(points).all(axis=1)
        pixel = self._pixel(points[finite])
        if not pixel > 0 or not len(indices):
            return 0
        bends = _bends(points, counts, indices)
        bend = max(float(np.quantile(bends, _MOST)), float(bends.max()) / _WORST) / (OFF * pixel)
        # Of a cubic B-spline: the limit lies a sixth of the second difference beside its control
        # point, and an eighth beside the middle of a chord, which each halving makes a quarter.
        if bend <= 6.0:
            return 0
        return min(max(math.ceil(math.log(bend / 8.0, 4.0)), 1), _LAST)

    def _pixel(self, points: NDArray[np.float64]) -> float:
        """Width of a pixel where `points` are nearest [m]; as if they filled a picture that has no
        camera."""
        if not len(points):
            return 0.0
        if self.camera is None:
            return float(np.linalg.norm(np.ptp(points, axis=0))) / self.width
        pixel = self.camera.aperture[0] / self.width
        if self.camera.orthographic:
            return pixel
        away = float(np.linalg.norm(points - self.camera.frame[:3, 3], axis=1).min())
        return pixel * max(away, self.camera.clipping[0]) / self.camera.focal_length


def _bends(
    points: NDArray[np.float64], counts: NDArray[Any], indices: NDArray[Any]
) -> NDArray[np.float64]:
    """(h,) length of each corner's edge [m] times the angle that the normal turns along it; 0 where
    a point is not finite."""
    face, after, _ = around_faces(counts)
    edge = points[indices[after]] - points[indices]
    # Newell's normal, about the face's own first corner, where products keep their digits.
    own = points[indices] - points[indices[(np.cumsum(counts) - counts)[face]]]
    part = np.cross(own, own[after])
    part[~np.isfinite(part).all(axis=1)] = 0.0
    whole = np.stack([np.bincount(face, part[:, k], len(counts)) for k in range(3)], axis=1)
    at = np.stack([np.bincount(indices, whole[face, k], len(points)) for k in range(3)], axis=1)
    at = at / np.maximum(np.linalg.norm(at, axis=1), 1e-300)[:, None]
    turn = np.linalg.norm(at[indices[after]] - at[indices], axis=1)
    return np.nan_to_num(np.linalg.norm(edge, axis=1) * turn, nan=0.0, posinf=0.0)
