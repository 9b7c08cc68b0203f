"""A scene of the user's as the preview draws it: the reference's own triangles, without bounces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.preview.shapes import Shape
from fabricusd.preview.surfaces import Cloth, Matte, Surface
from fabricusd.preview.tables import tables_of
from fabricusd.reference.rays.triangles import D1, D2, E1, E2, HAND, P0, ST, N, T, build_tables
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import Camera, FabricSurface, Material
from fabricusd.scene.studio import Subject, studio_camera

TURNED = {"Y": np.eye(3), "Z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])}
"""Rotations to the axes of a shape, in which y is up."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneShape:
    """What `picture.shaded` takes of a scene.

    st : (m, 3, 2) weave coordinates [threads]; material : (m,) index into surfaces
    """

    shape: Shape
    st: NDArray[np.float64]
    material: NDArray[np.int32]
    surfaces: list[Surface]
    fabrics: list[Fabric | None]
    camera: Camera
    notes: tuple[str, ...]

    def cloth(self, source: str) -> tuple[Fabric, Shape]:
        """The fabric that most triangles wear, and those triangles; FabricError without any."""
        counts = np.bincount(self.material, minlength=len(self.fabrics))
        worn = [k for k, fabric in enumerate(self.fabrics) if fabric is not None and counts[k]]
        if not worn:
            raise FabricError(source, "has no mesh that wears a fabric; name one with --fabric")
        best = max(worn, key=lambda k: int(counts[k]))
        fabric = self.fabrics[best]
        assert fabric is not None
        some = self.material == best
        metres = self.st[some] / np.array([fabric.warp.density, fabric.weft.density])
        parts = {
            name: getattr(self.shape, name)[some]
            for name in ("points", "normals", "tangents", "hand")
        }
        x, y, z = (float(w) for w in self.camera.frame[:3, 2])
        return fabric, Shape(**parts, metres=metres, convex=False, towards=(x, y, z))


def shape_of_scene(
    source: str, fabric: Fabric | None, camera: str | None, aspect: float, units: str | None
) -> SceneShape:
    """Read a USD or mesh file; fabric : worn by what wears none.

    aspect : width over height of the picture, for which the camera of a studio is placed where the
        scene has none

    Raises FabricError where the scene cannot be read, or has nothing to see.
    """
    scene = read_scene(source, fabric=fabric, camera=camera, units=units)
    table = build_tables(scene)
    r = table.records.astype(np.float64)
    if not len(r):
        raise FabricError(source, "has no triangles; a preview needs some")
    turn = TURNED[scene.up_axis]
    points = np.repeat(r[:, None, P0 : P0 + 3], 3, axis=1)
    points[:, 1] += r[:, E1 : E1 + 3]
    points[:, 2] += r[:, E2 : E2 + 3]
    points = (points + table.centre) @ turn.T
    st = np.repeat(r[:, None, ST : ST + 2], 3, axis=1)
    st[:, 1] += r[:, D1 : D1 + 2]
    st[:, 2] += r[:, D2 : D2 + 2]
    if len(table.home):
        st += table.home[:, None]

    def turned(first: int) -> NDArray[np.float64]:
        return np.ascontiguousarray(r[:, first : first + 9].reshape(-1, 3, 3) @ turn.T)

    shape = Shape(
        points=points, normals=turned(N), tangents=turned(T),
        hand=np.ascontiguousarray(r[:, HAND]), metres=st, convex=False,
    )  # fmt: skip
    return SceneShape(
        shape=shape, st=st, material=table.material,
        surfaces=[_surface(m) for m in scene.materials],
        fabrics=[_fabric(m) for m in scene.materials],
        camera=_camera(scene.camera, shape.subject, turn, aspect), notes=tuple(scene.notes),
    )  # fmt: skip


def _fabric(material: Material) -> Fabric | None:
    return material.binding.fabric if isinstance(material, FabricSurface) else None


def _surface(material: Material) -> Surface:
    if isinstance(material, FabricSurface):
        return Cloth(tables_of(material.binding.fabric))
    r, g, b = material.diffuse
    return Matte((r, g, b))


def _camera(camera: Camera | None, subject: Subject, turn: Any, aspect: float) -> Camera:
    """The scene's camera in the axes of a shape, or that of a studio."""
    if camera is None:
        return studio_camera(subject, aspect)
    from dataclasses import replace

    frame = camera.frame.copy()
    frame[:3] = turn @ frame[:3]
    return replace(camera, frame=frame)
