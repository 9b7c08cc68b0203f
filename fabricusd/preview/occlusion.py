"""Shadows that a shape casts on itself: of the key light, and of the sky at its vertices."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.cache import kept
from fabricusd.kernels.cache import fingerprint
from fabricusd.preview.kernels.raster import NOTHING, rasterise, reached
from fabricusd.preview.shapes import Shape
from fabricusd.scene.studio import looking

Floats = NDArray[np.float64]

DIRECTIONS, MAP = 64, 256
"""Directions of the sky, and texels of the maps that say where each of them arrives."""


class Visibility(NamedTuple):
    """Which directions of the sky reach the vertices of a shape.

    first : (v,) int64 - a corner (three times the triangle, plus 0 to 2) at each vertex
    vertex : (m, 3) int64 - the vertex of each corner
    arrives : (v, DIRECTIONS) bool
    """

    first: NDArray[np.int64]
    vertex: NDArray[np.int64]
    arrives: NDArray[np.bool_]


def orthographic(points: Floats, towards: Floats, size: int) -> Floats:
    """(3, 4) affine map of places to (x, y) in a square map seen from `towards`, and distance.

    The map shows all points (..., 3), with a margin of two texels.
    """
    frame = looking(towards, np.zeros(3), np.eye(3)[int(np.argmin(np.abs(towards)))])
    local = points.reshape(-1, 3) @ frame[:3, :3]
    low, high = local.min(axis=0), local.max(axis=0)
    scale = (size - 4) / max(float((high - low)[:2].max()), 1e-12)
    out = np.zeros((3, 4))
    for row, (factor, sign) in enumerate(((scale, 1.0), (scale, 1.0), (1.0, -1.0))):
        out[row, :3] = sign * factor * frame[:3, row]
        out[row, 3] = 2.0 - factor * low[row] if row < 2 else high[2]
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


def sky_directions() -> Floats:
    """(DIRECTIONS, 3) unit vectors, evenly all around, each for the same solid angle."""
    k = np.arange(DIRECTIONS)
    height, turn = 1.0 - (2.0 * k + 1.0) / DIRECTIONS, k * (math.pi * (3.0 - math.sqrt(5.0)))
    flat = np.sqrt(1.0 - height * height)
    return np.stack((flat * np.cos(turn), height, flat * np.sin(turn)), axis=-1)


def visibility_of(shape: Shape) -> Visibility:
    """What of the sky reaches the vertices of `shape`, kept in the cache."""
    key = (fingerprint(), Path(__file__).read_bytes(), shape.points, shape.normals)
    vertex = kept("occlusion", ("vertices", *key), lambda: _vertices(shape))
    count = int(vertex.max()) + 1
    first = np.empty(count, np.int64)
    first[vertex.ravel()[::-1]] = np.arange(vertex.size)[::-1]
    bits = kept("occlusion", ("arrives", *key), lambda: _arrivals(shape, first))
    return Visibility(first, vertex, np.unpackbits(bits, axis=1)[:, :DIRECTIONS].astype(bool))


def _vertices(shape: Shape) -> NDArray[np.int64]:
    """(m, 3) number of the vertex at each corner: corners of the same place and normal share it."""
    rows = np.concatenate((shape.points, shape.normals), axis=-1).reshape(-1, 6)
    single = np.ascontiguousarray(rows, np.float32)
    _, number = np.unique(single.view(np.dtype((np.void, 24))).ravel(), return_inverse=True)
    return np.asarray(number.reshape(-1, 3), np.int64)


def _arrivals(shape: Shape, first: NDArray[np.int64]) -> NDArray[np.uint8]:
    """(v, DIRECTIONS/8) bits of `Visibility.arrives`."""
    normals = shape.normals.reshape(-1, 3)[first]
    lifted = shape.points.reshape(-1, 3)[first] + normals * (6.0 * shape.subject.radius / MAP)
    lit = np.empty(len(first), np.float32)
    found = np.zeros((len(first), DIRECTIONS), bool)
    for k, towards in enumerate(sky_directions()):
        matrix, depth = shadow_map(shape.points, towards, MAP)
        at: Any = lifted @ matrix[:, :3].T + matrix[:, 3]
        reached(depth, *(np.ascontiguousarray(at[:, x], np.float32) for x in range(3)), lit)
        found[:, k] = lit > 0.5
    return np.packbits(found, axis=1)
