"""The scene of a preview for the path tracer: what a preview is compared with."""

from __future__ import annotations

from typing import Any

import numpy as np

from fabricusd.fabric import Binding, Fabric
from fabricusd.preview.lights import Lights, scene_lights
from fabricusd.preview.shapes import SHAPES, Shape
from fabricusd.reference.render import render_scene
from fabricusd.scene.scene import Camera, FabricSurface, Mesh, PreviewSurface, Scene

LINING = 1e-3
"""Distance of the lining from the cloth, in radii of the shape."""


def scene_of(fabric: Fabric, shape: str, lights: Lights) -> Scene:
    """Cloth on one of `shapes.SHAPES`, over a black lining, before the camera of the preview."""
    made = SHAPES[shape](fabric)
    binding = Binding(fabric=fabric, metres_per_uv=1.0)
    return scene_of_shape(binding, made, lights, made.camera())


def scene_of_shape(binding: Binding, made: Shape, lights: Lights, camera: Camera) -> Scene:
    """Cloth on any shape, over a black lining."""
    below = made.points - made.normals * (LINING * made.subject.radius)
    return Scene(
        meshes=[_mesh("/cloth", made, made.points, 0), _mesh("/lining", made, below, 1)],
        materials=[
            FabricSurface(binding=binding),
            PreviewSurface(name="lining", diffuse=(0.0, 0.0, 0.0), ior=1.0),
        ],
        lights=scene_lights(lights, made.subject.axes),
        camera=camera,
    )


def _mesh(path: str, shape: Shape, points: Any, material: int) -> Mesh:
    m = len(points)
    return Mesh(
        path=path, points=points.reshape(-1, 3), triangles=np.arange(3 * m).reshape(m, 3),
        normals=shape.normals, uv=shape.metres, material=np.full(m, material),
    )  # fmt: skip


def reference_picture(
    fabric: Fabric, *, shape: str, level: str, size: int, lights: Lights, spp: int, seed: int = 0
) -> tuple[Any, float]:
    """((h, w, 4) path-traced radiance and cover without bounces, processor time of it [s])."""
    result = render_scene(
        scene_of(fabric, shape, lights), width=size, height=size, spp=spp, max_bounces=0,
        level=level, shadow="horizon", seed=seed,
    )  # fmt: skip
    return result.layers["beauty"], result.processor_seconds
