"""Which texels a UV layout covers: conservative rasterisation, margins, overlaps."""

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
"""Texels: a centre counts as covered twice only if it lies so far inside both triangles, so that
neighbours with a common edge, whose corners were rounded differently, do not overlap."""


def texel_triangles(
    uv: NDArray[np.float64], tile: tuple[int, int], resolution: int
) -> NDArray[np.float64]:
    """(m, 3, 2) UVs as texel coordinates of a tile: x to the right, y down from its top row."""
    place = (uv - np.array(tile, np.float64)) * resolution
    return np.stack((place[..., 0], resolution - place[..., 1]), axis=-1)


def owners(
    corners: NDArray[np.float64],
    values: NDArray[np.int32],
    window: tuple[int, int, int, int],
    margin: int,
    resolution: int,
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Whose each texel of a window is, margins included, and which texels triangles touch.

    corners : (m, 3, 2) float64 - triangles in texels
    values : (m,) int - what to write for a triangle
    window : (x0, y0, x1, y1) - texels from x0 to before x1, and so on

    A texel that several triangles touch goes to the one that its centre is nearest to, then to the
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
    """(h, w) how many triangles hold each texel's centre; (k, 2) pairs of the first overlaps."""
    count = np.zeros(shape, np.int32)
    first = np.full(shape, -1, np.int32)
    pairs = np.full((16, 2), -1, np.int32)
    _count(np.ascontiguousarray(corners), count, first, pairs)
    return count, pairs[pairs[:, 0] >= 0]


@njit(**KERNEL)
def _outward(tri, k):  # type: ignore[no-untyped-def]
    """Edge k of a triangle (3, 2): outward unit normal (x, y) and its offset; 0 for a point."""
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
    """Distance of a point to a triangle's border [texels], for points outside it."""
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
    """Write the owner of every texel that a triangle touches, however little."""
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
                    # A square reaches half of |nx| + |ny| towards an edge from its centre.
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
    """How many triangles hold each centre firmly."""
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
    """(size, size, 3) uint8 picture of a layout: covered texels grey, overlaps red."""
    count, _ = times_covered(corners, (size, size))
    picture = np.full((size, size, 3), 32, np.uint8)
    picture[count == 1] = (128, 128, 128)
    picture[count > 1] = (255, 40, 20)
    return picture
