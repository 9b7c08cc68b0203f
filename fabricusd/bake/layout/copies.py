"""Find meshes that are copies: with the same triangles, UVs and points, translated or rotated.

A mirrored mesh is not a copy, because the handedness of its normals and tangents differs. Neither
is a scaled one, because its cloth has a different number of threads.
"""

from __future__ import annotations

import hashlib
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.scene import Mesh

SAME = 1e-6
"""Distance, relative to a mesh's extent, within which two points are the same. The rounding of
single precision is a tenth of it."""

SAME_NORMAL = 1e-4
"""Largest difference of unit normals that count as the same."""


def topology(mesh: Mesh) -> str:
    """Return a digest that is equal for copies, and for meshes that differ only in their points."""
    digest = hashlib.sha256()
    for array in (mesh.triangles, mesh.uv, mesh.material):
        if array is not None:
            whole = np.ascontiguousarray(array)
            digest.update(f"{whole.dtype} {whole.shape}".encode())
            digest.update(whole.data)
    digest.update(f"{mesh.smooth} {mesh.normals is None} {mesh.origin}".encode())
    return digest.hexdigest()


def are_copies(a: Mesh, b: Mesh, *, turned: bool = True) -> bool:
    """Whether `b`, which must have the `topology` of `a`, is a translated and rotated copy of `a`.

    turned : whether a rotated mesh counts as a copy, or only a translated one
    """
    turn = _turn(a, b, turned=turned)
    if turn is None or a.normals is None or b.normals is None:
        return turn is not None
    return bool(np.abs(np.asarray(a.normals) @ turn - b.normals).max(initial=0.0) <= SAME_NORMAL)


class Shape(Protocol):
    """The triangles of a mesh or a garment."""

    @property
    def points(self) -> NDArray[np.float64]:
        """(n, 3) [m]."""

    @property
    def triangles(self) -> NDArray[Any]:
        """(m, 3) int."""


class Laid(Shape, Protocol):
    """A shape with UVs: a garment."""

    @property
    def uv(self) -> NDArray[np.float64]:
        """(m, 3, 2) float64."""

    @property
    def lay(self) -> NDArray[np.int32]:
        """(m,) int - index of the lay of each triangle."""


def are_alike(a: Laid, b: Laid) -> bool:
    """Whether two garments with the same UVs are translated and rotated copies of each other."""
    same_uv = a.uv.shape == b.uv.shape and np.array_equal(a.uv, b.uv)
    same = same_uv and np.array_equal(a.triangles, b.triangles) and np.array_equal(a.lay, b.lay)
    return bool(same) and _turn(a, b, turned=True) is not None


def _turn(a: Shape, b: Shape, *, turned: bool) -> NDArray[np.float64] | None:
    """(3, 3) rotation that maps the points of `a` to those of `b`; None if there is none."""
    # Ignore points that no triangle uses.
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
    """(3, 3) proper rotation R that brings p @ R closest to q, both (n, 3) relative to their means.

    [Kabsch1976], with the sign of [Kabsch1978] to exclude reflections.
    """
    u, _, vt = np.linalg.svd(p.T @ q)
    hand = np.sign(np.linalg.det(u @ vt))
    return np.asarray(u @ np.diag((1.0, 1.0, hand)) @ vt)
