"""Rasterise a UV layout conservatively: find covered texels, margins and overlaps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from fabricusd.kernels.real import KERNEL

NOBODY = -1
"""Owner of a texel that no triangle touches."""

FIRM = 1e-3
"""Distance [texels] by which a texel's centre must lie inside two triangles to count as an overlap.
Neighbours with a common edge whose corners were rounded differently do not overlap then."""


def texel_triangles(
    uv: NDArray[np.float64], tile: tuple[int, int], resolution: int
) -> NDArray[np.float64]:
    """(m, 3, 2) texel coordinates of UVs in a tile: x to the right, y down from the top row."""
    place = (uv - np.array(tile, np.float64)) * resolution
    return np.stack((place[..., 0], resolution - place[..., 1]), axis=-1)


def owners(
    corners: NDArray[np.float64],
    values: NDArray[np.int32],
    window: tuple[int, int, int, int],
    margin: int,
    resolution: int,
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """(h, w) owner of each texel of a window, margins included, and mask of touched texels.

    corners : (m, 3, 2) float64 - triangles in texels
    values : (m,) int - owner to write for each triangle
    window : (x0, y0, x1, y1) - texels in [x0, x1) and [y0, y1)

    A texel that several triangles touch belongs to the triangle closest to its centre, then to the
    first. An untouched texel within `margin` of a touched one takes that one's owner.
    """
    x0, y0, x1, y1 = window
    left, top = max(0, x0 - margin), max(0, y0 - margin)
    right, bottom = min(resolution, x1 + margin), min(resolution, y1 + margin)
    shape = (bottom - top, right - left)
    owner = np.full(shape, NOBODY, np.int32)
    low, high = corners.min(axis=1), corners.max(axis=1)
    near = (low <= (right, bottom)).all(axis=1) & (high >= (left, top)).all(axis=1)
    if near.any():
        distance = np.full(shape, np.inf, np.float32)
        _cover(np.ascontiguousarray(corners[near]), values[near], left, top, owner, distance)
    touched = owner != NOBODY
    if margin and touched.any() and not touched.all():
        far, where = distance_transform_edt(~touched, return_indices=True)
        owner = np.where(far <= margin, owner[tuple(where)], NOBODY)
    inner = (slice(y0 - top, y1 - top), slice(x0 - left, x1 - left))
    return np.ascontiguousarray(owner[inner]), np.ascontiguousarray(touched[inner])


def times_covered(
    corners: NDArray[np.float64], shape: tuple[int, int]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """(h, w) number of triangles over each texel's centre; (k, 2) first pairs that overlap."""
    count = np.zeros(shape, np.int32)
    first = np.full(shape, -1, np.int32)
    pairs = np.full((16, 2), -1, np.int32)
    _count(np.ascontiguousarray(corners), count, first, pairs)
    return count, pairs[pairs[:, 0] >= 0]


@njit(**KERNEL)
def _outward(tri, k):  # type: ignore[no-untyped-def]
    """Return the outward unit normal (x, y) and the offset of edge k of a triangle (3, 2).

    All are 0 for an edge of zero length.
    """
    x0, y0 = tri[k, 0], tri[k, 1]
    n = (k + 1) % 3
    dx, dy = tri[n, 0] - x0, tri[n, 1] - y0
    o = (k + 2) % 3
    length = np.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return 0.0, 0.0, 0.0
    nx, ny = dy / length, -dx / length
    if nx * (tri[o, 0] - x0) + ny * (tri[o, 1] - y0) > 0.0:
        nx, ny = -nx, -ny
    return nx, ny, nx * x0 + ny * y0


@njit(**KERNEL)
def _to_triangle(tri, x, y):  # type: ignore[no-untyped-def]
    """Return the distance of a point outside a triangle to its border [texels]."""
    best = np.inf
    for k in range(3):
        n = (k + 1) % 3
        ex, ey = tri[n, 0] - tri[k, 0], tri[n, 1] - tri[k, 1]
        px, py = x - tri[k, 0], y - tri[k, 1]
        square = ex * ex + ey * ey
        t = 0.0 if square == 0.0 else min(1.0, max(0.0, (px * ex + py * ey) / square))
        best = min(best, np.hypot(px - t * ex, py - t * ey))
    return best


@njit(**KERNEL)
def _cover(corners, values, left, top, owner, distance):  # type: ignore[no-untyped-def]
    """Write the owner of every texel that a triangle touches, however slightly."""
    height, width = owner.shape
    edges = np.empty((3, 3))
    for m in range(corners.shape[0]):
        tri = corners[m]
        for k in range(3):
            edges[k, 0], edges[k, 1], edges[k, 2] = _outward(tri, k)
        ax = max(0, int(np.floor(min(tri[0, 0], tri[1, 0], tri[2, 0]))) - left)
        bx = min(width - 1, int(np.floor(max(tri[0, 0], tri[1, 0], tri[2, 0]))) - left)
        ay = max(0, int(np.floor(min(tri[0, 1], tri[1, 1], tri[2, 1]))) - top)
        by = min(height - 1, int(np.floor(max(tri[0, 1], tri[1, 1], tri[2, 1]))) - top)
        for j in range(ay, by + 1):
            y = top + j + 0.5
            for i in range(ax, bx + 1):
                x = left + i + 0.5
                worst, outside = -np.inf, False
                for k in range(3):
                    away = edges[k, 0] * x + edges[k, 1] * y - edges[k, 2]
                    # A unit square extends (|nx| + |ny|)/2 from its centre towards an edge.
                    outside |= away > 0.5 * (abs(edges[k, 0]) + abs(edges[k, 1]))
                    worst = max(worst, away)
                if outside:
                    continue
                d = 0.0 if worst <= 0.0 else np.float32(_to_triangle(tri, x, y))
                if d < distance[j, i]:
                    distance[j, i] = d
                    owner[j, i] = values[m]


@njit(**KERNEL)
def _count(corners, count, first, pairs):  # type: ignore[no-untyped-def]
    """Count the triangles that contain each texel's centre by at least FIRM."""
    height, width = count.shape
    edges = np.empty((3, 3))
    found = 0
    for m in range(corners.shape[0]):
        tri = corners[m]
        for k in range(3):
            edges[k, 0], edges[k, 1], edges[k, 2] = _outward(tri, k)
        ax = max(0, int(np.floor(min(tri[0, 0], tri[1, 0], tri[2, 0]))))
        bx = min(width - 1, int(np.floor(max(tri[0, 0], tri[1, 0], tri[2, 0]))))
        ay = max(0, int(np.floor(min(tri[0, 1], tri[1, 1], tri[2, 1]))))
        by = min(height - 1, int(np.floor(max(tri[0, 1], tri[1, 1], tri[2, 1]))))
        for j in range(ay, by + 1):
            for i in range(ax, bx + 1):
                worst = -np.inf
                for k in range(3):
                    worst = max(
                        worst, edges[k, 0] * (i + 0.5) + edges[k, 1] * (j + 0.5) - edges[k, 2]
                    )
                if worst > -FIRM:
                    continue
                count[j, i] += 1
                if count[j, i] == 1:
                    first[j, i] = m
                elif found < pairs.shape[0]:
                    other = first[j, i]
                    if found == 0 or pairs[found - 1, 0] != other or pairs[found - 1, 1] != m:
                        pairs[found, 0], pairs[found, 1] = other, m
                        found += 1


def overlap_map(corners: NDArray[np.float64], size: int) -> NDArray[Any]:
    """(size, size, 3) uint8 picture of a UV layout: covered texels grey, overlaps red."""
    count, _ = times_covered(corners, (size, size))
    picture = np.full((size, size, 3), 32, np.uint8)
    picture[count == 1] = (128, 128, 128)
    picture[count > 1] = (255, 40, 20)
    return picture
