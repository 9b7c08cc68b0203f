"""Tangents in the convention of MikkTSpace, [Mikkelsen2008]: what normal maps are relative to.

The tangent of a corner is the mean of the directions of growing u of the triangles that share its
point, normal, UV and handedness, each made perpendicular to the normal and weighted by the angle at
the corner. The bitangent is never kept: it is sign * cross(normal, tangent).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.garment import Garment

Floats = NDArray[np.float64]


def corner_tangents(garment: Garment) -> Floats:
    """(m, 3, 4) unit tangents at the corners, and in the fourth place the bitangent's sign."""
    corners = garment.points[garment.triangles]
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d1, d2 = garment.uv[:, 1] - garment.uv[:, 0], garment.uv[:, 2] - garment.uv[:, 0]
    sign = np.where(garment.mirrored, -1.0, 1.0)
    along = (e1 * d2[:, 1:] - e2 * d1[:, 1:]) * sign[:, None]
    normals = garment.normals
    flat = _unit(along[:, None] - normals * _dot(along[:, None], normals))
    group = _groups(garment)
    total = np.zeros((int(group.max(initial=0)) + 1, 3))
    for k in range(3):
        weight = _angle_at(corners, normals, k)[:, None]
        np.add.at(total, group[:, k], flat[:, k] * weight)
    mean = _unit(total[group])
    # Where directions cancel out, the corner keeps its own.
    mean = np.where(np.linalg.norm(total[group], axis=-1, keepdims=True) > 1e-12, mean, flat)
    return np.concatenate((mean, np.repeat(sign[:, None, None], 3, axis=1)), axis=-1)


def _groups(garment: Garment) -> NDArray[np.int64]:
    """(m, 3) number of each corner's group: same point, normal, UV and handedness."""
    m = len(garment.triangles)
    places = np.unique(
        garment.points[garment.triangles].reshape(-1, 3), axis=0, return_inverse=True
    )
    rows = np.column_stack(
        (
            places[1].reshape(-1),
            np.round(garment.normals.reshape(-1, 3) * 1e5),
            np.round(garment.uv.reshape(-1, 2) * 1e7),
            np.repeat(garment.mirrored, 3),
        )
    )
    return np.unique(rows, axis=0, return_inverse=True)[1].reshape(m, 3)


def _angle_at(corners: Floats, normals: Floats, k: int) -> Floats:
    """(m,) angle at corner k between its edges, seen along the corner's normal."""
    normal = normals[:, k]
    a = corners[:, (k + 1) % 3] - corners[:, k]
    b = corners[:, (k + 2) % 3] - corners[:, k]
    a, b = _unit(a - normal * _dot(a, normal)), _unit(b - normal * _dot(b, normal))
    return np.asarray(np.arccos(np.clip(_dot(a, b)[:, 0], -1.0, 1.0)))


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray((a * b).sum(axis=-1, keepdims=True))


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300))
