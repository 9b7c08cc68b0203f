"""A bake folder as its manifest describes it: which textures, of which garment, in which place."""

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
"""Layer in the folder that holds the fabrics that were baked, one prim each."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BakedLay:
    """A fabric on a garment: threads = matrix @ uv + offset.

    fabric : the fabric, None where the folder does not hold it and no preset has its name
    """

    name: str
    fabric: Fabric | None
    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class MapSet:
    """The textures of one garment.

    textures : map -> UDIM number -> file; only maps all of whose files exist
    missing : map and file of what the manifest names and the folder lacks; "mesh" for the mesh
    prims : paths in the scene that was baked
    own_uv : False where the textures are not in the scene's own UVs
    udim : whether the textures are UDIM tiles
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

    def pattern(self, texture: str) -> Path | None:
        """The file of a map, `<UDIM>` standing for the tile; None where it is not there."""
        files = self.textures.get(texture)
        if not files:
            return None
        number, path = next(iter(files.items()))
        if not self.udim:
            return path
        return path.with_name(path.name.replace(f".{number}.", ".<UDIM>."))


@dataclass(frozen=True, kw_only=True, eq=False)
class BakeFolder:
    """All garments of a bake, and the settings it was made with."""

    path: Path
    garments: tuple[MapSet, ...]
    scene: str
    settings: dict[str, Any]

    @property
    def missing(self) -> tuple[tuple[str, str], ...]:
        """Map and file of all that the manifest names and the folder lacks."""
        return tuple(pair for one in self.garments for pair in one.missing)


@reads("a bake")
def read_bake_folder(path: str | os.PathLike[str]) -> BakeFolder:
    """The bake in a folder, wherever the folder is now. `FabricError` where there is none."""
    folder = Path(path)
    if folder.name == MANIFEST:
        folder = folder.parent
    if not folder.is_dir():
        raise FabricError(str(folder), "is no folder; it must be one that 'fabricusd bake' made")
    if not (folder / MANIFEST).exists():
        raise FabricError(str(folder), "has no manifest.json; 'fabricusd bake' must finish first")
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
    """Raise FabricError for a texture whose size or channels are not those of the bake."""
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
    """The fabric of that name as it was baked, or else the preset; None where there is neither."""
    from fabricusd.schema import load, preset_names

    source = file_in(folder, FABRICS)
    if source.is_file():
        refuse_references(source)
        return load(f"{source}:/{name}")
    return load(name) if name in preset_names() else None


def refuse_references(source: Path) -> None:
    """Raise FabricError for a layer of the baker's that names other files: it writes none so."""
    from pxr import Sdf, Tf, UsdUtils

    try:
        found = Sdf.Layer.FindOrOpen(str(source))
        named = [] if found is None else UsdUtils.ExtractExternalReferences(str(source))
    except Tf.ErrorException as error:
        raise FabricError(str(source), f"is no layer of USD: {error}") from error
    if found is None:
        raise FabricError(str(source), "is no layer of USD; bake again")
    first = next((file for files in named for file in files), None)
    if first is not None:
        raise FabricError(
            str(source), f"refers to '{first}'; a layer that 'fabricusd bake' wrote refers to none"
        )
