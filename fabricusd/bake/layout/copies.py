"""Which meshes are copies of one another: the same triangles, UVs and points, moved or turned.

A mirrored copy is another mesh: its normals and tangents are of the other hand. So is a scaled one:
its cloth has another number of threads.
"""

from __future__ import annotations

import hashlib

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
    # Points that no triangle has do not show.
    used = np.unique(a.triangles)
    p, q = (np.asarray(mesh.points, np.float64)[used] for mesh in (a, b))
    if not (np.isfinite(p).all() and np.isfinite(q).all()):
        return False
    p, q = p - p.mean(axis=0), q - q.mean(axis=0)
    extent = float(np.ptp(p, axis=0).max(initial=0.0))
    turn = _rotation(p / max(extent, 1e-300), q / max(extent, 1e-300)) if turned else np.eye(3)
    if not np.abs(p @ turn - q).max(initial=0.0) <= SAME * extent:
        return False
    if a.normals is None or b.normals is None:
        return True
    return bool(np.abs(np.asarray(a.normals) @ turn - b.normals).max(initial=0.0) <= SAME_NORMAL)


def _rotation(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) proper rotation R that brings p @ R nearest to q, both (n, 3) about their means.

    [Kabsch1976], with the sign of [Kabsch1978] so that nothing is mirrored.
    """
    u, _, vt = np.linalg.svd(p.T @ q)
    hand = np.sign(np.linalg.det(u @ vt))
    return np.asarray(u @ np.diag((1.0, 1.0, hand)) @ vt)
