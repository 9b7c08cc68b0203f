"""Bake one seamless tile of a fabric: whole repeats on a square of its own.

Uneven yarn never repeats, so the threads of a tile are even.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.bake.bake import bake
from fabricusd.bake.job import Settings
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, Fabric, Thread
from fabricusd.images.files import read_mip_level
from fabricusd.materials.bake_folder import read_bake_folder
from fabricusd.materials.fit.keep import kept_fit
from fabricusd.materials.fit.target import TexelSample
from fabricusd.materials.fit.texels import NEEDED, draw_texels
from fabricusd.materials.networks.look import Look
from fabricusd.materials.targets import Note

THREADS = 32
"""Smallest number of threads along a side of the tile; with fewer, it would repeat visibly."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tile:
    """The baked maps of a tile, which repeats in both directions.

    fabric : with even threads
    ends, picks : threads along the width and the height
    size : (width, height) [m]
    maps : name -> (n, n, c) float64, row 0 at the top, with the values of the bake
    texels : what a fit needs
    """

    fabric: Fabric
    ends: int
    picks: int
    size: tuple[float, float]
    maps: dict[str, NDArray[np.float64]]
    texels: TexelSample | None

    @property
    def resolution(self) -> int:
        """Texels per side."""
        return int(next(iter(self.maps.values())).shape[0])


def baked_tile(
    fabric: Fabric, *, resolution: int, level: str = "weave", besides: tuple[str, ...] = ()
) -> Tile:
    """Bake the maps that a fit needs, the height, and `besides` where the fabric has them.

    Raises FabricError for a fabric that cannot be baked.
    """
    cloth = even(fabric)
    ends, picks = _threads(cloth)
    size = (ends * cloth.warp.pitch, picks * cloth.weft.pitch)
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "tile.obj"
        w, h = size
        scene.write_text(
            f"v 0 0 0\nv {w:.9g} 0 0\nv {w:.9g} {h:.9g} 0\nv 0 {h:.9g} 0\n"
            "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
        )
        binding = Binding(fabric=cloth, threads_per_uv=(float(ends), float(picks)))
        settings = Settings(resolution=resolution, maps=(*NEEDED, "height", *besides), level=level)
        bake(scene, Path(folder) / "bake", settings, fabric=binding)
        baked = read_bake_folder(Path(folder) / "bake").garments[0]
        maps = {
            name: read_mip_level(next(iter(files.values()))).astype(np.float64)
            for name, files in baked.textures.items()
        }
        texels = draw_texels(baked, 0, baked.lays[0])
    return Tile(fabric=cloth, ends=ends, picks=picks, size=size, maps=maps, texels=texels)


def even(fabric: Fabric) -> Fabric:
    """The fabric with even threads that show no plies."""
    threads = {name: _even_thread(thread) for name, thread in fabric.threads.items()}
    back = None if fabric.back is None else even(fabric.back)
    return replace(fabric, threads=threads, back=back)


def _even_thread(thread: Thread) -> Thread:
    return replace(
        thread, unevenness_cv=0.0, unevenness_length=0.0, unevenness_count=0.0,
        unevenness_shade=0.0, slub_amount=0.0, slub_length=0.0, slub_spacing=0.0, plies=1,
        twist=0.0,
    )  # fmt: skip


def tile_look(tile: Tile, kind: str, *, fitted: bool, progress: Note | None) -> Look:
    """The fitted look of surface `kind` for the tile's texels, kept in the cache."""
    given = tile.texels
    if not fitted or given is None:
        return Look()

    def waiting() -> None:
        if progress:
            progress(f"fitting {kind} to the swatch of {tile.fabric.name}")

    return kept_fit(kind, given, tile.fabric, baked=given, waiting=waiting).look


def relief(tile: Tile) -> tuple[NDArray[np.float64], float]:
    """(n, n, 1) heights from 0 to 1, and the height [m] that 1 stands for."""
    # The bake gives heights in millimetres.
    height = tile.maps["height"] - tile.maps["height"].min()
    depth = float(height.max())
    return height / max(depth, 1e-12), 1e-3 * depth


def check_folder(option: str, where: Path) -> None:
    """Raise FabricError if the folder of an option cannot be made."""
    if where.exists() and not where.is_dir():
        raise FabricError(f"{option} '{where}'", "is a file; it must be a folder")
    if not where.parent.is_dir():
        raise FabricError(f"{option} '{where}'", f"is in '{where.parent}', which is not a folder")


def make_folder(option: str, where: Path) -> None:
    """Make the folder of an option; raise FabricError if that fails."""
    try:
        where.mkdir(exist_ok=True)
    except OSError as error:
        raise FabricError(f"{option} '{where}'", f"cannot be made: {error.strerror}") from error


def _threads(fabric: Fabric) -> tuple[int, int]:
    """Return the ends and picks of the tile: whole repeats, nearly square, at least THREADS."""
    ends, picks = true_repeat(fabric)
    across = math.ceil(THREADS / ends)
    width = across * ends * fabric.warp.pitch
    down = max(1, round(width / (picks * fabric.weft.pitch)))
    return across * ends, down * picks
