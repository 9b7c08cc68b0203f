"""Compute tangents for normal maps, in the convention of MikkTSpace [Mikkelsen2008].

The tangent of a corner is a mean over the triangles that share its point, normal, UV and
handedness. Each triangle contributes its direction of increasing u, made perpendicular to the
normal and weighted by its angle at the corner. The bitangent is not stored: it is
sign * cross(normal, tangent).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.layout.equal_rows import numbered_rows
from fabricusd.bake.layout.garment import Garment, parts_of

Floats = NDArray[np.float64]


def corner_tangents(garment: Garment) -> NDArray[np.float32]:
    """(m, 3, 4) unit tangents at the corners; the fourth number is the bitangent's sign."""
    m = len(garment.triangles)
    parts = parts_of(m)
    group = _groups(garment)
    total = np.zeros((int(group.max(initial=0)) + 1, 3))
    weighted = np.empty((m, 3))
    for k in range(3):
        for part in parts:
            normals = garment.normals[part].astype(np.float64)
            weight = _angle_at(garment.points[garment.triangles[part]], normals, k)
            weighted[part] = _flat(garment, part, normals)[:, k] * weight[:, None]
        for axis in range(3):
            total[:, axis] += np.bincount(group[:, k], weighted[:, axis], len(total))
    del weighted
    out = np.empty((m, 3, 4), np.float32)
    for part in parts:
        summed = total[group[part]]
        flat = _flat(garment, part, garment.normals[part].astype(np.float64))
        # If the directions cancel out, the corner keeps its own.
        cancel = np.linalg.norm(summed, axis=-1, keepdims=True) <= 1e-12
        out[part, :, :3] = np.where(cancel, flat, _unit(summed))
        out[part, :, 3] = _sign(garment, part)[:, None]
    return out


def _flat(garment: Garment, part: slice, normals: Floats) -> Floats:
    """(n, 3, 3) directions of increasing u, perpendicular to the normal of each corner."""
    corners, uv = garment.points[garment.triangles[part]], garment.uv[part]
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    along = ((e1 * d2[:, 1:] - e2 * d1[:, 1:]) * _sign(garment, part)[:, None])[:, None]
    return _unit(along - normals * _dot(along, normals))


def _sign(garment: Garment, part: slice) -> Floats:
    """(n,) handedness of the UVs: 1, or -1 if they are mirrored."""
    return np.where(garment.mirrored[part], -1.0, 1.0)


def _groups(garment: Garment) -> NDArray[np.int32]:
    """(m, 3) number of each corner's group: corners with equal point, normal, UV and handedness."""
    place = numbered_rows(_bits(garment.points))[1]

    def columns() -> Iterator[NDArray[Any]]:
        yield place[garment.triangles].ravel()
        for axis in range(3):
            yield np.rint(garment.normals[..., axis].ravel() * np.float32(1e5)).astype(np.int32)
        for axis in range(2):
            yield from _bits(np.round(garment.uv[..., axis].ravel() * 1e7)[:, None])
        yield np.repeat(garment.mirrored, 3).astype(np.int32)

    return numbered_rows(columns())[1].reshape(-1, 3)


def _bits(rows: Floats) -> Iterator[NDArray[np.uint32]]:
    """Yield the two 32-bit halves of each column of (n, c) float64 numbers."""
    for column in rows.T:
        # Adding 0 turns -0 into 0.
        halves = np.ascontiguousarray(column + 0.0, np.float64).view(np.uint32).reshape(-1, 2)
        yield halves[:, 0]
        yield halves[:, 1]


def _angle_at(corners: Floats, normals: Floats, k: int) -> Floats:
    """(n,) angle between the edges at corner k, projected along the corner's normal."""
    normal = normals[:, k]
    a = corners[:, (k + 1) % 3] - corners[:, k]
    b = corners[:, (k + 2) % 3] - corners[:, k]
    a, b = _unit(a - normal * _dot(a, normal)), _unit(b - normal * _dot(b, normal))
    return np.asarray(np.arccos(np.clip(_dot(a, b)[:, 0], -1.0, 1.0)))


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray((a * b).sum(axis=-1, keepdims=True))


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300))
