"""Peak memory of a picture of a million triangles at 2048 x 2048.

    python bench/tracer/bench_memory.py [SAMPLES]

Printed is the peak memory of the process before and after rendering. Run it twice: the first run
compiles kernels, which takes memory of its own.
"""

from __future__ import annotations

import resource
import sys

import numpy as np

from fabricusd.fabric import Binding
from fabricusd.reference.render import render_scene
from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.scene import FabricSurface, Light, Mesh, Scene
from fabricusd.schema import load

POINTS = 708
"""Points along each side of the grid; each of its cells is two triangles."""


def wavy() -> Mesh:
    """A wavy square of 999 698 triangles with UVs."""
    line = np.linspace(-1, 1, POINTS)
    x, z = np.meshgrid(line, line, indexing="ij")
    points = np.stack([x, 0.1 * np.sin(9 * x) * np.cos(7 * z), z], axis=-1).reshape(-1, 3)
    i = np.arange(POINTS * POINTS).reshape(POINTS, POINTS)
    a, b, c, d = (i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel())
    triangles = np.concatenate([np.stack([a, d, c], 1), np.stack([a, c, b], 1)]).astype(np.int32)
    material = np.zeros(len(triangles), np.int32)
    return Mesh(
        path="wavy", points=points, triangles=triangles, uv=points[:, [0, 2]][triangles],
        material=material,
    )  # fmt: skip


def most() -> float:
    """Peak memory of this process so far [MB]."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def main() -> None:
    surface = FabricSurface(binding=Binding(fabric=load("silk_shot"), metres_per_uv=1.0))
    scene = Scene(
        meshes=[wavy()],
        materials=[surface],
        lights=[Light(path="sky", kind=DOME, radiance=(1.0, 1.0, 1.0))],
    )
    print(f"before: {most():.0f} MB")
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    render_scene(scene, width=2048, height=2048, spp=samples, level="far")
    print(f"after: {most():.0f} MB")


if __name__ == "__main__":
    main()
