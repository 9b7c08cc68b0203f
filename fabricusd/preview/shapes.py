"""The shapes that a preview shows cloth on: triangles with the normals and the grain at corners.

Cloth lies on a shape over a black lining: what passes through the cloth is lost.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Binding, Fabric
from fabricusd.scene.scene import Camera
from fabricusd.scene.studio import Subject, framing

Floats = NDArray[np.float64]

SWATCH = 0.012
"""Least width of a swatch [m]."""

WIDEST_SWATCH = 0.1
"""Width of the swatch of a large repeat [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """m triangles in metres, counter-clockwise from outside, y upwards.

    points, normals, tangents : (m, 3, 3) float64 - at the corners; tangents along +U
    hand : (m,) float64 - handedness of (U, V, N)
    metres : (m, 3, 2) float64 - place on the cloth [m]
    convex : bool - whether no part of it shadows another
    towards : (3,) - from the shape to the camera, of any length
    """

    points: Floats
    normals: Floats
    tangents: Floats
    hand: Floats
    metres: Floats
    convex: bool
    towards: tuple[float, float, float] = (0.45, 0.25, 1.0)

    def threads(self, fabric: Fabric) -> Floats:
        """(m, 3, 2) weave coordinates of cloth that lies on the shape at its measured scale."""
        return Binding(fabric=fabric, metres_per_uv=1.0).weave_coordinates(self.metres)

    @property
    def subject(self) -> Subject:
        """What a camera frames."""
        return Subject(low=self.points.min(axis=(0, 1)), high=self.points.max(axis=(0, 1)))

    def camera(self) -> Camera:
        """A camera that sees the whole shape in a square picture."""
        return framing(self.subject, np.array(self.towards), 1.0)


def _over_grid(
    points: Floats, along: Floats, up: Floats, metres: Floats, *, convex: bool, front: bool = False
) -> Shape:
    """The triangles of an (r, c) grid of points.

    along, up : (r, c, 3) - derivatives of the place by the first and the second index
    front : whether the shape is seen from straight before it
    """
    rows, columns = points.shape[:2]
    k = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = k[:-1, :-1].ravel(), k[1:, :-1].ravel(), k[1:, 1:].ravel(), k[:-1, 1:].ravel()
    corners = np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))
    normals = np.cross(along, up)

    def at(values: Floats, unit: bool = False) -> Floats:
        flat = values.reshape(rows * columns, -1)
        if unit:
            flat = flat / np.linalg.norm(flat, axis=1, keepdims=True)
        return np.ascontiguousarray(flat[corners], np.float64)

    return Shape(
        points=at(points), normals=at(normals, True), tangents=at(along, True),
        hand=np.ones(len(corners)), metres=at(metres), convex=convex,
        towards=(0.0, 0.0, 1.0) if front else Shape.towards,
    )  # fmt: skip


def cylinder(fabric: Fabric, radius: float = 0.05, height: float = 0.12) -> Shape:
    """An upright cylinder, u around it and v up."""
    turn, level = np.meshgrid(
        np.linspace(-math.pi, math.pi, 193), np.linspace(-0.5, 0.5, 13) * height, indexing="ij"
    )
    zero, one = np.zeros_like(turn), np.ones_like(turn)
    out = np.stack((np.sin(turn), zero, np.cos(turn)), axis=-1)
    points = radius * out + np.stack((zero, level, zero), axis=-1)
    along = np.stack((np.cos(turn), zero, -np.sin(turn)), axis=-1)
    up = np.stack((zero, one, zero), axis=-1)
    return _over_grid(points, along, up, np.stack((turn * radius, level), axis=-1), convex=True)


def sphere(fabric: Fabric, radius: float = 0.05) -> Shape:
    """A sphere without its poles: u along the parallels, v along the meridians."""
    turn, level = np.meshgrid(
        np.linspace(-math.pi, math.pi, 145), np.linspace(-0.495, 0.495, 73) * math.pi, indexing="ij"
    )
    c, s, zero = np.cos(level), np.sin(level), np.zeros_like(turn)
    points = radius * np.stack((np.sin(turn) * c, s, np.cos(turn) * c), axis=-1)
    along = np.stack((np.cos(turn), zero, -np.sin(turn)), axis=-1)
    up = np.stack((-np.sin(turn) * s, c, -np.cos(turn) * s), axis=-1)
    return _over_grid(points, along, up, radius * np.stack((turn, level), axis=-1), convex=True)


def swatch(fabric: Fabric) -> Shape:
    """A flat square: one repeat of the cloth, between SWATCH and WIDEST_SWATCH wide."""
    m, n = fabric.weave.cells.shape
    repeat = max(m * fabric.warp.pitch, n * fabric.weft.pitch)
    side = min(max(repeat, SWATCH), WIDEST_SWATCH)
    x, y = np.meshgrid(*2 * [np.linspace(-0.5, 0.5, 2) * side], indexing="ij")
    zero, one = np.zeros_like(x), np.ones_like(x)
    along, up = np.stack((one, zero, zero), axis=-1), np.stack((zero, one, zero), axis=-1)
    points, metres = np.stack((x, y, zero), axis=-1), np.stack((x, y), axis=-1)
    return _over_grid(points, along, up, metres, convex=True, front=True)


def drape(fabric: Fabric, size: float = 0.3, cells: int = 120) -> Shape:
    """A curtain that hangs from its upper edge in folds which deepen downwards."""
    line = np.linspace(-0.5, 0.5, cells + 1)
    s, t = np.meshgrid(line, line, indexing="ij")
    depth = 0.01 + 0.022 * (0.5 - t)
    first, second = 19.0 * s + 1.3 * t, 41.0 * s - 2.0 * t
    wave = np.sin(first) + 0.4 * np.sin(second)
    zero, whole = np.zeros_like(s), np.full_like(s, size)
    points = np.stack((size * s, size * t, depth * wave), axis=-1)
    across = depth * (19.0 * np.cos(first) + 16.4 * np.cos(second))
    down = depth * (1.3 * np.cos(first) - 0.8 * np.cos(second)) - 0.022 * wave
    along, up = np.stack((whole, zero, across), axis=-1), np.stack((zero, whole, down), axis=-1)
    step = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    length = np.concatenate((np.zeros((1, cells + 1)), np.cumsum(step, axis=0)))
    metres = np.stack((length - length[cells // 2], size * t), axis=-1)
    return _over_grid(points, along, up, metres, convex=False, front=True)


SHAPES: dict[str, Callable[[Fabric], Shape]] = {
    "cylinder": cylinder, "sphere": sphere, "swatch": swatch, "drape": drape,
}  # fmt: skip
