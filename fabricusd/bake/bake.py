"""From a scene to a folder of textures."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from fabricusd import __version__
from fabricusd.bake.accuracy import SwatchError, swatch_errors
from fabricusd.bake.assemble import Files, Progress, Work, assemble, compute
from fabricusd.bake.btf.write import MAX_ERROR, write_btf
from fabricusd.bake.choose import Tried, cheapest, maps_with
from fabricusd.bake.encoding import FORMATS, Encoding, stored_by
from fabricusd.bake.garment import (
    Garment,
    fitted,
    garments,
    resolution_for,
    threads_per_uv,
    tiles_of,
)
from fabricusd.bake.kept import kept
from fabricusd.bake.manifest import manifest_of, write_json
from fabricusd.bake.map_error import MapError, map_errors
from fabricusd.bake.maps import TextureMap, chosen_maps
from fabricusd.bake.mesh_layer import write_mesh_layer
from fabricusd.bake.overlaps import refuse_overlaps
from fabricusd.bake.reasons import explained
from fabricusd.bake.recipe import Recipe, recipe
from fabricusd.bake.relight import best_choice
from fabricusd.bake.report import write_report
from fabricusd.bake.scratch import Scratch
from fabricusd.bake.sheet import Sheet, sheets_of
from fabricusd.bake.unwrap import unwrapped
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, Fabric
from fabricusd.reference.mesh_size import size_words, threads_words
from fabricusd.reference.read import as_binding, read_scene
from fabricusd.reference.scene import Scene
from fabricusd.reference.workers import worker_count
from fabricusd.schema import save_all

MARGIN = 16
"""Texels that a shell is continued beyond its border: enough for four mip levels without a seam."""

LARGEST = 32768
"""Texels along a side: beyond it a texture is more than most tools open; use more UDIM tiles."""

FEWEST = 2.0
"""Texels per thread below which threads do not resolve and texels hold means of several."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is made of a scene.

    resolution : texels along a side, a power of two from 64; 0 to take `texels_per_thread`
    maps : names from the registry, None for all
    light : direction to a light in the surface frame, for the map `shadow`
    level : "weave" or "thread", whether threads are flat or round across their width
    udim : bake each UDIM tile that the UVs reach into
    fit : move and scale each garment's UVs into the unit square first
    unwrap : "x", "y" or "z": new UVs by xatlas, with the warp along that axis of the world
    max_error : mean delta E 2000 of re-lit texels against level `weave` to reach; 0 to ask nothing
    btf : forms of the BTF to write, see `btf.write.FORMS`
    file_format : "exr", or "png" or "tiff" for 16-bit integers and the finest level alone
    """

    resolution: int = 1024
    texels_per_thread: float = 0.0
    maps: tuple[str, ...] | None = None
    light: tuple[float, float, float] | None = None
    shadow: str = "peak"
    level: str = "weave"
    udim: bool = False
    fit: bool = False
    unwrap: str = ""
    max_error: float = 0.0
    btf: tuple[str, ...] = ()
    file_format: str = "exr"
    margin: int = MARGIN


@dataclass(kw_only=True)
class Baked:
    """What a bake has made.

    files : names of the textures, by garment, map and UDIM number
    encodings : of each file whose numbers are not the values themselves
    errors : of each garment, measured as `accuracy.swatch_error` does with the maps that were made
    map_errors : of each garment and map
    tried : where a bound was asked for, what was tried to meet it
    btf : records of the BTFs that were written, by fabric
    notes : what had to be assumed or left out
    """

    folder: Path
    resolution: int
    garments: list[Garment]
    maps: list[TextureMap]
    files: dict[str, dict[str, dict[int, str]]]
    notes: list[str] = field(default_factory=list)
    encodings: dict[str, Encoding] = field(default_factory=dict)
    errors: dict[str, SwatchError] = field(default_factory=dict)
    map_errors: dict[str, dict[str, MapError]] = field(default_factory=dict)
    tried: list[Tried] = field(default_factory=list)
    btf: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    seconds: float = 0.0
    finished: bool = True

    def reached(self, max_error: float) -> bool:
        """Whether every garment, and every BTF, is within `max_error`."""
        records = [r["delta_e"] for rows in self.btf.values() for r in rows]
        return all(e.point <= max_error for e in self.errors.values()) and all(
            e <= max_error for e in records
        )


def bake(
    scene: str | os.PathLike[str],
    out: str | os.PathLike[str],
    settings: Settings | None = None,
    *,
    fabric: str | Fabric | Binding | None = None,
    mesh: str | None = None,
    units: str | None = None,
    resume: bool = False,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Baked:
    """Bake what wears a fabric in `scene` into the folder `out`; its textures and their manifest.

    fabric : laid on everything that names none, as for `render`
    mesh : path of the one mesh to bake
    units : of an .obj or .ply, see `read_scene`
    resume : go on with a bake of the same job that was stopped

    Raises FabricError for a scene, mesh or setting that cannot be baked, before anything is
    written; and for a disk that is full, with what is done kept for `resume`.
    """
    began = time.perf_counter()
    settings = settings or Settings()
    read = read_scene(scene, fabric=fabric, units=units)
    found = _garments(read, settings, mesh, fabric)
    maps = chosen_maps(settings.maps, light=settings.light is not None)
    if settings.file_format not in FORMATS:
        raise FabricError(
            "--format", f"is '{settings.file_format}'; it must be one of {', '.join(FORMATS)}"
        )
    resolution = _resolution(settings, found)
    tiles = [tiles_of(one, settings.udim) for one in found]
    folder = _folder(out)
    for one, places in zip(found, tiles, strict=True):
        refuse_overlaps(one, places, min(resolution, 2048), folder)
    recipes = _recipes(found, settings)
    tried: list[Tried] = []
    if settings.max_error:
        best, tried = cheapest(
            settings.max_error,
            lambda n: [
                _sheets(one, recipes, places, n, MARGIN)[0]
                for one, places in zip(found, tiles, strict=True)
            ],
            resolution,
            sum(map(len, tiles)),
        )
        resolution = best.resolution
        if settings.maps is None:
            maps = maps_with(best.maps, light=settings.light is not None)
    sheets = [
        sheet
        for one, places in zip(found, tiles, strict=True)
        for sheet in _sheets(one, recipes, places, resolution, settings.margin)
    ]
    result = Baked(
        folder=folder,
        resolution=resolution,
        garments=found,
        maps=maps,
        files={},
        tried=tried,
        notes=[*read.notes, *(n for g in found for n in g.notes), *_coarse(found, resolution)],
    )
    scratch = Scratch(folder, _key(found, settings, resolution, maps), resume=resume)
    _check_space(folder, sum(kept(sheet, maps).bytes_needed for sheet in sheets))
    count = worker_count(workers)
    files = Files(folder=folder, udim=settings.udim, file_format=settings.file_format)
    work = Work(
        scratch=scratch, sheets=sheets, maps=maps, files=files, workers=count, progress=progress
    )
    result.finished = compute(work) and assemble(work)
    if not result.finished:
        return result
    for sheet in sheets:
        per_map = result.files.setdefault(sheet.garment.name, {})
        for texture in maps:
            path = files.path(sheet, texture)
            per_map.setdefault(texture.name, {})[sheet.number] = path.name
            note = scratch.note(path)
            if note:
                result.encodings[path.name] = Encoding(**json.loads(note))
    for one in found:
        write_mesh_layer(folder / f"{one.name}.usdc", one, read.up_axis)
    _measure(result, sheets, settings)
    result.seconds = time.perf_counter() - began
    save_all([lay.fabric for one in found for lay in one.lays], folder / "fabrics.usda")
    write_json(folder / "manifest.json", manifest_of(result, settings, Path(scene)))
    write_report(result, settings)
    scratch.close()
    return result


def _measure(result: Baked, sheets: Sequence[Sheet], settings: Settings) -> None:
    """The error of each garment's first sheet, and the BTFs of its fabrics."""
    for sheet in sheets:
        name = sheet.garment.name
        if name not in result.errors:
            names = best_choice([one.name for one in result.maps])
            result.errors[name] = swatch_errors(sheet, (names,))[0]
            result.map_errors[name] = map_errors(
                sheet, result.maps, stored_by(settings.file_format)
            )
        for lay in sheet.garment.lays:
            if settings.btf and lay.fabric.name not in result.btf:
                result.btf[lay.fabric.name] = write_btf(
                    lay.fabric, result.folder, settings.btf,
                    max_error=settings.max_error or MAX_ERROR,
                )  # fmt: skip


def _sheets(
    one: Garment,
    recipes: dict[Fabric, Recipe],
    places: dict[int, tuple[int, int]],
    resolution: int,
    margin: int,
) -> list[Sheet]:
    return sheets_of(
        one, tuple(recipes[lay.fabric] for lay in one.lays), places, resolution, margin
    )


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What a bake would make, a line for each garment, and what had to be assumed or left out."""

    lines: list[str]
    notes: list[str]


def plan(
    scene: str | os.PathLike[str],
    settings: Settings,
    *,
    fabric: str | Fabric | Binding | None = None,
    mesh: str | None = None,
    units: str | None = None,
) -> Plan:
    """What `bake` would make, with the same errors, and nothing written."""
    read = read_scene(scene, fabric=fabric, units=units)
    found = _garments(read, settings, mesh, fabric)
    maps = chosen_maps(settings.maps, light=settings.light is not None)
    resolution = _resolution(settings, found)
    return Plan(
        lines=[
            f"{one.name}: {len(maps)} maps, tiles "
            f"{', '.join(map(str, tiles_of(one, settings.udim)))}, {resolution} x {resolution}, "
            f"{resolution / threads_per_uv(one):.3g} texels per thread; {_extent(one)}"
            for one in found
        ],
        notes=[*read.notes, *(n for g in found for n in g.notes), *_coarse(found, resolution)],
    )


def _extent(one: Garment) -> str:
    """A garment's size, and how many threads of each fabric run across it."""
    corners = one.points[one.triangles].reshape(-1, 3)
    words = size_words(corners.min(axis=0), corners.max(axis=0))
    for k, lay in enumerate(one.lays):
        threads = one.uv[one.lay == k].reshape(-1, 2) @ lay.matrix.T
        if len(threads):
            words += f"; {threads_words(threads)} of {lay.fabric.name} across"
    return words


@explained
def _garments(
    scene: Scene,
    settings: Settings,
    mesh: str | None,
    fabric: str | Fabric | Binding | None,
) -> list[Garment]:
    if settings.unwrap:
        return garments(scene, mesh, partial(unwrapped, settings.unwrap, as_binding(fabric)))
    found = garments(scene, mesh)
    return [fitted(one) for one in found] if settings.fit else found


def _folder(out: str | os.PathLike[str]) -> Path:
    folder = Path(out)
    if folder.exists() and not folder.is_dir():
        raise FabricError(str(folder), "is a file; it must be a folder's name")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FabricError(str(folder), f"cannot be made: {error.strerror}") from error
    if not os.access(folder, os.W_OK):
        raise FabricError(str(folder), "cannot be written; it must be a folder of yours")
    return folder


def _resolution(settings: Settings, found: Sequence[Garment]) -> int:
    asked = settings.resolution
    if settings.texels_per_thread:
        asked = resolution_for(found, settings.texels_per_thread)
    if asked < 64 or asked & (asked - 1) or asked > LARGEST:
        words = f"a power of two from 64 to {LARGEST}"
        if settings.texels_per_thread:
            raise FabricError(
                "--texels-per-thread",
                f"is {settings.texels_per_thread:g}, which takes {asked} texels; it must lead to "
                f"{words}: bake fewer threads a tile",
            )
        raise FabricError("--resolution", f"is {asked}; it must be {words}")
    return asked


def _coarse(found: Sequence[Garment], resolution: int) -> list[str]:
    notes = []
    for one in found:
        texels = resolution / threads_per_uv(one)
        if texels < FEWEST:
            notes.append(
                f"{one.copies[0]} has {texels:.2g} texels per thread; threads resolve from "
                f"{FEWEST:g}, so each texel holds the mean of what it spans"
            )
    return notes


def _recipes(found: Sequence[Garment], settings: Settings) -> dict[Fabric, Recipe]:
    made: dict[Fabric, Recipe] = {}
    for one in found:
        for lay in one.lays:
            if lay.fabric not in made:
                made[lay.fabric] = recipe(
                    lay.fabric, level=settings.level, light=settings.light, method=settings.shadow
                )
    return made


def _key(
    found: Sequence[Garment], settings: Settings, resolution: int, maps: Sequence[TextureMap]
) -> str:
    words = [__version__, repr(settings), str(resolution), *(t.name for t in maps)]
    words += [one.name + one.fingerprint for one in found]
    return hashlib.sha256("\n".join(words).encode()).hexdigest()


def _check_space(folder: Path, need: int) -> None:
    free = shutil.disk_usage(folder).free
    if need > free:
        raise FabricError(
            str(folder),
            f"has {free / 1e9:.3g} GB left; the bake needs {need / 1e9:.3g} GB while it runs",
        )
