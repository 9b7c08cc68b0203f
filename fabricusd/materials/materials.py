"""Write the materials of a bake folder for other tools."""

from __future__ import annotations

import os
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pxr import Sdf, Tf, Usd, UsdGeom

from fabricusd import __version__
from fabricusd.bake.manifest_file import file_in
from fabricusd.bake.work.lock import locked, refuse_locked
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.files import remove_partial_files, write_json
from fabricusd.materials.bake_folder import BakeFolder, read_bake_folder
from fabricusd.materials.bound_prims import BoundScene, find_bound_prims
from fabricusd.materials.near import NEAR
from fabricusd.materials.networks.surfaces import GRAPHS, MAPS
from fabricusd.materials.recipes import OF_THREADS, Progress, Settings, Written, recipes
from fabricusd.materials.targets import Job, chosen
from fabricusd.materials.targets.layer import write_baked_look, write_scene_look
from fabricusd.materials.targets.mtlx import write_mtlx
from fabricusd.materials.targets.paths import asset_path
from fabricusd.ranges import RANGES
from fabricusd.run.cluster import Cluster, cluster_or_threads


def write_materials(
    bake: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    settings: Settings | None = None,
    *,
    scene: str | os.PathLike[str] | None = None,
    clobber: bool = True,
    dry_run: bool = False,
    progress: Progress | None = None,
    scheduler: str | Cluster | None = None,
) -> Written:
    """Write a look for a bake: a USD layer, a MaterialX document beside it, and a report.

    bake : output folder of `fabricusd bake`; it is only read
    out : the layer to write, by default `look.usda` in that folder
    scene : the USD scene that was baked, to bind the look to its prims; None binds it to the baked
        meshes
    clobber : whether existing files may be overwritten
    dry_run : return what would be written, but write nothing
    scheduler : of the Dask cluster that does the fits, see `run.cluster.cluster_or_threads`; None
        for this process

    Raises FabricError if the folder holds no bake, if the layer exists and fabricusd did not write
    it, or if the scene is not the one that was baked.
    """
    settings = settings or Settings()
    refuse_locked(Path(bake))
    folder = read_bake_folder(bake)
    _check_surfaces(folder, settings)
    path = Path(out) if out is not None else folder.path / "look.usda"
    _check_target(path, clobber)
    for target, where in chosen(settings.targets):
        target.functions.check(where, clobber)
    _refuse_links(folder.path, path)
    made = Written()
    for name, file in folder.missing:
        made.notes.append(f"{folder.path / file} is missing; {_without(name)}")
    bound = find_bound_prims(Path(scene), folder.garments) if scene is not None else None
    made.notes += bound.notes if bound else ()
    if dry_run:
        made.files = [path, path.with_suffix(".mtlx"), path.with_suffix(".json")]
        return made
    with ExitStack() as locks:
        for place in _written_folders(path, settings):
            locks.enter_context(locked(place))
        remove_partial_files(path.with_name(f"{path.stem}_maps"))
        cluster = locks.enter_context(cluster_or_threads(scheduler, None))
        made.remarks += cluster.notes if cluster is not None else ()
        _write(folder, path, settings, made, bound, scene, clobber, progress, cluster)
    return made


def _write(
    folder: BakeFolder,
    path: Path,
    settings: Settings,
    made: Written,
    bound: BoundScene | None,
    scene: str | os.PathLike[str] | None,
    clobber: bool,
    progress: Progress | None,
    cluster: Cluster | None,
) -> None:
    """Write all files of a look; their folders must be locked."""
    made_of, documents = recipes(folder, path, settings, made, progress, cluster)
    custom = {
        "version": __version__,
        "bake": asset_path(folder.path / "manifest.json", path.parent),
    }
    if bound is not None:
        assert scene is not None
        write_scene_look(path, Path(scene), bound, made_of, custom)
        made.files += [path.with_suffix(".uv.usdc")] if bound.uv else []
    else:
        write_baked_look(path, folder.garments, made_of, custom, _up_axis(folder))
    write_mtlx(path.with_suffix(".mtlx"), documents)
    write_json(path.with_suffix(".json"), _report(made))
    made.files += [path, path.with_suffix(".mtlx"), path.with_suffix(".json")]
    job = Job(
        look=path, garments=folder.garments, recipes=made_of, fabrics=_fabrics(folder),
        fitted=settings.fitted, clobber=clobber, note=made.notes.append, colorway=settings.colorway,
        placed=bound.placed if bound is not None else {}, progress=progress,
    )  # fmt: skip
    for target, where in chosen(settings.targets):
        made.files += target.functions.write(job, where)


def _written_folders(path: Path, settings: Settings) -> list[Path]:
    """Return the folders that a look writes to, without duplicates, in a fixed locking order."""
    places = [path.parent]
    places += [target.functions.folder(path, where) for target, where in chosen(settings.targets)]
    return sorted({place.resolve() for place in places if place.is_dir()})


def _refuse_links(folder: Path, path: Path) -> None:
    """Raise FabricError if writing a look to its bake's folder would follow a link out of it.

    The folder may come from an untrusted source.
    """
    if path.parent.resolve() != folder.resolve():
        return
    maps = f"{path.stem}_maps"
    ends = (".mtlx", ".json", ".uv.usdc")
    for name in (path.name, maps, *(path.with_suffix(end).name for end in ends)):
        file_in(folder, name)
    for inside in (folder / maps).iterdir() if (folder / maps).is_dir() else ():
        file_in(folder, f"{maps}/{inside.name}")
    for shader in folder.glob(f"{path.stem}.*.osl"):
        file_in(folder, shader.name)


def _without(name: str) -> str:
    """Describe what a look does without a map that the bake has lost."""
    if name in MAPS:
        return "a constant replaces it"
    if name == "thread_id":
        return "threads are not fitted individually"
    return "the scene's own mesh is used" if name == "mesh" else "no material reads it"


def _check_surfaces(folder: BakeFolder, settings: Settings) -> None:
    known = (*GRAPHS, *OF_THREADS)
    for name in settings.surfaces:
        if name not in known:
            raise FabricError(
                f"surface '{name}'", f"is unknown; it must be one of {', '.join(known)}"
            )
    nameless = [lay.name for one in folder.garments for lay in one.lays if lay.fabric is None]
    for name in OF_THREADS:
        if name in settings.surfaces and nameless:
            raise FabricError(
                f"fabric '{nameless[0]}'",
                f"is not in the bake folder; surface '{name}' needs it: bake again",
            )
    if "lobes" in settings.surfaces and not settings.fitted:
        raise FabricError("surface 'lobes'", "is fitted; it cannot be written with --no-fit")
    if settings.near not in NEAR:
        raise FabricError("near", f"is '{settings.near}'; it must be one of {', '.join(NEAR)}")
    RANGES["lobes"].require("lobes", settings.lobes)
    if settings.max_error is not None:
        RANGES["max_error"].require("max_error", settings.max_error)


def _fabrics(folder: BakeFolder) -> dict[str, Fabric]:
    """Return the fabrics of a bake by name."""
    return {lay.name: lay.fabric for one in folder.garments for lay in one.lays if lay.fabric}


def _check_target(path: Path, clobber: bool) -> None:
    """Raise FabricError if a look cannot be written to `path` or would replace another's file."""
    if path.suffix not in (".usda", ".usd", ".usdc"):
        raise FabricError(
            str(path), "is not the name of a USD layer; it must end in .usda, .usdc or .usd"
        )
    if not path.parent.is_dir():
        raise FabricError(
            str(path), f"is in '{path.parent}', which is not a folder; create it first"
        )
    if not path.exists():
        return
    if not clobber:
        raise FabricError(str(path), "exists; with --no-clobber, give the name of a new file")
    try:
        layer = Sdf.Layer.FindOrOpen(str(path))
    except Tf.ErrorException:
        layer = None
    if layer is None or "fabricusd" not in (layer.customLayerData or {}):
        raise FabricError(
            str(path), "exists and fabricusd did not write it; give the name of another file"
        )


def _up_axis(folder: BakeFolder) -> str:
    for one in folder.garments:
        if one.mesh.is_file():
            return str(UsdGeom.GetStageUpAxis(Usd.Stage.Open(str(one.mesh))))
    raise FabricError(
        str(folder.path), "has lost all of its meshes; give the scene that was baked with --scene"
    )


def _report(made: Written) -> dict[str, Any]:
    return {
        "fabricusd": __version__,
        "fits": {
            where: {kind: one.as_dict() for kind, one in fits.items()}
            for where, fits in made.fits.items()
        },
        "threads": {
            where: {str(number): one.as_dict() for number, one in threads.items()}
            for where, threads in made.threads.items()
        },
        "lobes": {where: asdict(one) for where, one in made.lobes.items()},
        "notes": made.notes,
        "remarks": made.remarks,
    }
