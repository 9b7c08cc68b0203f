"""Where an instanced mesh stands: affine transforms that are applied to its points as they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

_AT_ONCE = 1 << 22
"""Transformed coordinates that `bounds_of` holds at once."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Placements:
    """The places at which one or several meshes appear, and the prims that put them there.

    transforms : (k, 3, 4) float64 - from the mesh's points to the world [m]; meshes that have the
        same array stand together
    paths : the distinct prim paths; path_of : (k,) int32 - the path of each place
    """

    transforms: NDArray[np.float64]
    paths: tuple[str, ...]
    path_of: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.transforms)

    def where(self, is_wanted: Callable[[str], bool]) -> Placements | None:
        """The places whose path is wanted; None where there is none."""
        wanted = np.array([is_wanted(path) for path in self.paths], bool)
        if wanted.all():
            return self
        chosen = wanted[self.path_of]
        if not chosen.any():
            return None
        return replace(self, transforms=self.transforms[chosen], path_of=self.path_of[chosen])


def is_mirroring(linear: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(...) which of the (..., 3, 3) matrices change the handedness."""
    return np.asarray(np.linalg.det(linear) < 0)


def bounds_of(
    points: NDArray[np.float64], transforms: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(low, high) of (n, 3) points under each of (k, 3, 4) transforms, all together.

    Most places are far from any side: what they reach is bounded by the points' box, and only
    those that may reach farther than what is known are looked at point by point.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    linear, shift = transforms[:, :, :3], transforms[:, :, 3]
    centre, reach = linear @ middle + shift, np.abs(linear) @ half
    bounds = np.empty((2, 3))
    for axis in range(3):
        for side, sign in enumerate((-1.0, 1.0)):
            most = sign * centre[:, axis] + reach[:, axis]
            rows = sign * linear[:, axis], sign * shift[:, axis]
            bounds[side, axis] = sign * _farthest(points, most, *rows)
    return bounds[0], bounds[1]


def _farthest(points: NDArray[Any], most: NDArray[Any], row: Any, shift: Any) -> float:
    """The largest coordinate: `row @ point + shift` over all points and places, at most `most`."""
    order = np.argsort(-most)
    step = max(_AT_ONCE // len(points), 1)
    best = -np.inf
    # Look at few places first: they tell how many of the others matter.
    start, size = 0, min(8, step)
    while start < len(order) and most[order[start]] > best:
        part = order[start : start + size]
        best = max(best, float((points @ row[part].T + shift[part]).max()))
        start, size = start + size, step
    return best
