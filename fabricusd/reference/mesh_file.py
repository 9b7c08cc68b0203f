"""OBJ, GLB, GLTF and PLY files through trimesh: triangles, UVs, and one fabric for all of them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd.errors import FabricError
from fabricusd.fabric import Binding
from fabricusd.reference.scene import FabricSurface, Material, Mesh, PreviewSurface, Scene


def read_mesh_file(path: Path, binding: Binding | None) -> Scene:
    """The file's meshes; lengths are taken as metres, +y as up.

    Every mesh with UVs is made of `binding`; without a binding all are grey.
    """
    import trimesh

    try:
        loaded: Any = _load(path)
        nodes = [(name, *loaded.graph[name]) for name in loaded.graph.nodes_geometry]
    except Exception as error:
        words = " ".join(str(error).split())[:200]
        raise FabricError(str(path), f"cannot be read as a mesh: {words}") from error
    scene = Scene()
    cloth: Material = PreviewSurface(name="grey")
    scene.materials.append(cloth)
    if binding is not None:
        scene.materials.append(FabricSurface(name=binding.fabric.name, binding=binding))
    else:
        scene.note(path.name, "is rendered grey: no fabric is named for it")
    for node, transform, geometry in nodes:
        part = loaded.geometry[geometry]
        faces = getattr(part, "faces", None)
        if faces is None or not len(faces):
            continue
        name = f"{path.name}:{node}"
        coordinates = getattr(part.visual, "uv", None)
        uv = None
        if coordinates is not None and len(coordinates) == len(part.vertices):
            uv = np.asarray(coordinates, np.float64)[faces]
        material = 0
        if binding is not None:
            if uv is None:
                scene.note(name, "has no UVs; it is rendered grey instead of as a fabric")
            else:
                material = 1
        # A transform that mirrors turns every triangle's front to its back.
        order = [0, 2, 1] if np.linalg.det(transform[:3, :3]) < 0 else [0, 1, 2]
        scene.meshes.append(
            Mesh(
                path=name,
                points=trimesh.transform_points(np.asarray(part.vertices), transform),
                triangles=np.asarray(faces)[:, order],
                uv=None if uv is None else uv[:, order],
                material=np.full(len(faces), material, np.int32),
            )
        )
    if not scene.meshes:
        raise FabricError(str(path), "holds no triangles")
    return scene


def _load(path: Path) -> Any:
    import trimesh

    if path.suffix.lower() == ".obj":
        content = path.read_bytes()
        try:
            content.decode("utf-8")
        except UnicodeDecodeError:
            # Comments and names in another encoding are no reason to refuse the numbers.
            text = io.StringIO(content.decode("utf-8", "replace"))
            return trimesh.load_scene(text, file_type="obj", process=False, skip_materials=True)
    return trimesh.load_scene(path, process=False)
