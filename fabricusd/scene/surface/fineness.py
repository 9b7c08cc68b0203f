"""Chooses how finely a subdivision surface is refined: by a fixed complexity or for a picture."""

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
"""Allowed distance of the triangles from the surface [pixels] where the mesh is nearest to the
camera. The distance is estimated: on cages of a few large faces, it was up to three times as large
in places."""
_MOST, _WORST = 0.95, 4.0
"""Share of the edges that must meet OFF, and the factor by which the others may exceed it. A few
sharp edges, as at a hem, thus do not force the whole mesh to be refined, and a small part that is
coarse does not stay coarse."""
_LAST = 6
"""Highest level that `auto` chooses; a cage of few large faces may need more than `veryhigh`."""
_LOOKED = 16
"""Places of an instanced mesh, those where it may look largest, at which its level is found."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fineness:
    """A complexity, with the picture's width [pixels] and camera, which `auto` needs.

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
        """How often the cage's edges are halved. points : (n, 3) float64 [m] in world space."""
        if not self.is_auto:
            return COMPLEXITIES[self.complexity]
        finite = np.isfinite(points).all(axis=1)
        pixel = self._pixel(points[finite])
        if not pixel > 0 or not len(indices):
            return 0
        bends = _bends(points, counts, indices)
        bend = max(float(np.quantile(bends, _MOST)), float(bends.max()) / _WORST) / (OFF * pixel)
        # For a cubic B-spline, the limit lies a sixth of the second difference away from its
        # control point, and an eighth away from the middle of a chord. Each halving of the edges
        # divides the second difference by four.
        if bend <= 6.0:
            return 0
        return min(max(math.ceil(math.log(bend / 8.0, 4.0)), 1), _LAST)

    def finest(
        self,
        points: NDArray[np.float64],
        places: NDArray[np.float64],
        counts: NDArray[Any],
        indices: NDArray[Any],
    ) -> int:
        """The highest level of (n, 3) `points` at the (k, 3, 4) `places` [m] that look largest."""
        if not self.is_auto:
            places = places[:1]
        if len(places) > _LOOKED:
            places = places[np.argsort(-self._largeness(points, places))[:_LOOKED]]
        return max(
            self.level(points @ place[:, :3].T + place[:, 3], counts, indices) for place in places
        )

    def _largeness(
        self, points: NDArray[np.float64], places: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(k,) how large a mesh may look at its nearest point, for each of its places."""
        known = points[np.isfinite(points).all(axis=1)]
        stretch = np.linalg.norm(places[:, :, :3], axis=(1, 2))
        if self.camera is None or self.camera.orthographic or not len(known):
            return np.asarray(stretch)
        middle = 0.5 * (known.min(axis=0) + known.max(axis=0))
        radius = float(np.linalg.norm(known - middle, axis=1).max())
        centre = places[:, :, :3] @ middle + places[:, :, 3] - self.camera.frame[:3, 3]
        away = np.linalg.norm(centre, axis=1) - radius * stretch
        return np.asarray(stretch / np.maximum(away, max(self.camera.clipping[0], 1e-9)))

    def _pixel(self, points: NDArray[np.float64]) -> float:
        """Width [m] of a pixel at the nearest of `points`; without a camera, the points are assumed
        to fill the picture."""
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
    """(h,) length of each corner's edge [m] times the angle by which the normal turns along it; 0
    where a point is not finite."""
    face, after, _ = around_faces(counts)
    edge = points[indices[after]] - points[indices]
    # Newell's normal, relative to the face's first corner, so that products keep their digits.
    own = points[indices] - points[indices[(np.cumsum(counts) - counts)[face]]]
    part = np.cross(own, own[after])
    part[~np.isfinite(part).all(axis=1)] = 0.0
    whole = np.stack([np.bincount(face, part[:, k], len(counts)) for k in range(3)], axis=1)
    at = np.stack([np.bincount(indices, whole[face, k], len(points)) for k in range(3)], axis=1)
    at = at / np.maximum(np.linalg.norm(at, axis=1), 1e-300)[:, None]
    turn = np.linalg.norm(at[indices[after]] - at[indices], axis=1)
    return np.nan_to_num(np.linalg.norm(edge, axis=1) * turn, nan=0.0, posinf=0.0)
