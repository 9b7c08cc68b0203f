"""Computing the blocks of a bake and putting the textures together, on several workers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd import __version__
from fabricusd.bake import blocks as b
from fabricusd.bake.maps import TextureMap
from fabricusd.bake.scratch import Scratch, bands, upper_levels
from fabricusd.bake.sheet import Sheet
from fabricusd.reference.images import write_mip_exr
from fabricusd.reference.workers import Batches

Progress = Callable[[str, int, int], Any]
"""Told what is counted, how many there are, and how many are done."""


def compute(
    scratch: Scratch,
    sheets: Sequence[Sheet],
    maps: Sequence[TextureMap],
    folder: Path,
    udim: bool,
    workers: int,
    progress: Progress | None,
) -> bool:
    """Every block that is not there yet; False where interrupted."""
    jobs = []
    for sheet in sheets:
        if all(scratch.is_done(folder / file_name(sheet, one, udim)) for one in maps):
            continue
        jobs += [(sheet, x, y) for y in range(sheet.across) for x in range(sheet.across)]

    def one_block(_: int, k: int) -> None:
        sheet, x, y = jobs[k]
        path = scratch.block(sheet, x, y)
        if not b.block_is_sound(path):
            b.write_block(path, *b.bake_block(sheet, maps, x, y))

    report = partial(progress, "blocks", len(jobs)) if progress else None
    return Batches(workers, one_block).run(len(jobs), report)


def file_name(sheet: Sheet, one: TextureMap, udim: bool) -> Path:
    """A texture's name: garment, map, and the tile's number where there are tiles."""
    number = f".{sheet.number}" if udim else ""
    return Path(f"{sheet.garment.name}.{one.name}{number}.exr")


def assemble(
    scratch: Scratch,
    sheets: Sequence[Sheet],
    maps: Sequence[TextureMap],
    folder: Path,
    udim: bool,
    workers: int,
    progress: Progress | None,
) -> bool:
    """Every texture that is not there yet; False where interrupted."""
    for sheet in sheets:
        todo = [
            k
            for k, one in enumerate(maps)
            if not scratch.is_done(folder / file_name(sheet, one, udim))
        ]
        if not todo:
            continue
        task = partial(_write_texture, scratch, sheet, maps, folder, udim, todo)
        task = partial(task, upper_levels(scratch, sheet, maps))
        report = partial(progress, "textures", len(todo)) if progress else None
        if not Batches(workers, task).run(len(todo), report):
            return False
        scratch.drop(sheet)
    return True


def _write_texture(
    scratch: Scratch,
    sheet: Sheet,
    maps: Sequence[TextureMap],
    folder: Path,
    udim: bool,
    todo: Sequence[int],
    upper: list[list[Any]],
    _worker: int,
    job: int,
) -> None:
    """One texture, from the blocks and the levels above them."""
    k = todo[job]
    one, places = maps[k], b.sizes(sheet, maps)[k]
    levels: list[Any] = [
        partial(bands, scratch, sheet, one, level, places) for level in range(sheet.levels)
    ]
    levels += [partial(_whole, level) for level in upper[k]]
    metadata = {
        "fabricusd:map": one.name,
        "fabricusd:meaning": one.meaning,
        "oiio:ColorSpace": "lin_rec709" if one.color else "Raw",
        "Software": f"fabricusd {__version__}",
    }
    path = folder / file_name(sheet, one, udim)
    write_mip_exr(path, levels, sheet.resolution, one.channels, one.kind, metadata)
    scratch.mark_done(path)


def _whole(level: np.ndarray[Any, Any]) -> Any:
    return iter((level,))
