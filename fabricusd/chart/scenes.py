"""Scenes for the charts, made in memory: a cylinder of cloth, lights, an orthographic camera."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Binding, Fabric
from fabricusd.scene.light_kinds import DISTANT, DOME
from fabricusd.scene.scene import Camera, FabricSurface, Light, Mesh, Scene

RADIUS = 0.05
"""Radius of a cylinder [m]."""

SIDES = 180


def frame_at(towards: Any, distance: float = 0.0) -> NDArray[np.float64]:
    """(4, 4) frame with z along `towards` and y upwards, at `distance` [m] from the origin.

    A camera in this frame looks at the origin, and a distant light shines at it.
    """
    z = np.asarray(towards, np.float64) / np.linalg.norm(towards)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2], frame[:3, 3] = x, np.cross(z, x), z, distance * z
    return frame


def cylinder(centre: float = 0.0, height: float = 2 * RADIUS, material: int = 0) -> Mesh:
    """The front half of an upright cylinder at x = `centre`; u runs round it, v up, in metres."""
    phi = np.linspace(-0.5 * math.pi, 0.5 * math.pi, SIDES + 1)
    y = np.array([-0.5 * height, 0.5 * height])
    p, h = np.meshgrid(phi, y, indexing="ij")
    normals = np.stack((np.sin(p), np.zeros_like(p), np.cos(p)), axis=-1).reshape(-1, 3)
    points = RADIUS * normals + np.stack((np.full(h.size, centre), h.ravel(), 0 * h.ravel()), 1)
    uv = np.stack((RADIUS * p, h), axis=-1).reshape(-1, 2)
    first = 2 * np.arange(SIDES)
    triangles = np.concatenate(
        [np.stack((first, first + 2, first + 3), 1), np.stack((first, first + 3, first + 1), 1)]
    )
    return Mesh(
        path=f"/cylinder{material}",
        points=points,
        triangles=triangles,
        normals=normals[triangles],
        uv=uv[triangles],
        material=np.full(len(triangles), material),
    )


def cloth(fabric: Fabric, degrees: float = 0.0, metres_per_uv: float = 1.0) -> FabricSurface:
    """A fabric on UVs in metres, its grain turned by `degrees`."""
    return FabricSurface(
        binding=Binding(fabric=fabric, metres_per_uv=metres_per_uv, rotation=math.radians(degrees))
    )


def sun(towards: Any, irradiance: float, width: float = 0.0) -> Light:
    """A distant light, `width` degrees across, that causes `irradiance` on a plane facing it."""
    angle = math.radians(width)
    solid = 2 * math.pi * (1 - math.cos(0.5 * angle)) if angle else 1.0
    return Light(
        path="/sun", kind=DISTANT, radiance=(irradiance / solid,) * 3, frame=frame_at(towards),
        angle=angle,
    )  # fmt: skip


def sky(radiance: float) -> Light:
    """A dome light of the same radiance in all directions."""
    return Light(path="/sky", kind=DOME, radiance=(radiance,) * 3)


def facing(width: float, height: float, towards: Any = (0.0, 0.0, 1.0)) -> Camera:
    """An orthographic camera that sees `width` by `height` metres around the origin."""
    return Camera(frame=frame_at(towards, 1.0), orthographic=True, aperture=(width, height))


def one_cylinder(fabric: Fabric) -> Scene:
    """A cylinder of cloth that fills a square picture, under a sky and a sun 5 degrees across."""
    return Scene(
        meshes=[cylinder()],
        materials=[cloth(fabric)],
        lights=[sky(0.3), sun((0.5, 0.6, 1.0), 2.0, 5.0)],
        camera=facing(2 * RADIUS, 2 * RADIUS),
    )


def curtain(size: float = 0.42, cells: int = 120) -> Mesh:
    """A square of cloth facing +z that hangs from its upper edge in folds that deepen downwards.

    u runs along the folded width and v upwards, in metres on the cloth.
    """
    line = np.linspace(-0.5, 0.5, cells + 1)
    s, t = np.meshgrid(line, line, indexing="ij")
    depth = 0.012 + 0.03 * (0.5 - t)
    z = depth * (np.sin(19.0 * s + 1.3 * t) + 0.4 * np.sin(41.0 * s - 2.0 * t))
    points = np.stack((size * s, size * t, z), axis=-1)
    step = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    along = np.concatenate((np.zeros((1, cells + 1)), np.cumsum(step, axis=0)))
    uv = np.stack((along - along[cells // 2], size * t), axis=-1)
    index = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b = index[:-1, :-1].ravel(), index[1:, :-1].ravel()
    c, d = index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    triangles = np.concatenate([np.stack((a, b, c), 1), np.stack((a, c, d), 1)])
    return Mesh(
        path="/curtain",
        points=points.reshape(-1, 3),
        triangles=triangles,
        uv=uv.reshape(-1, 2)[triangles],
        material=np.zeros(len(triangles), int),
    )
