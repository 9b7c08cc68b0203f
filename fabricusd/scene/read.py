"""Reading a scene from a USD or mesh file; the file's suffix selects the reader."""

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
    instanced: bool = False,
) -> Scene:
    """Read the scene of a USD or mesh file, in metres.

    fabric : for every mesh file and every surface without a material of its own
    camera : path of a camera in a USD file, or its name where no other camera has it
    complexity : how finely subdivision surfaces are refined: "low" to "veryhigh", or "auto" for
        what a picture of `width` pixels can show. By default they are not refined, because textures
        are baked and materials are bound on the faces for which the UVs were laid out
    units : unit of length of an .obj or .ply: "m", "cm", "mm" or "in"; None assumes metres and adds
        a note with the resulting size
    instanced : read a mesh that instances share once, with its placements, instead of a copy for
        each; for who can render that

    Raises `FabricError` if the file cannot be read as a scene.
    """
    fineness = Fineness(complexity=complexity, width=width)
    path = Path(source)
    suffix = path.suffix.lower()
    if suffix not in USD_SUFFIXES + MESH_SUFFIXES:
        raise FabricError(
            str(path),
            f"is not a scene file; it must end in {', '.join(USD_SUFFIXES + MESH_SUFFIXES)}",
        )
    readable_file(path)
    binding = as_binding(fabric)
    if suffix in MESH_SUFFIXES:
        from fabricusd.scene.files.mesh_file import read_mesh_file

        if camera is not None:
            raise FabricError(f"{path}:{camera}", f"is not a camera; {suffix} files have none")
        return read_mesh_file(path, binding, units)
    if units is not None:
        from fabricusd.scene.size import unit_length

        unit_length(units, suffix)
    from fabricusd.scene.usd.stage import read_usd_scene

    return read_usd_scene(
        path, binding=binding, camera=camera, time_code=time_code, fineness=fineness,
        instanced=instanced,
    )  # fmt: skip


def as_binding(fabric: str | Fabric | Binding | None) -> Binding | None:
    """A binding, at measured scale, of a fabric that is given as such, as a file or as a preset."""
    if fabric is None or isinstance(fabric, Binding):
        return fabric
    if isinstance(fabric, Fabric):
        return Binding(fabric=fabric)
    from fabricusd.schema import load

    return Binding(fabric=load(fabric))
