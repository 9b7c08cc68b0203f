"""Instanced meshes as copies, for what cannot place one mesh several times."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.placements import is_mirroring
from fabricusd.scene.scene import Mesh, Scene


def copies_of(mesh: Mesh) -> list[Mesh]:
    """A mesh for each place of `mesh`, as if it had been modelled there."""
    if mesh.placements is None:
        return [mesh]
    found = mesh.placements
    return [
        _copy(mesh, transform, found.paths[path])
        for transform, path in zip(found.transforms, found.path_of.tolist(), strict=True)
    ]


def _copy(mesh: Mesh, transform: NDArray[np.float64], path: str) -> Mesh:
    linear = transform[:, :3]
    points = mesh.points @ linear.T + transform[:, 3]
    triangles, normals, uv = np.asarray(mesh.triangles), mesh.normals, mesh.uv
    if normals is not None:
        normals = np.asarray(normals, np.float32) @ np.linalg.inv(linear).astype(np.float32)
    if is_mirroring(linear):
        triangles = triangles[:, ::-1]
        normals = None if normals is None else normals[:, ::-1]
        uv = None if uv is None else uv[:, ::-1]
    return replace(
        mesh, path=path, points=points, triangles=triangles, normals=normals, uv=uv,
        placements=None,
    )  # fmt: skip


def with_copies(scene: Scene) -> Scene:
    """The scene with a copy for each instance; itself where it has none."""
    if all(mesh.placements is None for mesh in scene.meshes):
        return scene
    return replace(scene, meshes=[copy for mesh in scene.meshes for copy in copies_of(mesh)])
