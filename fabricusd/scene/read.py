"""A scene from any file that can be rendered, by its suffix."""

from __future__ import annotations

import os
from pathlib import Path

from fabricusd.errors import FabricError, reads
from fabricusd.fabric import Binding, Fabric
from fabricusd.files import readable_file
from fabricusd.scene.scene import Scene
from fabricusd.scene.surface.fineness import Fineness

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
MESH_SUFFIXES = (".obj", ".glb", ".gltf", ".ply")


@reads("a scene")
def read_scene(
    source: str | os.PathLike[str],
    *,
    fabric: str | Fabric | Binding | None = None,
    camera: str | None = None,
    time_code: float | None = None,
    complexity: str = "low",
    width: int = 960,
    units: str | None = None,
) -> Scene:
    """The scene of a USD or mesh file, in metres. Raises `FabricError` where it has none.

    complexity : how finely subdivision surfaces are refined, "low" to "veryhigh", or "auto", as a
        picture of `width` pixels shows; by default not at all, since textures are baked and
        materials bound on the faces that their UVs were laid on
    units : what the lengths of an .obj or .ply are in, "m", "cm", "mm" or "in"; None takes metres,
        and a note tells the size
    """
    fineness = Fineness(complexity=complexity, width=width)
    path = Path(source)
    suffix = path.suffix.lower()
    if suffix not in USD_SUFFIXES + MESH_SUFFIXES:
        raise FabricError(
            str(path), f"is no scene; it must end in {', '.join(USD_SUFFIXES + MESH_SUFFIXES)}"
        )
    readable_file(path)
    binding = as_binding(fabric)
    if suffix in MESH_SUFFIXES:
        from fabricusd.scene.files.mesh_file import read_mesh_file

        if camera is not None:
            raise FabricError(f"{path}:{camera}", f"is no camera; {suffix} files have none")
        return read_mesh_file(path, binding, units)
    if units is not None:
        from fabricusd.scene.size import unit_length

        unit_length(units, suffix)
    from fabricusd.scene.usd.stage import read_usd_scene

    return read_usd_scene(
        path, binding=binding, camera=camera, time_code=time_code, fineness=fineness
    )


def as_binding(fabric: str | Fabric | Binding | None) -> Binding | None:
    """A binding of a fabric, or of a fabric's file or preset name, at its measured scale."""
    if fabric is None or isinstance(fabric, Binding):
        return fabric
    if isinstance(fabric, Fabric):
        return Binding(fabric=fabric)
    from fabricusd.schema import load

    return Binding(fabric=load(fabric))
