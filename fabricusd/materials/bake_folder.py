"""Read a bake folder by its manifest: the textures of each garment and how its fabrics lie."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.manifest_file import MANIFEST, file_in, read_manifest
from fabricusd.bake.texels.maps import REGISTRY
from fabricusd.errors import FabricError, reads
from fabricusd.fabric import Fabric
from fabricusd.images.files import shape_of

FABRICS = "fabrics.usda"
"""Layer in the folder that holds the baked fabrics, one prim each."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BakedLay:
    """How a fabric lies on a garment: threads = matrix @ uv + offset.

    fabric : None if the folder does not hold the fabric and no preset has its name
    """

    name: str
    fabric: Fabric | None
    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class MapSet:
    """The textures of one garment.

    textures : files by map and UDIM number; only maps of which all files exist
    missing : (map, file) pairs that the manifest lists but the folder lacks; ("mesh", file) if the
        mesh is missing
    prims : paths in the scene that was baked
    own_uv : False if the textures do not use the scene's own UVs
    udim : whether the textures are UDIM tiles
    spanned : "lay" and the number of the lay whose mean the maps that shape reflections hold; ""
        where they are those of the bake
    """

    folder: Path
    name: str
    textures: dict[str, dict[int, Path]]
    missing: tuple[tuple[str, str], ...]
    mesh: Path
    prims: tuple[str, ...]
    lays: tuple[BakedLay, ...]
    own_uv: bool
    udim: bool
    error: dict[str, float]
    fingerprint: str
    spanned: str = ""

    def pattern(self, texture: str) -> Path | None:
        """Return a map's file, with `<UDIM>` for the tile's number; None if the map is missing."""
        files = self.textures.get(texture)
        if not files:
            return None
        number, path = next(iter(files.items()))
        if not self.udim:
            return path
        return path.with_name(path.name.replace(f".{number}.", ".<UDIM>."))


@dataclass(frozen=True, kw_only=True, eq=False)
class BakeFolder:
    """All garments of a bake, and its settings."""

    path: Path
    garments: tuple[MapSet, ...]
    scene: str
    settings: dict[str, Any]

    @property
    def missing(self) -> tuple[tuple[str, str], ...]:
        """The (map, file) pairs that the manifest lists but the folder lacks."""
        return tuple(pair for one in self.garments for pair in one.missing)


@reads("a bake")
def read_bake_folder(path: str | os.PathLike[str]) -> BakeFolder:
    """Read the bake in a folder, which may have been moved; raise FabricError if there is none."""
    folder = Path(path)
    if folder.name == MANIFEST:
        folder = folder.parent
    if not folder.is_dir():
        raise FabricError(
            str(folder), "is not a folder; it must be the output folder of 'fabricusd bake'"
        )
    if not (folder / MANIFEST).exists():
        raise FabricError(
            str(folder), "has no manifest.json; it must hold a finished bake by 'fabricusd bake'"
        )
    said = read_manifest(folder)
    udim: bool = said["settings"]["udim"]
    known: dict[str, Fabric | None] = {}
    garments = tuple(
        _garment(folder, name, one, udim, known) for name, one in said["garments"].items()
    )
    for one in garments:
        _check_sizes(one, said["resolution"])
    return BakeFolder(
        path=folder, garments=garments, scene=said["scene"]["file"], settings=said["settings"]
    )


def _garment(
    folder: Path, name: str, said: dict[str, Any], udim: bool, known: dict[str, Fabric | None]
) -> MapSet:
    textures: dict[str, dict[int, Path]] = {}
    missing = []
    for texture, tiles in said["files"].items():
        files = {int(number): file_in(folder, one["file"]) for number, one in tiles.items()}
        lost = [path.name for path in files.values() if not path.is_file()]
        missing += [(texture, file) for file in lost]
        if not lost:
            textures[texture] = files
    mesh = file_in(folder, said["mesh"])
    if mesh.is_file():
        refuse_references(mesh)
    else:
        missing.append(("mesh", said["mesh"]))
    lays = []
    for lay in said["lays"]:
        if lay["fabric"] not in known:
            known[lay["fabric"]] = _fabric(folder, lay["fabric"])
        lays.append(
            BakedLay(
                name=lay["fabric"],
                fabric=known[lay["fabric"]],
                matrix=np.array(lay["threads_per_uv"], np.float64),
                offset=np.array(lay["offset"], np.float64),
            )
        )
    return MapSet(
        folder=folder, name=name, textures=textures, missing=tuple(missing),
        mesh=mesh, prims=tuple(said["prims"]), lays=tuple(lays),
        own_uv=said["uv_of_the_scene"], udim=udim, error=said["error"],
        fingerprint=said["fingerprint"],
    )  # fmt: skip


def _check_sizes(one: MapSet, resolution: int) -> None:
    """Raise FabricError if a texture's size or channels differ from those in the manifest."""
    for name, files in one.textures.items():
        channels = len(REGISTRY[name].channels)
        for path in files.values():
            height, width, depth = shape_of(path)
            if (height, width) != (resolution, resolution) or depth < channels:
                raise FabricError(
                    str(path),
                    f"has {width} x {height} texels of {depth} channels; the manifest says "
                    f"{resolution} x {resolution} of {channels}, bake again",
                )


def _fabric(folder: Path, name: str) -> Fabric | None:
    """Return the fabric of that name as it was baked, or the preset; None if there is neither."""
    from fabricusd.schema import load, preset_names

    source = file_in(folder, FABRICS)
    if source.is_file():
        refuse_references(source)
        return load(f"{source}:/{name}")
    return load(name) if name in preset_names() else None


def refuse_references(source: Path) -> None:
    """Raise FabricError if a layer refers to other files: those that the baker writes do not."""
    from pxr import Sdf, Tf, UsdUtils

    try:
        found = Sdf.Layer.FindOrOpen(str(source))
        named = [] if found is None else UsdUtils.ExtractExternalReferences(str(source))
    except Tf.ErrorException as error:
        raise FabricError(str(source), f"is not a USD layer: {error}") from error
    if found is None:
        raise FabricError(str(source), "is not a USD layer; bake again")
    first = next((file for files in named for file in files), None)
    if first is not None:
        raise FabricError(
            str(source),
            f"refers to '{first}'; a layer of 'fabricusd bake' must not refer to other files",
        )
