"""Small meshes as OBJ files and scenes, for the baker's tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fabricusd.fabric import Binding, Fabric
from fabricusd.scene.scene import FabricSurface, Mesh, Scene


def quad_scene(
    fabric: Fabric, threads: float = 8.0, *, uv: object = None, rotation: float = 0.0
) -> Scene:
    """A square of 1 cm with UVs over the unit square, `threads` threads each way."""
    return Scene(
        meshes=[quad_mesh(uv=uv)],
        materials=[
            FabricSurface(
                binding=Binding(fabric=fabric, threads_per_uv=(threads, threads), rotation=rotation)
            )
        ],
    )


def quad_mesh(*, uv: object = None, path: str = "/Quad", move: float = 0.0) -> Mesh:
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    tri = np.array([[0, 1, 2], [0, 2, 3]])
    points = np.concatenate((corners, np.zeros((4, 1))), axis=1) * 0.01 + move
    laid = corners if uv is None else np.asarray(uv, float)
    return Mesh(
        path=path, points=points, triangles=tri, uv=laid[tri], material=np.zeros(2, np.int32)
    )


def write_quad(path: Path, uv: object = None) -> Path:
    """The same square as an OBJ file."""
    laid = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float) if uv is None else np.asarray(uv)
    lines = ["v 0 0 0", "v 0.01 0 0", "v 0.01 0.01 0", "v 0 0.01 0"]
    lines += [f"vt {float(u)!r} {float(v)!r}" for u, v in laid]
    path.write_text("\n".join([*lines, "f 1/1 2/2 3/3", "f 1/1 3/3 4/4", ""]))
    return path
