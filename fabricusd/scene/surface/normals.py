"""Computes smooth normals of triangles, groups coincident points, and measures the scale of UVs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

PART = 1 << 16
"""Number of triangles that are processed at once."""


SAME = 2e-6
"""Side of the cells, over the mesh's extent, in which points count as one place. Rounding to single
precision moves a point by a twentieth of it."""


CREASE = math.radians(40.0)
"""Half of the largest angle of a smooth fold: two faces that share an edge belong to one smooth
surface if they are folded by up to 80 degrees."""


def _unit(v: NDArray[Any], instead: NDArray[Any]) -> NDArray[Any]:
    """Normalize `v`; where `v` has no length or is not finite, normalize `instead`."""
    length = _length(v)[..., None]
    good = np.isfinite(length) & (length > 1e-12)
    if good.all():
        return np.asarray(v / length)
    other = instead / np.maximum(_length(instead)[..., None], 1e-30)
    return np.where(good, v / np.where(good, length, 1.0), other)


def _length(v: NDArray[Any]) -> NDArray[Any]:
    """Euclidean length along the last axis, in a third of the time of `numpy.linalg.norm`."""
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", v, v)))


def _parts(count: int) -> list[slice]:
    """Slices of at most PART triangles, so that temporary arrays stay small."""
    return [slice(k, min(k + PART, count)) for k in range(0, count, PART)]


def smooth_normals(points: NDArray[Any], tri: NDArray[Any]) -> NDArray[np.float32]:
    """(m, 3, 3) unit normals at the corners: the mean over the faces around a point, weighted by
    their angles there.

    Coincident points count as one, so a UV seam does not become a crease. Where the faces around a
    point do not form one smooth surface, as along the edge of a box or the rim of a cylinder, each
    corner averages the faces that can be reached from it without crossing a crease.
    """
    place = _same_places(points)
    total = np.zeros((int(place.max(initial=0)) + 1, 3))
    for part in _parts(len(tri)):
        corners, shared = points[tri[part]], place[tri[part]]
        face = _face_normals(corners)
        for k in range(3):
            _add_at(total, shared[:, k], _angle_at(corners, k)[:, None] * face)
    normals = np.empty((len(tri), 3, 3), np.float32)
    creased = np.zeros(len(total), bool)
    for part in _parts(len(tri)):
        face, shared = _face_normals(points[tri[part]]), place[tri[part]]
        normals[part] = mean = _unit(total[shared], face[:, None])
        cosine = np.einsum("mkc,mc->mk", mean, face)
        creased[shared[cosine < math.cos(CREASE)]] = True
    if creased.any():
        corners = np.argwhere(creased[place[tri]])
        normals[corners[:, 0], corners[:, 1]] = _between_creases(points, tri, place, corners)
    return normals


def _between_creases(
    points: NDArray[Any], tri: NDArray[Any], place: NDArray[np.int64], corners: NDArray[np.int64]
) -> NDArray[Any]:
    """(k, 3) unit normals at `corners`, (k, 2) pairs of triangle and corner number.

    All corners at a place must be given. Two corners belong to the same surface if their triangles
    share an edge and are folded there by less than twice CREASE.
    """
    which, k = corners.T
    shape = points[tri[which]]
    face = _face_normals(shape)
    here = place[tri[which, k]]
    group = np.arange(len(which))
    edges = [(here, place[tri[which, (k + step) % 3]]) for step in (1, 2)]
    edge = group_numbers(*(np.concatenate(ends) for ends in zip(*edges, strict=True)))
    order = np.argsort(edge, kind="stable")
    one, other = order[:-1], order[1:]
    both = edge[one] == edge[other]
    one, other = one[both] % len(which), other[both] % len(which)
    smooth = np.einsum("ij,ij->i", face[one], face[other]) > math.cos(2 * CREASE)
    one, other = one[smooth], other[smooth]
    while (group[one] != group[other]).any():
        # Pass the smaller group number to the neighbour and to everything in the neighbour's group.
        least = np.minimum(group[one], group[other])
        for end in (one, other):
            np.minimum.at(group, group[end], least)
        group = group[group]
    angle = np.empty(len(which))
    for corner in range(3):
        mine = k == corner
        angle[mine] = _angle_at(shape[mine], corner)
    total = np.zeros((len(which), 3))
    _add_at(total, group, angle[:, None] * face)
    return _unit(total[group], face)


def _angle_at(corners: NDArray[Any], k: int) -> NDArray[Any]:
    """(n,) angle [rad] at corner `k` of triangles with (n, 3, 3) corners."""
    a = corners[:, (k + 1) % 3] - corners[:, k]
    b = corners[:, (k + 2) % 3] - corners[:, k]
    return np.arctan2(_length(np.cross(a, b)), np.einsum("ij,ij->i", a, b))


def _add_at(total: NDArray[Any], index: NDArray[np.int64], vectors: NDArray[Any]) -> None:
    """`total[index] += vectors` for (n, 3) vectors; also correct for repeated indices.

    Only the rows between the lowest and the highest index are gone over: a mesh is added part by
    part, and its parts mostly lie together.
    """
    if not len(index):
        return
    low, high = int(index.min()), int(index.max()) + 1
    for axis in range(3):
        total[low:high, axis] += np.bincount(index - low, vectors[:, axis], high - low)


def _face_normals(corners: NDArray[Any]) -> NDArray[Any]:
    """(n, 3, 3) corners -> (n, 3) unit normals."""
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return _unit(face, face)


def _same_places(points: NDArray[Any]) -> NDArray[np.int64]:
    """(n,) number of each point's place; points within a few millionths of the extent share one.

    Uses two grids of cells, the second shifted by half a cell: coincident points that rounding puts
    into different cells of one grid lie in the same cell of the other.
    """
    extent = float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0
    at = (points - points.min(axis=0, initial=np.inf)) / max(extent * SAME, 1e-12)
    place, shifted = (
        group_numbers(*np.floor(at + shift).astype(np.int64).T) for shift in (0.5, 1.0)
    )
    while True:
        joined = _smallest_of_each(shifted, place)
        joined = _smallest_of_each(place, joined)
        if np.array_equal(joined, place):
            return place
        place = joined


def _smallest_of_each(group: NDArray[np.int64], value: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) for each entry, the smallest `value` in its `group`."""
    smallest = np.full(int(group.max(initial=-1)) + 1, np.iinfo(np.int64).max)
    np.minimum.at(smallest, group, value)
    return smallest[group]


def group_numbers(*columns: NDArray[Any]) -> NDArray[np.int64]:
    """(n,) a number for each entry, equal if and only if all integer `columns` are equal."""
    key = np.zeros(len(columns[0]), np.int64)
    size = 1
    for column in columns:
        low = int(column.min(initial=0))
        span = int(column.max(initial=0)) - low + 1
        if size * span >= 1 << 63:
            known, key = np.unique(key, return_inverse=True)
            size = len(known)
        key = key * span + (column - low)
        size *= span
    return np.unique(key, return_inverse=True)[1].reshape(-1)


def measured_scale(uv: NDArray[np.float64], area2: NDArray[Any]) -> float:
    """Metres of cloth per UV unit, from the ratio of areas; 0 if the UVs have no area."""
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    flat = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
    solid = np.linalg.norm(area2, axis=1).sum(dtype=np.float64)
    return float(np.sqrt(solid / flat)) if flat > 0 else 0.0
