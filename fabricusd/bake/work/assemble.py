"""Compute the blocks of a bake and assemble them into textures, on several workers."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd import __version__
from fabricusd.bake.texels.blocks import Layers, composed
from fabricusd.bake.texels.encoding import FORMATS, encoding_of
from fabricusd.bake.texels.layers import ComputedLayer, Place
from fabricusd.bake.texels.maps import TextureMap
from fabricusd.bake.texels.moment_indices import MOMENTS
from fabricusd.bake.texels.sheet import Sheet
from fabricusd.bake.work.checkpoint import (
    Checkpoint,
    block_of_values,
    checkpoint_of,
    read_top,
    write_block,
)
from fabricusd.bake.work.scratch import Scratch
from fabricusd.images.files import write_16_bit, write_mip_exr
from fabricusd.run.cluster import Cluster, Kept
from fabricusd.run.workers import Batches
from fabricusd.stop import Stop

Progress = Callable[[str, int, int], Any]
"""Called with the noun that is counted, the total, and the number done."""


@dataclass(frozen=True, kw_only=True)
class Files:
    """The folder and the names of the textures."""

    folder: Path
    udim: bool
    file_format: str

    def path(self, sheet: Sheet, one: TextureMap) -> Path:
        """Return a texture's path: garment, map and, with UDIM tiles, the tile's number."""
        number = f".{sheet.number}" if self.udim else ""
        name = f"{sheet.garment.name}.{one.name}{number}{FORMATS[self.file_format]}"
        return self.folder / name


@dataclass(frozen=True, kw_only=True, eq=False)
class Work:
    """The sheets and maps of one bake, its scratch folder and output files, and its workers.

    cluster : the workers that compute the blocks; None for threads of this process
    """

    scratch: Scratch
    sheets: Sequence[Sheet]
    maps: Sequence[TextureMap]
    files: Files
    workers: int
    progress: Progress | None
    cluster: Cluster | None = None

    def checkpoint(self, sheet: Sheet) -> Checkpoint:
        """How a sheet's blocks are stored. Blocks of a cluster come as values: looking up every
        texel here would leave it the smaller part of the work."""
        return checkpoint_of(sheet, self.maps, values=self.cluster is not None)

    def missing(self, sheet: Sheet) -> list[int]:
        """Return the indices of the maps whose texture of this sheet is not finished."""
        paths = (self.files.path(sheet, one) for one in self.maps)
        return [k for k, path in enumerate(paths) if not self.scratch.is_done(path)]

    def run(self, task: Callable[[int, int], None], count: int, noun: str) -> bool:
        """Run `count` jobs of `task`, reported as `noun`; return False if interrupted."""
        report = partial(self.progress, noun, count) if self.progress else None
        return Batches(self.workers, task).run(count, report)


def compute(work: Work) -> bool:
    """Compute every block that is missing; return False if interrupted."""
    jobs = []
    for sheet in work.sheets:
        if work.missing(sheet):
            jobs += [(sheet, x, y) for y in range(sheet.across) for x in range(sheet.across)]
    checkpoints = {id(sheet): work.checkpoint(sheet) for sheet in work.sheets}
    if work.cluster is not None:
        paths = [work.scratch.block(sheet, x, y) for sheet, x, y in jobs]
        todo = [k for k, path in enumerate(paths) if not checkpoints[id(jobs[k][0])].is_sound(path)]
        return _compute_on(work, work.cluster, [jobs[k] for k in todo], [paths[k] for k in todo])

    def one_block(_: int, k: int) -> None:
        sheet, x, y = jobs[k]
        path = work.scratch.block(sheet, x, y)
        checkpoint = checkpoints[id(sheet)]
        if not checkpoint.is_sound(path):
            checkpoint.write(path, x, y)

    return work.run(one_block, len(jobs), "blocks")


def _compute_on(
    work: Work, cluster: Cluster, jobs: Sequence[tuple[Sheet, int, int]], paths: Sequence[Path]
) -> bool:
    """Compute blocks on a cluster; they are written here."""
    numbers = {id(sheet): k for k, sheet in enumerate(work.sheets)}
    count, report = 0, work.progress or (lambda *_: None)
    report("blocks", len(jobs), 0)

    def done(k: int, data: bytes) -> None:
        nonlocal count
        write_block(paths[k], data)
        count += 1
        report("blocks", len(jobs), count)

    with Stop() as stop:
        return cluster.run(
            _block_on_worker, (work.sheets, work.maps),
            [(numbers[id(sheet)], x, y) for sheet, x, y in jobs], done, stop,
        )  # fmt: skip


def _block_on_worker(kept: Kept, job: tuple[int, int, int]) -> bytes:
    """The contents of a block's file, without its checksum."""
    (sheets, maps), (number, x, y) = kept.thing, job
    parts = block_of_values(sheets[number], maps, x, y)
    return b"".join(np.ascontiguousarray(part).tobytes() for part in parts)


def assemble(work: Work) -> bool:
    """Write every texture that is missing; return False if interrupted."""
    for sheet in work.sheets:
        todo = work.missing(sheet)
        if not todo:
            continue
        task = partial(_write_texture, work, sheet, todo, uppermost(work.scratch, sheet))
        if not work.run(task, len(todo), "textures"):
            return False
        work.scratch.drop(sheet)
    return True


def _write_texture(
    work: Work, sheet: Sheet, todo: Sequence[int], upper: Layers, _worker: int, job: int
) -> None:
    """Write one texture from its blocks and from the mip levels coarser than a block."""
    k = todo[job]
    files, one, checkpoint = work.files, work.maps[k], work.checkpoint(sheet)
    path, encoding = files.path(sheet, one), None
    levels: list[Any] = [
        partial(bands, work.scratch, sheet, checkpoint, k, level) for level in range(sheet.levels)
    ]
    metadata = {
        "fabricusd:map": one.name,
        "fabricusd:meaning": one.meaning,
        "Software": f"fabricusd {__version__}",
    }
    if files.file_format == "exr":
        metadata["oiio:ColorSpace"] = "lin_rec709" if one.color else "Raw"
        levels += [partial(_whole, level) for level in upper_levels(one, upper, sheet.across)]
        write_mip_exr(path, levels, sheet.resolution, one.channels, one.kind, metadata)
    else:
        encoding = encoding_of(one, levels[0]())
        metadata["oiio:ColorSpace"] = "sRGB" if one.color else "Raw"
        metadata["fabricusd:encoding"] = json.dumps(asdict(encoding))
        rows = (encoding.encoded(band) for band in levels[0]())
        write_16_bit(path, rows, sheet.resolution, len(one.channels), metadata)
    work.scratch.mark_done(path, encoding)


def _whole(level: np.ndarray[Any, Any]) -> Any:
    return iter((level,))


def bands(
    scratch: Scratch, sheet: Sheet, checkpoint: Checkpoint, k: int, level: int
) -> Iterator[NDArray[Any]]:
    """Yield a mip level of a map in bands of rows, from the top, each high enough for EXR tiles."""
    waiting: list[NDArray[Any]] = []
    for by in range(sheet.across):
        row = [
            checkpoint.values(scratch.block(sheet, x, by), x, by, k, level)
            for x in range(sheet.across)
        ]
        waiting.append(np.concatenate(row, axis=1))
        if len(waiting) * (sheet.block_side >> level) >= 64 or by == sheet.across - 1:
            yield np.ascontiguousarray(np.concatenate(waiting))
            waiting = []


def uppermost(scratch: Scratch, sheet: Sheet) -> Layers:
    """Return the layers of the mip level at which each block is one texel."""
    lays, n = len(sheet.garment.lays), sheet.across
    moments, owned = np.empty((lays, MOMENTS, n, n), np.float32), np.empty((lays, n, n), np.float32)
    for by in range(n):
        for bx in range(n):
            found = read_top(scratch.block(sheet, bx, by), sheet)
            moments[:, :, by, bx], owned[:, by, bx] = found
    window = (0, 0, sheet.resolution, sheet.resolution)
    return {
        k: ComputedLayer(
            Place(sheet=sheet, lay=k, window=window, level=sheet.levels - 1), moments[k], owned[k]
        )
        for k in range(lays)
        if owned[k].any()
    }


def upper_levels(one: TextureMap, layers: Layers, size: int) -> list[NDArray[Any]]:
    """Return the mip levels of a map that are coarser than a block.

    layers : as returned by `uppermost`
    """
    found = []
    while size > 1:
        layers = {k: layer.halved() for k, layer in layers.items()}
        size //= 2
        found.append(composed(one, layers, size))
    return found
