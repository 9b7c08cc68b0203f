"""Bake the fabrics of a scene into a folder of textures."""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from fabricusd import __version__
from fabricusd.appearance.scattering.models import translucent
from fabricusd.bake.btf.matrix import table_size
from fabricusd.bake.btf.write import MAX_ERROR, PER_THREAD, write_btf
from fabricusd.bake.error.accuracy import swatch_errors
from fabricusd.bake.error.choose import Tried, cheapest, maps_with
from fabricusd.bake.error.map_error import map_errors
from fabricusd.bake.error.relight import best_choice
from fabricusd.bake.job import MARGIN, Baked, Settings
from fabricusd.bake.layout.garment import (
    Garment,
    fitted,
    garments,
    resolution_for,
    threads_per_uv,
    tiles_of,
)
from fabricusd.bake.layout.mesh_layer import write_mesh_layer
from fabricusd.bake.layout.overlaps import refuse_overlaps
from fabricusd.bake.layout.unwrap import unwrapped
from fabricusd.bake.manifest import manifest_of
from fabricusd.bake.ranges import check_settings
from fabricusd.bake.reasons import explained
from fabricusd.bake.report import Portrait, write_report
from fabricusd.bake.texels.encoding import stored_by
from fabricusd.bake.texels.maps import TextureMap, chosen_maps
from fabricusd.bake.texels.recipe import Recipe, recipe
from fabricusd.bake.texels.sheet import LARGEST, SMALLEST, Sheet, sheets_of
from fabricusd.bake.work.assemble import Files, Progress, Work, assemble, compute
from fabricusd.bake.work.checkpoint import space_needed
from fabricusd.bake.work.lock import locked, refuse_locked
from fabricusd.bake.work.scratch import Scratch
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, Fabric
from fabricusd.files import remove_partial_files, write_json
from fabricusd.run.cluster import Cluster, cluster_or_threads
from fabricusd.run.workers import worker_count
from fabricusd.scene.read import as_binding, read_scene
from fabricusd.scene.scene import Scene
from fabricusd.scene.size import size_words, threads_words
from fabricusd.schema import save_all

FEWEST = 2.0
"""Texels per thread below which a texel holds the mean of several threads instead of one thread."""


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
    scheduler: str | None = None,
    progress: Progress | None = None,
    portrait: Portrait | None = None,
) -> Baked:
    """Bake every mesh of `scene` that wears a fabric: write textures and a manifest to `out`.

    fabric : the fabric of all meshes that do not bind one, as in `render`
    mesh : path of a single mesh to bake; None bakes all of them
    units : length unit of an .obj or .ply file, see `read_scene`
    resume : continue an interrupted bake of the same job
    scheduler : of the Dask cluster that computes the blocks, see `run.cluster.open_cluster`; None
        for threads of this process
    portrait : draws the garment for the report, which else shows none

    Raises FabricError before anything is written if the scene, the mesh or a setting cannot be
    baked or if another process bakes into `out`. Raises FabricError if the disk fills up; finished
    blocks then remain on disk for `resume`.
    """
    began = time.perf_counter()
    settings = settings or Settings()
    count = worker_count(workers)
    job = _job(scene, settings, fabric, mesh, units)
    folder = _folder(out)
    with cluster_or_threads(scheduler, workers) as cluster, locked(folder):
        remove_partial_files(folder / "report")
        result = _bake(job, folder, resume, count, cluster, progress)
        result.notes += cluster.notes if cluster is not None else []
        if result.finished:
            result.seconds = time.perf_counter() - began
            write_json(folder / "manifest.json", manifest_of(result, settings, Path(scene)))
            write_report(result, settings, Path(scene), portrait)
            Scratch.remove(folder)
    return result


BACK = "back_base_color"
"""The map of the cloth's back, which other maps do not need."""


@dataclass(frozen=True, kw_only=True)
class _Job:
    """A checked request: the garments, maps and resolution to bake.

    notes : from the scene's reader
    through : whether light comes through a fabric of the bake
    tiles : UDIM tiles of each garment, in the order of `found`
    """

    settings: Settings
    notes: list[str]
    up_axis: str
    found: list[Garment]
    maps: list[TextureMap]
    through: bool
    resolution: int
    tiles: list[dict[int, tuple[int, int]]]


def _job(
    scene: str | os.PathLike[str],
    settings: Settings,
    fabric: str | Fabric | Binding | None,
    mesh: str | None,
    units: str | None,
) -> _Job:
    check_settings(settings)
    read = read_scene(scene, fabric=fabric, units=units)
    found = _garments(read, settings, mesh, fabric)
    through = any(translucent(lay.fabric) for one in found for lay in one.lays)
    if not through and settings.maps and BACK in settings.maps:
        raise FabricError(
            f"map '{BACK}'",
            "needs a fabric that light comes through: threads of the model 'conserving', and not "
            "opaque",
        )
    if settings.btf:
        for one in found:
            for lay in one.lays:
                table_size(lay.fabric, PER_THREAD)
    return _Job(
        settings=settings,
        notes=read.notes,
        up_axis=read.up_axis,
        found=found,
        maps=chosen_maps(settings.maps, light=settings.light is not None, through=through),
        through=through,
        resolution=_resolution(settings, found),
        tiles=[tiles_of(one, settings.udim) for one in found],
    )


def _bake(
    job: _Job,
    folder: Path,
    resume: bool,
    workers: int,
    cluster: Cluster | None,
    progress: Progress | None,
) -> Baked:
    """Write the textures, meshes and fabrics to `folder` and measure their errors."""
    settings, found = job.settings, job.found
    for one, places in zip(found, job.tiles, strict=True):
        refuse_overlaps(one, places, min(job.resolution, 2048), folder)
    recipes = _recipes(job)
    resolution, maps, tried = _chosen(job, recipes)
    sheets = [
        sheet
        for one, places in zip(found, job.tiles, strict=True)
        for sheet in _sheets(one, recipes, places, resolution, settings.margin)
    ]
    result = Baked(
        folder=folder,
        resolution=resolution,
        garments=found,
        maps=maps,
        files={},
        tried=tried,
        notes=[*job.notes, *(n for g in found for n in g.notes), *_coarse(found, resolution)],
    )
    values = cluster is not None
    key = _key(found, settings, resolution, maps, values=values)
    scratch = Scratch(folder, key, resume=resume)
    _check_space(folder, job, resolution, maps, values=values)
    files = Files(folder=folder, udim=settings.udim, file_format=settings.file_format)
    work = Work(
        scratch=scratch,
        sheets=sheets,
        maps=maps,
        files=files,
        workers=workers,
        progress=progress,
        cluster=cluster,
    )
    result.finished = compute(work) and assemble(work)
    if not result.finished:
        return result
    for sheet in sheets:
        per_map = result.files.setdefault(sheet.garment.name, {})
        for texture in maps:
            path = files.path(sheet, texture)
            per_map.setdefault(texture.name, {})[sheet.number] = path.name
            encoding = scratch.encoding(path)
            if encoding:
                result.encodings[path.name] = encoding
    for one in found:
        write_mesh_layer(folder / f"{one.name}.usdc", one, job.up_axis)
    _measure(result, sheets, settings)
    save_all([lay.fabric for one in found for lay in one.lays], folder / "fabrics.usda")
    return result


def _chosen(job: _Job, recipes: dict[Fabric, Recipe]) -> tuple[int, list[TextureMap], list[Tried]]:
    """Return the resolution, the maps and the trials of a search.

    With `max_error` set, the cheapest choice that meets it; otherwise what the settings name.
    """
    settings = job.settings
    if not settings.max_error:
        return job.resolution, job.maps, []
    best, tried = cheapest(
        settings.max_error,
        lambda n: [
            _sheets(one, recipes, places, n, MARGIN)[0]
            for one, places in zip(job.found, job.tiles, strict=True)
        ],
        job.resolution,
        sum(map(len, job.tiles)),
    )
    if settings.maps is not None:
        return best.resolution, job.maps, tried
    lit = settings.light is not None
    return best.resolution, maps_with(best.maps, light=lit, through=job.through), tried


def _measure(result: Baked, sheets: Sequence[Sheet], settings: Settings) -> None:
    """Measure the error of each garment's first sheet and write the BTFs of its fabrics."""
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
    """What a bake would write: one line per garment, and notes on assumptions and omissions."""

    lines: list[str]
    notes: list[str]


def plan(
    scene: str | os.PathLike[str],
    settings: Settings,
    *,
    out: str | os.PathLike[str] | None = None,
    fabric: str | Fabric | Binding | None = None,
    mesh: str | None = None,
    units: str | None = None,
    workers: int | None = None,
) -> Plan:
    """Describe what `bake` would write, without writing it.

    Raises the same errors. Those of the folder need `out`, and with `max_error` the space on its
    disk is not compared.
    """
    worker_count(workers)
    job = _job(scene, settings, fabric, mesh, units)
    if out is not None:
        _check_folder(Path(out))
        refuse_locked(Path(out))
        # A search takes the least resolution that does, which is not known yet.
        if not settings.max_error:
            _check_space(Path(out), job, job.resolution, job.maps)
    for one, places in zip(job.found, job.tiles, strict=True):
        refuse_overlaps(one, places, min(job.resolution, 2048), None)
    return Plan(
        lines=[
            f"{one.name}: {len(job.maps)} maps, tiles {', '.join(map(str, places))}, "
            f"{job.resolution} x {job.resolution}, "
            f"{job.resolution / threads_per_uv(one):.3g} texels per thread; {_extent(one)}"
            for one, places in zip(job.found, job.tiles, strict=True)
        ],
        notes=[
            *job.notes,
            *(n for g in job.found for n in g.notes),
            *_coarse(job.found, job.resolution),
        ],
    )


def _extent(one: Garment) -> str:
    """Describe a garment's size and how many threads of each fabric run across it."""
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
        # The warp follows a world axis, so a rotated copy of a mesh has a different grain.
        make = partial(unwrapped, settings.unwrap, as_binding(fabric))
        return garments(scene, mesh, make, turned=False)
    found = garments(scene, mesh)
    return [fitted(one) for one in found] if settings.fit else found


def _folder(out: str | os.PathLike[str]) -> Path:
    folder = Path(out)
    _check_folder(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FabricError(str(folder), f"cannot be created: {error.strerror}") from error
    return folder


def _check_folder(folder: Path) -> None:
    """Raise FabricError for a folder that cannot be created or written to."""
    # os.path returns False where pathlib raises: for overlong names and unreadable parents.
    if os.path.exists(folder) and not os.path.isdir(folder):
        raise FabricError(str(folder), "is a file; the output must be a folder")
    there = _nearest(folder)
    if not os.path.isdir(there):
        raise FabricError(str(folder), f"cannot be created: {there} is a file, not a folder")
    if not os.access(there, os.W_OK):
        verb = "written" if there == folder else "created"
        raise FabricError(str(folder), f"cannot be {verb}: you may not write to {there}")


def _nearest(folder: Path) -> Path:
    """The folder, or the nearest of its parents that exists."""
    return next((one for one in (folder, *folder.parents) if os.path.exists(one)), Path("."))


def _resolution(settings: Settings, found: Sequence[Garment]) -> int:
    if not settings.texels_per_thread:
        return settings.resolution
    asked = resolution_for(found, settings.texels_per_thread)
    if not SMALLEST <= asked <= LARGEST:
        raise FabricError(
            "--texels-per-thread",
            f"is {settings.texels_per_thread:g}, which needs a resolution of {asked:.6g} texels; "
            f"the resolution must be from {SMALLEST} to {LARGEST}: bake fewer threads per tile",
        )
    return asked


def _coarse(found: Sequence[Garment], resolution: int) -> list[str]:
    notes = []
    for one in found:
        texels = resolution / threads_per_uv(one)
        if texels < FEWEST:
            notes.append(
                f"{one.copies[0]} has {texels:.2g} texels per thread; threads are resolved from "
                f"{FEWEST:g} upwards, so each texel holds the mean of the threads it spans"
            )
    return notes


def _recipes(job: _Job) -> dict[Fabric, Recipe]:
    made: dict[Fabric, Recipe] = {}
    settings, back = job.settings, any(one.name == BACK for one in job.maps)
    for one in job.found:
        for lay in one.lays:
            if lay.fabric not in made:
                made[lay.fabric] = recipe(
                    lay.fabric, level=settings.level, light=settings.light, method=settings.shadow,
                    back=back,
                )  # fmt: skip
    return made


def _key(
    found: Sequence[Garment],
    settings: Settings,
    resolution: int,
    maps: Sequence[TextureMap],
    *,
    values: bool,
) -> str:
    words = [__version__, repr(settings), str(resolution), *(t.name for t in maps)]
    words += [one.name + one.fingerprint for one in found]
    # Blocks of a cluster are stored otherwise.
    words += ["values"] if values else []
    return hashlib.sha256("\n".join(words).encode()).hexdigest()


def _check_space(
    folder: Path, job: _Job, resolution: int, maps: Sequence[TextureMap], *, values: bool = False
) -> None:
    """Raise FabricError if the disk has less than the bake's working space.

    folder : may be missing
    """
    need = sum(
        len(places) * space_needed(one, resolution, maps, values=values)
        for one, places in zip(job.found, job.tiles, strict=True)
    )
    free = shutil.disk_usage(_nearest(folder)).free
    if need > free:
        raise FabricError(
            str(folder),
            f"has {free / 1e9:.3g} GB left; the bake needs {need / 1e9:.3g} GB of working space",
        )
