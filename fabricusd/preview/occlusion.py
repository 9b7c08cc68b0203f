"""Shadows that a shape casts on itself: of the key light, and of the sky as a share at corners."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.cache import kept
from fabricusd.preview.kernels.raster import NOTHING, rasterise, reached
from fabricusd.preview.lights import Lights
from fabricusd.preview.shapes import Shape
from fabricusd.scene.studio import looking

Floats = NDArray[np.float64]

DIRECTIONS, MAP = 96, 256
"""Directions of the sky for which the corners' share is found, and texels of their maps."""


def orthographic(points: Floats, towards: Floats, size: int) -> Floats:
    """(3, 4) affine map of places to (x, y) in a square map seen from `towards`, and distance.

    The map shows all points (..., 3), with a margin of two texels.
    """
    frame = looking(towards, np.zeros(3), np.eye(3)[int(np.argmin(np.abs(towards)))])
    local = points.reshape(-1, 3) @ frame[:3, :3]
    low, high = local.min(axis=0), local.max(axis=0)
    scale = (size - 4) / max(float((high - low)[:2].max()), 1e-12)
    out = np.zeros((3, 4))
    for row, (axis, sign) in enumerate(((0, 1.0), (1, 1.0), (2, -1.0))):
        factor = scale if row < 2 else 1.0
        out[row, :3] = sign * factor * frame[:3, axis]
        out[row, 3] = 2.0 - factor * low[axis] if row < 2 else high[2]
    return out


def shadow_map(points: Floats, towards: Floats, size: int) -> tuple[Floats, Floats]:
    """(map of `orthographic`, (size, size) distances that light from `towards` reaches)."""
    matrix = orthographic(points, towards, size)
    at = points @ matrix[:, :3].T + matrix[:, 3]
    corners = np.ones((*points.shape[:2], 4))
    corners[..., :2], corners[..., 3] = at[..., :2], at[..., 2]
    depth = np.full((size, size), np.inf)
    rasterise(
        corners, 0.0, 0.0, depth, np.full((size, size), NOTHING, np.int32),
        np.zeros((size, size, 2), np.float32),
    )  # fmt: skip
    return matrix, depth


def occlusion_of(shape: Shape, lights: Lights) -> NDArray[np.float32]:
    """(m, 3) share of the sky's irradiance that reaches the corners, kept in the cache."""
    key = (1, DIRECTIONS, MAP, shape.points, shape.normals, lights.zenith, lights.nadir)
    return kept("occlusion", key, lambda: _occlusion(shape, lights))


def _occlusion(shape: Shape, lights: Lights) -> NDArray[np.float32]:
    up = shape.subject.axes[:, 1]
    k = np.arange(DIRECTIONS)
    height, turn = 1.0 - (2.0 * k + 1.0) / DIRECTIONS, k * (math.pi * (3.0 - math.sqrt(5.0)))
    flat = np.sqrt(1.0 - height * height)
    sky = np.stack((flat * np.cos(turn), flat * np.sin(turn), height), axis=-1)
    normals = shape.normals.reshape(-1, 3)
    lifted = shape.points.reshape(-1, 3) + normals * (3.0 * shape.subject.radius / MAP * 2.0)
    total, met = np.zeros(len(normals)), np.zeros(len(normals))
    lit = np.empty(len(normals), np.float32)
    for towards in sky:
        cosine = np.maximum(normals @ towards, 0.0) * (lights.even + lights.slope * (towards @ up))
        matrix, depth = shadow_map(shape.points, towards, MAP)
        at: Any = lifted @ matrix[:, :3].T + matrix[:, 3]
        reached(depth, *(np.ascontiguousarray(at[:, x], np.float32) for x in range(3)), lit)
        total += cosine
        met += cosine * lit
    share = np.divide(met, total, out=np.ones_like(met), where=total > 0)
    return np.ascontiguousarray(share.reshape(-1, 3), np.float32)
