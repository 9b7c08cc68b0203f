"""From a bake folder to the materials that other tools read."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf

from fabricusd import __version__
from fabricusd.bake.manifest import write_json
from fabricusd.errors import FabricError
from fabricusd.preview.bake_folder import BakeFolder, MapSet, read_bake_folder
from fabricusd.preview.fit import Fitted, fit
from fabricusd.preview.graph import Texture, Value
from fabricusd.preview.layer import (
    MaterialRecipe,
    Recipes,
    write_baked_look,
    write_scene_look,
)
from fabricusd.preview.look import Look
from fabricusd.preview.mtlx import write_mtlx
from fabricusd.preview.paths import asset_path
from fabricusd.preview.surfaces import GRAPHS, MAPS, Inputs, parameter_values, preview
from fabricusd.preview.texels import draw_texels, mean_texel
from fabricusd.preview.wearers import find_wearers
from fabricusd.schema.write import prim_name

OPAQUE = 0.9995
"""Mean cover from which a material has no opacity: blending costs renderers dear."""

NEUTRAL = {
    "base_color": Value("color3", (0.5, 0.5, 0.5)),
    "roughness_along": Value("float", 0.5),
    "roughness_across": Value("float", 0.5),
    "opacity": Value("float", 1.0),
    "normal": Value("vector3", (0.0, 0.0, 1.0)),
    "tangent": Value("vector3", (1.0, 0.0, 0.0)),
}
"""What stands in for a map that is not there."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is written.

    surfaces : MaterialX surfaces, names of `surfaces.GRAPHS`; USD takes the first, the document all
    fitted : whether the parameters are sought; otherwise the textures stand as they are
    """

    surfaces: tuple[str, ...] = ("openpbr",)
    fitted: bool = True


@dataclass(kw_only=True)
class Written:
    """The files that were made, what had to be left out, and the fits."""

    files: list[Path] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    fits: dict[str, dict[str, Fitted]] = field(default_factory=dict)


def write_materials(
    bake: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    settings: Settings | None = None,
    *,
    scene: str | os.PathLike[str] | None = None,
    clobber: bool = True,
    dry_run: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Written:
    """Write a look for a bake: a USD layer, the MaterialX document beside it, and a report.

    bake : the folder that `fabricusd bake` made; it is only read
    out : the layer, by default `look.usda` in that folder
    scene : USD scene that was baked, to write the look over its prims; without it the look goes
        over the baked meshes

    Raises FabricError for a folder without a bake, a layer that fabricusd did not write and would
    overwrite, a scene that was not baked.
    """
    settings = settings or Settings()
    unknown = [s for s in settings.surfaces if s not in GRAPHS]
    if unknown:
        raise FabricError(f"surface '{unknown[0]}'", f"is unknown; it must be of {', '.join(GRAPHS)}")
    folder = read_bake_folder(bake)
    path = Path(out) if out is not None else folder.path / "look.usda"
    _check_target(path, clobber)
    made = Written()
    for name in folder.missing:
        made.notes.append(f"{folder.path / name} is missing; a constant stands in for it")
    dressed = find_wearers(Path(scene), folder.garments) if scene is not None else None
    made.notes += dressed.notes if dressed else ()
    if dry_run:
        made.files = [path, path.with_suffix(".mtlx"), path.with_suffix(".json")]
        return made
    recipes, documents = _recipes(folder, settings, made, progress)
    custom = {
        "version": __version__,
        "bake": asset_path(folder.path / "manifest.json", path.parent),
    }
    if dressed is not None:
        assert scene is not None
        write_scene_look(path, Path(scene), dressed, recipes, custom)
        if dressed.uv:
            made.files.append(path.with_suffix(".uv.usdc"))
    else:
        write_baked_look(path, folder.garments, recipes, custom, _up_axis(folder))
    write_mtlx(path.with_suffix(".mtlx"), documents)
    write_json(path.with_suffix(".json"), _report(made))
    made.files += [path, path.with_suffix(".mtlx"), path.with_suffix(".json")]
    return made


def _check_target(path: Path, clobber: bool) -> None:
    """Refuse to overwrite what fabricusd did not write."""
    if path.suffix not in (".usda", ".usd", ".usdc"):
        raise FabricError(str(path), "is no USD layer's name; it must end in .usda, .usdc or .usd")
    if not path.parent.is_dir():
        raise FabricError(str(path), f"is in '{path.parent}', which is no directory; make it first")
    if not path.exists():
        return
    if not clobber:
        raise FabricError(str(path), "exists; it must be a new name with --no-clobber")
    try:
        layer = Sdf.Layer.FindOrOpen(str(path))
    except Exception:
        layer = None
    if layer is None or "fabricusd" not in (layer.customLayerData or {}):
        raise FabricError(
            str(path), "is a file that fabricusd did not write; it must be another name"
        )


def _up_axis(folder: BakeFolder) -> str:
    from pxr import Usd, UsdGeom

    for one in folder.garments:
        if one.mesh.is_file():
            return str(UsdGeom.GetStageUpAxis(Usd.Stage.Open(str(one.mesh))))
    raise FabricError(str(folder.path), "has none of its meshes; name the scene with --scene")


def _recipes(
    folder: BakeFolder, settings: Settings, made: Written, progress: Callable[[str], None] | None
) -> tuple[Recipes, list[Any]]:
    """The materials of every garment and fabric, and those of the document."""
    recipes: dict[tuple[str, int, str], MaterialRecipe] = {}
    documents = []
    for maps in folder.garments:
        for number, lay in enumerate(maps.lays):
            name = prim_name(maps.name if len(maps.lays) == 1 else f"{maps.name}_{number}")
            looks = _looks(maps, number, settings, made, progress)
            textures, means = texture_inputs(maps), mean_inputs(maps, number)
            cover = means["opacity"].value
            assert isinstance(cover, float)
            opaque = cover > OPAQUE
            for variant, inputs in (("baked", textures), ("procedural", means)):
                title = name if variant == "baked" else f"{name}_plain"
                graphs = {s: GRAPHS[s](inputs, opaque) for s in settings.surfaces}
                first = settings.surfaces[0]
                recipes[maps.name, number, variant] = MaterialRecipe(
                    name=title,
                    graphs=(
                        ("", preview(inputs, looks["preview"], opaque)),
                        ("", graphs[first]),
                    ),
                    parameters=parameter_values(looks[first]),
                )
                for surface, graph in graphs.items():
                    tail = "" if len(graphs) == 1 else f"_{surface}"
                    documents.append((title + tail, graph, parameter_values(looks[surface])))
    return recipes, documents


def texture_inputs(maps: MapSet) -> Inputs:
    """The textures of a garment, and constants for those that are missing."""
    found: dict[str, Texture | Value] = {}
    for name, kind in MAPS.items():
        pattern = maps.pattern(name)
        found[name] = NEUTRAL[name] if pattern is None else Texture(pattern, kind == "color3")
    return found


def mean_inputs(maps: MapSet, number: int) -> dict[str, Value]:
    """One constant for each map: the mean texel of a lay."""
    texel = mean_texel(maps, number)
    return {
        name: Value(kind, texel[name] if kind != "float" else texel[name][0])
        if name in texel
        else NEUTRAL[name]
        for name, kind in MAPS.items()
    }


def _looks(
    maps: MapSet, number: int, settings: Settings, made: Written,
    progress: Callable[[str], None] | None,
) -> dict[str, Look]:  # fmt: skip
    """The look for each surface that is written; lays of one fabric and scale share a fit."""
    lay = maps.lays[number]
    kinds = ("preview", *settings.surfaces)
    plain = dict.fromkeys(kinds, Look())
    if not settings.fitted:
        return plain
    if lay.fabric is None:
        made.notes.append(f"fabric '{lay.name}' is not in the folder; its parameters are not fitted")
        return plain
    texels = draw_texels(maps, number, lay)
    if texels is None:
        made.notes.append(f"{maps.name} lacks maps that a fit needs; its parameters are not fitted")
        return plain
    found = {}
    for kind in kinds:
        if progress:
            progress(f"fitting {kind} to {lay.name} on {maps.name}")
        found[kind] = fit(kind, texels, lay.fabric)
    made.fits[f"{maps.name} {lay.name}"] = found
    return {kind: one.look for kind, one in found.items()}


def _report(made: Written) -> dict[str, Any]:
    return {
        "fabricusd": __version__,
        "fits": {
            where: {kind: one.as_dict() for kind, one in fits.items()}
            for where, fits in made.fits.items()
        },
        "notes": made.notes,
        "numpy": np.__version__,
    }


__all__: Sequence[str] = ("Settings", "Written", "write_materials")
