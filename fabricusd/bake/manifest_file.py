"""Read a manifest from an untrusted source: every field is checked before it is used.

Names must follow the baker's own scheme, and files must lie in the manifest's folder. A manifest
therefore cannot redirect output to another folder or have other files read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fabricusd.bake.layout.garment import FIRST_TILE, LAST_TILE
from fabricusd.bake.names import folded, is_file_stem
from fabricusd.bake.stated import Stated, read_stated
from fabricusd.bake.texels.encoding import FORMATS, encoding_from
from fabricusd.bake.texels.maps import REGISTRY
from fabricusd.bake.texels.sheet import LARGEST, SMALLEST
from fabricusd.errors import FabricError

MANIFEST = "manifest.json"

RESOLUTIONS = frozenset(1 << k for k in range(SMALLEST.bit_length() - 1, LARGEST.bit_length()))

SINGULAR = 1e-12
"""A lay whose determinant, relative to the product of its rows' lengths, is smaller than this
cannot be inverted."""


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest of a bake folder and check the type of every field that is used.

    Raises FabricError, with the place and the value of the first fault, for an invalid manifest.
    """
    root = read_stated(file_in(folder, MANIFEST))
    udim = root.field("settings").field("udim").flag()
    root.field("scene").field("file").text()
    resolution = root.field("resolution")
    if not isinstance(resolution.value, int) or resolution.value not in RESOLUTIONS:
        resolution.refuse(f"a power of two from {SMALLEST} to {LARGEST}")
    maps = {name for name, one in root.field("maps").items() if _check_map(name, one)}
    garments = root.field("garments")
    if not garments.fields():
        garments.refuse("an object with at least one garment")
    taken: set[str] = set()
    for name, one in garments.items():
        if not is_file_stem(name) or not taken.isdisjoint(folded(name)):
            one.below(name, name).refuse(
                "the name of one garment: letters, digits, _ and -, and different from all others "
                "in more than letter case"
            )
        taken |= folded(name)
        _check_garment(name, one, udim, maps)
    return root.fields()


def _check_map(name: str, one: Stated) -> bool:
    """Refuse a map that the baker does not know or whose channels differ from the baker's."""
    if name not in REGISTRY:
        one.refuse(f"an entry for one of {', '.join(REGISTRY)}")
    channels = one.field("channels")
    known = list(REGISTRY[name].channels)
    if [channel.text() for channel in channels.entries()] != known:
        channels.refuse(f"the list {', '.join(known)}")
    return True


def _check_garment(name: str, one: Stated, udim: bool, maps: set[str]) -> None:
    """Refuse an entry of `garments` that the baker would not write."""
    mesh = one.field("mesh")
    if mesh.text() != f"{name}.usdc":
        mesh.refuse(f"{name}.usdc")
    one.field("uv_of_the_scene").flag()
    one.field("fingerprint").text()
    for prim in one.field("prims").entries():
        prim.text()
    for _, error in one.field("error").items():
        if error.value is not None:
            error.number()
    for lay in one.field("lays").entries():
        _check_lay(lay)
    all_tiles: set[str] | None = None
    for texture, tiles in one.field("files").items():
        if texture not in maps:
            tiles.refuse(f"for a map listed in 'maps': {', '.join(sorted(maps)) or 'none'}")
        all_tiles = set(tiles.fields()) if all_tiles is None else all_tiles
        if not all_tiles or set(tiles.fields()) != all_tiles:
            tiles.refuse("the same tiles as the other maps have, and at least one")
        for number, record in tiles.items():
            _check_file(f"{name}.{texture}", number, record, udim)


def _check_lay(lay: Stated) -> None:
    fabric = lay.field("fabric")
    if not is_file_stem(fabric.text()) or not fabric.text().isidentifier():
        fabric.refuse("the name of a fabric: letters, digits and _")
    rows = [row.entries(2) for row in lay.field("threads_per_uv").entries(2)]
    matrix = np.array([[entry.number() for entry in row] for row in rows])
    lengths = np.linalg.norm(matrix, axis=1)
    if not lengths.min() > 0 or abs(np.linalg.det(matrix / lengths[:, None])) < SINGULAR:
        lay.field("threads_per_uv").refuse("an invertible matrix")
    for entry in lay.field("offset").entries(2):
        entry.number()


def _check_file(stem: str, number: str, record: Stated, udim: bool) -> None:
    """Refuse a texture whose name or tile the baker would not write."""
    tiles = [str(k) for k in range(FIRST_TILE, LAST_TILE + 1 if udim else FIRST_TILE + 1)]
    if number not in tiles:
        record.refuse(
            f"for a tile from {tiles[0]} to {tiles[-1]}" if udim else f"for tile {tiles[0]}"
        )
    known = [f"{stem}.{number}{end}" if udim else f"{stem}{end}" for end in FORMATS.values()]
    file = record.field("file")
    if file.text() not in known:
        file.refuse(f"one of {', '.join(known)}")
    if "encoding" in record.fields():
        try:
            encoding_from(record.field("encoding").value)
        except ValueError as error:
            record.field("encoding").refuse(f"a valid encoding: {error}")


def file_in(folder: Path, name: str) -> Path:
    """Return the path of file `name` in a bake folder, whether or not the file exists.

    Raises FabricError if the path is a link that leads out of the folder.
    """
    path = folder / name
    try:
        inside = path.resolve().parent.is_relative_to(folder.resolve())
    except (OSError, RuntimeError):
        inside = False
    if not inside:
        raise FabricError(
            str(path), "is a link that leads out of its folder; it must be a file in it"
        )
    return path
