"""Triangulates polygons."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

PART = 1 << 20
"""Number of corners that are processed at once."""


def triangulate(
    points: NDArray[np.float64], counts: NDArray[np.int64], indices: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangulate polygons with `counts` corners each; `indices` holds the corners' points.

    Returns the polygon that each triangle comes from, (m,), and the positions of its corners in
    `indices`, (m, 3), in the polygon's own winding. Triangles, quads and convex polygons are cut
    into a fan around their first corner; a quad with a reflex corner, around that corner. Other
    polygons are cut by ear clipping. Polygons with fewer than three corners are left out.
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
            convex = _are_convex(points, indices, first, int(size))
            fan = np.arange(1, size - 1)
            fan = np.stack([np.zeros_like(fan), fan, fan + 1], axis=1)
            faces.append(np.repeat(which[convex], size - 2))
            corners.append((first[convex][:, None, None] + fan).reshape(-1, 3))
            for polygon, begin in zip(which[~convex], first[~convex], strict=True):
                ears = _cut_ears(points[indices[begin : begin + size]])
                faces.append(np.full(len(ears), polygon))
                corners.append(begin + ears)
    if not faces:
        return np.zeros(0, np.int64), np.zeros((0, 3), np.int64)
    face, corner = np.concatenate(faces), np.concatenate(corners)
    order = np.argsort(face, kind="stable")
    return face[order], corner[order]


def _better_diagonal(quads: NDArray[np.float64]) -> NDArray[np.int64]:
    """(n,) 1 if the (n, 4, 3) quad must be cut from its second corner, else 0."""
    a, b, c, d = (quads[:, k] for k in range(4))
    first = np.einsum("ij,ij->i", np.cross(b - a, c - a), np.cross(c - a, d - a))
    other = np.einsum("ij,ij->i", np.cross(c - b, d - b), np.cross(d - b, a - b))
    return ((first < 0) & (other > first)).astype(np.int64)


def _are_convex(
    points: NDArray[np.float64], indices: NDArray[np.int64], first: NDArray[np.int64], size: int
) -> NDArray[np.bool_]:
    """(n,) which polygons of `size` corners turn left at every corner and go around once."""
    convex = np.zeros(len(first), bool)
    with np.errstate(all="ignore"):
        for begin in range(0, len(first), max(PART // size, 1)):
            part = slice(begin, begin + max(PART // size, 1))
            at = points[indices[first[part, None] + np.arange(size)]]
            along = np.roll(at, -1, axis=1) - at
            turn = np.cross(np.roll(along, 1, axis=1), along)
            normal = np.cross(at - at[:, :1], along).sum(axis=1)
            normal /= np.linalg.norm(normal, axis=1)[:, None]
            out = np.einsum("nki,ni->nk", turn, normal)
            # The turns add up to one full turn, or to several if the polygon winds like a star.
            ahead = np.einsum("nki,nki->nk", np.roll(along, 1, axis=1), along)
            around = np.arctan2(out, ahead).sum(axis=1)
            least = 1e-9 * np.square(along).sum(axis=2).max(axis=1)
            convex[part] = (out > least[:, None]).all(axis=1) & (around < 3 * np.pi)
    return convex


def _cut_ears(polygon: NDArray[np.float64]) -> NDArray[np.int64]:
    """(k - 2, 3) corner numbers of a (k, 3) polygon's triangles, by ear clipping in its mean plane.

    Clips one ear after another on the way around. If a whole round finds no ear, the polygon
    crosses itself, and the rest is cut into a fan.
    """
    n = len(polygon)
    if not np.isfinite(polygon).all():
        return np.stack([np.zeros(n - 2, int), np.arange(1, n - 1), np.arange(2, n)], axis=1)
    centred = polygon - polygon[0]
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(centred, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):
        flat = flat * (1.0, -1.0)
    places = flat.tolist()
    before, after = [n - 1, *range(n - 1)], [*range(1, n), 0]
    # Only corners that turn right or go straight can lie inside an ear.
    reflex = {k for k in range(n) if _turn(places[before[k]], places[k], places[after[k]]) <= 0}
    array = np.array(sorted(reflex), np.int64)
    ears = []
    k, missed, left = 0, 0, n
    while left > 3 and missed < left:
        a, c = before[k], after[k]
        if k in reflex or _holds_another(flat, array, a, k, c):
            k, missed = c, missed + 1
            continue
        ears.append((a, k, c))
        after[a], before[c] = c, a
        left -= 1
        for corner in (a, c):
            if corner in reflex and (
                _turn(places[before[corner]], places[corner], places[after[corner]]) > 0
            ):
                reflex.remove(corner)
                array = array[array != corner]
        # Skip a corner: clipping neighbouring ears in a row makes slivers.
        k, missed = after[c], 0
    while left > 2:
        a, c = before[k], after[k]
        ears.append((a, k, c))
        after[a], before[c] = c, a
        k = c
        left -= 1
    return np.array(ears, np.int64)


def _holds_another(
    flat: NDArray[np.float64], others: NDArray[np.int64], a: int, b: int, c: int
) -> bool:
    """Whether one of the corners `others` lies in the triangle a, b, c or on its edges.

    Corners that coincide with a, b or c are ignored: where a cut joins a hole to the outline, the
    cut has two corners at each end.
    """
    q = flat[others]
    inside = np.ones(len(others), bool)
    for p, r in ((flat[a], flat[b]), (flat[b], flat[c]), (flat[c], flat[a])):
        along = r - p
        inside &= along[0] * (q[:, 1] - p[1]) - along[1] * (q[:, 0] - p[0]) >= 0
        inside &= (q != p).any(axis=1)
    return bool(inside.any())


def _turn(a: Any, b: Any, c: Any) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
