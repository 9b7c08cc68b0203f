"""Polygons cut into triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def triangulate(
    points: NDArray[np.float64], counts: NDArray[np.int64], indices: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangles of polygons with `counts` corners each, which are `indices` into `points`.

    Returns the polygon that each triangle comes from, (m,), and the positions of its corners in
    `indices`, (m, 3), in the polygon's own winding. Triangles and quads fan out from their first
    corner, a quad with a reflex corner from that one; larger polygons lose one ear after another.
    Polygons of fewer than three corners are left out.
    """
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    faces: list[NDArray[Any]] = []
    corners: list[NDArray[Any]] = []
    for size in np.unique(counts):
        which = np.flatnonzero(counts == size)
        first = starts[which]
        if size == 3:
            faces.append(which)
            corners.append(first[:, None] + np.arange(3))
        elif size == 4:
            turn = _better_diagonal(points[indices[first[:, None] + np.arange(4)]])
            for k in (1, 2):
                faces.append(which)
                fan = np.stack([turn, (turn + k) % 4, (turn + k + 1) % 4], axis=1)
                corners.append(first[:, None] + fan)
        elif size > 4:
            for polygon, begin in zip(which, first, strict=True):
                ears = _cut_ears(points[indices[begin : begin + size]])
                faces.append(np.full(len(ears), polygon))
                corners.append(begin + ears)
    if not faces:
        return np.zeros(0, np.int64), np.zeros((0, 3), np.int64)
    face, corner = np.concatenate(faces), np.concatenate(corners)
    order = np.argsort(face, kind="stable")
    return face[order], corner[order]


def _better_diagonal(quads: NDArray[np.float64]) -> NDArray[np.int64]:
    """(n, 4, 3) -> (n,) 1 where the quad must be cut from its second corner, else 0."""
    a, b, c, d = (quads[:, k] for k in range(4))
    first = np.einsum("ij,ij->i", np.cross(b - a, c - a), np.cross(c - a, d - a))
    other = np.einsum("ij,ij->i", np.cross(c - b, d - b), np.cross(d - b, a - b))
    return ((first < 0) & (other > first)).astype(np.int64)


def _cut_ears(polygon: NDArray[np.float64]) -> NDArray[np.int64]:
    """(k, 3) -> (k-2, 3) corner numbers: ears of the polygon in its mean plane."""
    if not np.isfinite(polygon).all():
        n = len(polygon)
        return np.stack([np.zeros(n - 2, int), np.arange(1, n - 1), np.arange(2, n)], axis=1)
    following = np.roll(polygon, -1, axis=0)
    normal = np.cross(polygon, following).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(polygon, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):
        flat = flat * (1.0, -1.0)
    left = list(range(len(polygon)))
    ears = []
    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            if _is_ear(flat, a, b, c, left):
                break
        else:
            # A polygon that crosses itself has no ear; any corner must do.
            k = 0
            a, b, c = left[-1], left[0], left[1]
        ears.append((a, b, c))
        del left[k]
    ears.append((left[0], left[1], left[2]))
    return np.array(ears, np.int64)


def _is_ear(flat: NDArray[np.float64], a: int, b: int, c: int, left: list[int]) -> bool:
    """Whether the triangle a, b, c is convex and holds no other corner."""
    if _turn(flat[a], flat[b], flat[c]) <= 0:
        return False
    for p in left:
        if p in (a, b, c):
            continue
        q = flat[p]
        if (
            _turn(flat[a], flat[b], q) >= 0
            and _turn(flat[b], flat[c], q) >= 0
            and _turn(flat[c], flat[a], q) >= 0
        ):
            return False
    return True


def _turn(a: Any, b: Any, c: Any) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
