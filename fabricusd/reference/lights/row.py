"""A light's row in the table of lights: its columns, and functions that kinds share to fill it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.scene import Light

# X and Y are the half extents of a rect and the radii of a disk; X is half the axis of a cylinder.
# Z is the unit direction in which a flat light shines, or from which a distant light comes.
KIND, CHANCE, RED, P, X, Y, Z, SIZE, AREA, VISIBLE = 0, 1, 2, 5, 8, 11, 14, 17, 18, 19
COLUMNS = 20

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


class Axes(NamedTuple):
    """The axes of a light's frame, as its row needs them.

    x, y, z : (3,) float64 - the frame's own axes, with the light's scale
    lengths : (3,) float64 - the lengths of these axes, above 0
    normal : (3,) float64 - unit vector perpendicular to x and y, even if the frame is sheared or
        flat; it points to the side on which flat lights shine
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    lengths: NDArray[np.float64]
    normal: NDArray[np.float64]


def axes_of(light: Light) -> Axes:
    """The axes of a light's frame."""
    x, y, z = light.frame[:3, :3].T
    lengths = np.maximum(np.linalg.norm(light.frame[:3, :3], axis=0), 1e-30)
    cross = np.cross(x, y)
    length = max(float(np.linalg.norm(cross)), 1e-30)
    return Axes(x, y, z, lengths, -cross * math.copysign(1.0, cross @ z) / length)


def put_axes(row: NDArray[np.float64], x: Any, y: Any, z: Any) -> None:
    """Fill the columns X, Y and Z."""
    row[X : X + 3], row[Y : Y + 3], row[Z : Z + 3] = x, y, z


def brightness(row: NDArray[np.float32]) -> float:
    """The luminance of the light's radiance."""
    return float(row[RED : RED + 3] @ LUMINANCE)


def mean_irradiance(
    row: NDArray[np.float32], places: NDArray[np.float32], *, one_sided: bool
) -> float:
    """Mean irradiance that an area light gives at `places`, averaged over all orientations of a
    surface.

    places : (n, 3) [m]
    one_sided : whether the light shines only to the side of its axis Z
    """
    away = np.asarray(places, np.float64) - row[P : P + 3]
    # A light does not get brighter at distances below its own size.
    distance2 = np.maximum(np.einsum("ij,ij->i", away, away), max(float(row[AREA]), 1e-12))
    # The projected share of the light's surface that is visible.
    seen = np.full(len(away), 0.25)
    if one_sided:
        seen = np.maximum(away @ row[Z : Z + 3], 0.0) / np.sqrt(distance2)
    return 0.5 * brightness(row) * float(row[AREA]) * float((seen / distance2).mean())
