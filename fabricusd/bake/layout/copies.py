"""Which meshes are copies of one another: the same triangles, UVs and points, moved or turned.

A mirrored copy is another mesh: its normals and tangents are of the other hand. So is a scaled one:
its cloth has another number of threads.
"""

from __future__ import annotations

import hashlib
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.scene import Mesh

SAME = 1e-6
"""Distance, over a mesh's extent, within which two points are one: single precision moves a point
by a tenth of it."""

SAME_NORMAL = 1e-4
"""Difference of unit normals that are one."""


def topology(mesh: Mesh) -> str:
    """A digest that copies have in common; meshes that differ in shape alone have it as well."""
    digest = hashlib.sha256()
    for array in (mesh.triangles, mesh.uv, mesh.material):
        if array is not None:
            whole = np.ascontiguousarray(array)
            digest.update(f"{whole.dtype} {whole.shape}".encode())
            digest.update(whole.data)
    digest.update(f"{mesh.smooth} {mesh.normals is None} {mesh.origin}".encode())
    return digest.hexdigest()


def are_copies(a: Mesh, b: Mesh, *, turned: bool = True) -> bool:
    """Whether `b`, which has the `topology` of `a`, is `a` moved and turned, point by point.

    turned : whether a turned mesh is a copy as well, or one that was moved alone
    """
    turn = _turn(a, b, turned=turned)
    if turn is None or a.normals is None or b.normals is None:
        return turn is not None
    return bool(np.abs(np.asarray(a.normals) @ turn - b.normals).max(initial=0.0) <= SAME_NORMAL)


class Shape(Protocol):
    """Triangles in space, as meshes and garments have them."""

    @property
    def points(self) -> NDArray[np.float64]:
        """(n, 3) [m]."""

    @property
    def triangles(self) -> NDArray[Any]:
        """(m, 3) int."""


class Laid(Shape, Protocol):
    """A shape that lies in UV: a garment."""

    @property
    def uv(self) -> NDArray[np.float64]:
        """(m, 3, 2) float64."""

    @property
    def lay(self) -> NDArray[np.int32]:
        """(m,) int - which of its lays a triangle has."""


def are_alike(a: Laid, b: Laid) -> bool:
    """Whether two garments are one that was moved and turned, in the same UVs."""
    same_uv = a.uv.shape == b.uv.shape and np.array_equal(a.uv, b.uv)
    same = same_uv and np.array_equal(a.triangles, b.triangles) and np.array_equal(a.lay, b.lay)
    return bool(same) and _turn(a, b, turned=True) is not None


def _turn(a: Shape, b: Shape, *, turned: bool) -> NDArray[np.float64] | None:
    """(3, 3) rotation that brings the points of `a` to those of `b`; None where none does."""
    # Points that no triangle has do not show.
    used = np.unique(a.triangles)
    if used.max(initial=-1) >= len(b.points):
        return None
    p, q = (np.asarray(shape.points, np.float64)[used] for shape in (a, b))
    if not (np.isfinite(p).all() and np.isfinite(q).all()):
        return None
    p, q = p - p.mean(axis=0), q - q.mean(axis=0)
    extent = float(np.ptp(p, axis=0).max(initial=0.0))
    turn = _rotation(p / max(extent, 1e-300), q / max(extent, 1e-300)) if turned else np.eye(3)
    return turn if np.abs(p @ turn - q).max(initial=0.0) <= SAME * extent else None


def _rotation(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) proper rotation R that brings p @ R nearest to q, both (n, 3) about their means.

    [Kabsch1976], with the sign of [Kabsch1978] so that nothing is mirrored.
    """
    u, _, vt = np.linalg.svd(p.T @ q)
    hand = np.sign(np.linalg.det(u @ vt))
    return np.asarray(u @ np.diag((1.0, 1.0, hand)) @ vt)
