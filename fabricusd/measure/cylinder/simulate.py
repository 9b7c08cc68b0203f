"""Cylinders of a cloth that is known, as a scene for the path tracer: to try a fit with."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Binding, Fabric
from fabricusd.measure.cylinder.setup import FIT, PREDICT, Cylinder, Stand
from fabricusd.scene.light_kinds import DISTANT
from fabricusd.scene.scene import (
    Camera,
    FabricSurface,
    Light,
    Material,
    Mesh,
    PreviewSurface,
    Scene,
)
from fabricusd.scene.studio import looking

Floats = NDArray[np.float64]

SEGMENTS = 720
INNER = 0.98
"""Radius of the black core below the cloth, over the cloth's."""


def three_wraps(distance: float = 0.3) -> Stand:
    """Warp upright, warp around, and bias between them, under a distant light from the left.

    distance : from axis to axis, at a radius of .11
    """
    turn, rise = math.radians(-25), math.radians(30)
    light = (
        math.sin(turn) * math.cos(rise), math.sin(rise), math.cos(turn) * math.cos(rise),
    )  # fmt: skip
    wraps = (("Upright", -1, 0.0, FIT), ("Round", 0, 90.0, FIT), ("Bias", 1, 45.0, PREDICT))
    return Stand(
        eye=(0.0, 0.15, 2.1), target=(0.0, 0.15, 0.0),
        view_angle=2 * math.atan((distance + 0.24) / 2.1), lights=(light,), irradiance=math.pi,
        cylinders=tuple(
            Cylinder(name=name, x=k * distance, z=0.0, radius=0.11, bottom=0.1, top=0.2,
                     angle=math.radians(angle), use=use)
            for name, k, angle, use in wraps
        ),
    )  # fmt: skip


def scene_of(fabric: Fabric, stand: Stand, aspect: float, photograph: int = 0) -> Scene:
    """The cylinders wear `fabric`; aspect : width over height of the picture."""
    meshes: list[Mesh] = []
    materials: list[Material] = []
    for k, cylinder in enumerate(stand.cylinders):
        binding = Binding(fabric=fabric, metres_per_uv=1.0, rotation=cylinder.angle)
        materials.append(FabricSurface(name=cylinder.name, binding=binding))
        meshes.append(_tube(cylinder, cylinder.radius, 2 * k))
        materials.append(PreviewSurface(name="Core", diffuse=(0.0, 0.0, 0.0), ior=1.0))
        meshes.append(_tube(cylinder, INNER * cylinder.radius, 2 * k + 1))
    up = np.array([0.0, 1.0, 0.0])
    towards = np.asarray(stand.lights[photograph])
    sun = Light(
        path="/Cylinders/Sun", kind=DISTANT, radiance=(stand.irradiance or math.pi,) * 3,
        frame=looking(towards, np.zeros(3), up),
    )  # fmt: skip
    aperture = 0.036
    eye, target = np.asarray(stand.eye), np.asarray(stand.target)
    camera = Camera(
        path="/Cylinders/Camera", frame=looking(eye, target, up),
        focal_length=0.5 * aperture / math.tan(0.5 * stand.view_angle),
        aperture=(aperture, aperture / aspect),
    )  # fmt: skip
    return Scene(meshes=meshes, materials=materials, lights=[sun], camera=camera)


def _tube(cylinder: Cylinder, radius: float, material: int) -> Mesh:
    """An upright tube that reaches beyond what is measured; UVs are lengths around and up."""
    phi = np.linspace(0.0, 2.0 * math.pi, SEGMENTS + 1)
    more = 0.5 * (cylinder.top - cylinder.bottom)
    y = np.array([cylinder.bottom - more, cylinder.top + more])
    p, h = np.meshgrid(phi, y, indexing="ij")
    points = np.stack(
        (cylinder.x + radius * np.sin(p), h, cylinder.z + radius * np.cos(p)), axis=-1
    ).reshape(-1, 3)
    uv = np.stack((radius * p, h), axis=-1).reshape(-1, 2)
    i = 2 * np.arange(SEGMENTS)
    triangles = np.concatenate(
        (np.stack((i, i + 2, i + 3), axis=1), np.stack((i, i + 3, i + 1), axis=1))
    )
    normals = points - np.array([cylinder.x, 0.0, cylinder.z])
    normals[:, 1] = 0.0
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return Mesh(
        path=f"/Cylinders/{cylinder.name}{material}", points=points, triangles=triangles,
        normals=normals[triangles], uv=uv[triangles],
        material=np.full(len(triangles), material, np.int32),
    )  # fmt: skip


def photographed(
    fabric: Fabric, stand: Stand, *, width: int = 720, height: int = 180, spp: int = 64,
    bounces: int = 0, seed: int = 0, level: str = "far",
) -> Floats:  # fmt: skip
    """(h, w, 3) by the path tracer; bounces : 0 for no light from cylinder to cylinder

    level : "far" for cloth whose threads are too small to be seen, and so is their unevenness
    """
    from fabricusd.reference.render import render_scene
    from fabricusd.stop import Stop

    stop = Stop()
    try:
        made: Any = render_scene(
            scene_of(fabric, stand, width / height), width=width, height=height, spp=spp,
            max_bounces=bounces, level=level, seed=seed, stop=stop,
        )  # fmt: skip
    finally:
        stop.release()
    return np.asarray(made.layers["beauty"][..., :3], np.float64)
