"""Compose a bake's materials from textures or constants, networks and fitted parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from fabricusd.errors import FabricError
from fabricusd.images.files import read_mip_level, write_png
from fabricusd.materials.bake_folder import BakedLay, BakeFolder, MapSet
from fabricusd.materials.fit.fit import Fitted, bounds_met
from fabricusd.materials.fit.keep import fit_lay
from fabricusd.materials.fit.spanning import takes_the_mean, write_spanning_maps
from fabricusd.materials.fit.texels import draw_texels, mean_texel
from fabricusd.materials.fit.thread_maps import COLUMNS, Factors, write_thread_maps
from fabricusd.materials.fit_ahead import Lobes, Surfaces, fit_ahead
from fabricusd.materials.lobes.fit import COUNT
from fabricusd.materials.lobes.inputs import inputs as lobe_inputs
from fabricusd.materials.lobes.known import mixture_of
from fabricusd.materials.lobes.mixture import CYCLES, MATERIALX, Mixture, of_covered
from fabricusd.materials.lobes.network import Texel, lobes
from fabricusd.materials.lobes.parameters import at_bounds
from fabricusd.materials.near import AUTO, OFF
from fabricusd.materials.near.inputs import near_inputs
from fabricusd.materials.near.keep import moved_to, near_of
from fabricusd.materials.near.network import NearTexel
from fabricusd.materials.near.recipe import Files, Threads, threads_of
from fabricusd.materials.networks.graph import Builder, Graph, Texture, Value, unrolled
from fabricusd.materials.networks.hair import hair
from fabricusd.materials.networks.look import Look
from fabricusd.materials.networks.surfaces import (
    GRAPHS,
    LIT_THROUGH,
    MAPS,
    NO_TINT,
    NO_TRANSMISSION,
    Inputs,
    parameter_values,
    preview,
    transmits,
)
from fabricusd.materials.targets import Wanted, chosen
from fabricusd.materials.targets.layer import MaterialRecipe, Recipes
from fabricusd.run.cluster import Cluster
from fabricusd.schema.names import prim_name

Progress = Callable[[str], None]

BLENDER = "principled:"
"""Prefix of the material's inputs for Blender's Principled BSDF, which the add-on reads."""

OF_THREADS = ("hair", "lobes")
"""Surfaces that are made of a fabric and not of the textures of its bake."""

OPAQUE = 0.9995
"""Mean cover from which a material is opaque, since blending is expensive for renderers."""

LEAST_COVER = 1e-3
"""Mean cover of cloth of which nothing is seen."""

NEUTRAL = {
    "base_color": Value("color3", (0.5, 0.5, 0.5)),
    "roughness_along": Value("float", 0.5),
    "roughness_across": Value("float", 0.5),
    "opacity": Value("float", 1.0),
    "normal": Value("vector3", (0.5, 0.5, 1.0)),
    "tangent": Value("vector3", (1.0, 0.0, 0.0)),
    "specular_tint": NO_TINT,
    "transmission_color": NO_TRANSMISSION,
}
"""Constants that replace missing maps."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What to write.

    surfaces : MaterialX surfaces, names of `surfaces.GRAPHS` or OF_THREADS; USD takes the first,
        the document all
    lobes, max_error : number of lobes of surface "lobes", and the mean delta E 2000 that fewer may
        have; None takes that number
    near : where lobes take single threads from, one of `near.NEAR`
    fitted : whether the parameters are sought; otherwise the textures stand as they are
    targets : what is written besides, names of `targets.TARGETS`, and where
    colorway : name of an asset's variant, "" for the fabrics' names
    """

    surfaces: tuple[str, ...] = ("openpbr",)
    fitted: bool = True
    lobes: int = COUNT
    max_error: float | None = None
    near: str = AUTO
    targets: Wanted = field(default_factory=dict)
    colorway: str = ""


@dataclass(kw_only=True)
class Written:
    """The files that were written, notes on omissions, and the fits of surfaces and threads.

    remarks : what is worth knowing though nothing was left out
    """

    files: list[Path] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    fits: dict[str, dict[str, Fitted]] = field(default_factory=dict)
    threads: dict[str, dict[int, Fitted]] = field(default_factory=dict)
    lobes: dict[str, Mixture] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)


def recipes(
    folder: BakeFolder, path: Path, settings: Settings, made: Written,
    progress: Progress | None, cluster: Cluster | None = None,
) -> tuple[Recipes, list[Any]]:  # fmt: skip
    """Return the materials of every garment and fabric, and those of the MaterialX document.

    cluster : does the fits; None for this process
    """
    found: dict[tuple[str, int, str], MaterialRecipe] = {}
    documents = []
    seen_of = {maps.name: _shown(maps, path, made) for maps in folder.garments}
    if cluster is not None:
        fit_ahead(_jobs(folder, seen_of, settings), cluster, progress)
    for maps in folder.garments:
        seen = seen_of[maps.name]
        found_looks, fitted = _garment_looks(maps, seen, path, settings, made, progress)
        threads = _threads(maps, path, settings, made)
        for number, lay in enumerate(maps.lays):
            textures = texture_inputs(seen[number], path, made)
            takes_threads = fitted is not maps and seen[number] is maps
            of_threads = texture_inputs(fitted, path, made) if takes_threads else textures
            one = maps.name if len(maps.lays) == 1 else f"{maps.name}_{number}"
            name = prim_name(one, ascii_only=True)
            looks = found_looks[number]
            means, of_means = mean_inputs(maps, number), mean_inputs(fitted, number)
            cover = means["opacity"].value
            assert isinstance(cover, float)
            opaque = cover > OPAQUE
            mixture = _mixture(maps, number, settings, made, progress)
            more: dict[str, Value | Texture] = {}
            of_lobes, near = more, None
            if mixture is not None:
                covered = 1.0 if opaque else max(cover, LEAST_COVER)
                shown = threads.get(number)
                near = _texel(lay, mixture, covered, shown, progress)
                mixture = of_covered(mixture, covered)
                more, of_lobes = _for_cycles(lay, settings, covered, shown, progress)
            dark = {} if transmits(means) else {"transmission_color": NO_TRANSMISSION}
            if not dark:
                _note_no_light_through(lay.name, settings, made)
                found_looks[number] = {k: lit_through(one) for k, one in looks.items()}
                looks = found_looks[number]
            for variant, plain, inputs in (
                ("baked", textures, {**of_threads, **dark}),
                ("procedural", means, {**of_means, **dark}),
            ):
                title = name if variant == "baked" else f"{name}_plain"
                texel = near if variant == "baked" else None
                graphs = {
                    s: _graph(s, inputs, opaque, lay, mixture, texel) for s in settings.surfaces
                }
                found[maps.name, number, variant] = material_recipe(
                    title,
                    graphs,
                    plain,
                    looks,
                    opaque,
                    inputs,
                    of_lobes if variant == "baked" else more,
                )
                for surface, graph in graphs.items():
                    tail = "" if len(graphs) == 1 else f"_{surface}"
                    documents.append((title + tail, graph, parameter_values(looks[surface])))
    return found, documents


def _graph(
    surface: str, inputs: Inputs, opaque: bool, lay: BakedLay, mixture: Mixture | None,
    near: Callable[[Builder], Texel] | None,
) -> Graph:  # fmt: skip
    if surface in GRAPHS:
        return GRAPHS[surface](inputs, opaque)
    if surface == "hair":
        return hair(inputs, opaque, lay)
    assert mixture is not None
    return lobes(inputs, opaque, mixture, lay.matrix, near)


def _mixture(
    maps: MapSet, number: int, settings: Settings, made: Written, progress: Progress | None
) -> Mixture | None:
    """Return the lobes of a lay's fabric, if they are asked for."""
    fabric = maps.lays[number].fabric
    if "lobes" not in settings.surfaces or fabric is None:
        return None
    found = mixture_of(
        fabric, settings.lobes, MATERIALX, max_error=settings.max_error, progress=progress
    )
    where = f"{maps.name} {maps.lays[number].name}"
    made.lobes[where] = found
    made.remarks += [f"lobes of {where}: {told}" for told in at_bounds(found)]
    return found


def _threads(maps: MapSet, path: Path, settings: Settings, made: Written) -> dict[int, Threads]:
    """Return the threads of each lay that the lobes of a garment show near by."""
    if "lobes" not in settings.surfaces:
        return {}
    files = Files(folder=lambda: maps_folder(path), files=made.files, remarks=made.remarks)
    return threads_of(maps, settings.near, files)


def _texel(
    lay: BakedLay, far: Mixture, cover: float, threads: Threads | None, progress: Progress | None
) -> Callable[[Builder], Texel] | None:
    """Return what adds the nodes of single threads to the network of MaterialX."""
    if threads is None or lay.fabric is None:
        return None
    near = moved_to(near_of(lay.fabric, far, progress), threads.parts)
    near = replace(near, factors=near.factors * cover)
    return lambda builder: NearTexel(builder, near, threads.laid)


def _for_cycles(
    lay: BakedLay, settings: Settings, cover: float, threads: Threads | None,
    progress: Progress | None,
) -> tuple[dict[str, Value | Texture], dict[str, Value | Texture]]:  # fmt: skip
    """Return the inputs from which Blender's add-on builds the lobes, without threads and with."""
    assert lay.fabric is not None
    found = mixture_of(lay.fabric, settings.lobes, CYCLES, max_error=settings.max_error)
    far: dict[str, Value | Texture] = {}
    far |= lobe_inputs(of_covered(found, cover), lay.fabric.name, lay.matrix)
    if threads is None:
        return far, far
    near = moved_to(near_of(lay.fabric, found, progress), threads.parts)
    return far, far | near_inputs(near, threads.laid, cover)


def lit_through(look: Look) -> Look:
    """A look of cloth that light comes through; without a fit the map stays as it is."""
    return replace(look, transmission_scale=look.transmission_scale or (1.0, 1.0, 1.0))


def _note_no_light_through(fabric: str, settings: Settings, made: Written) -> None:
    for surface in settings.surfaces:
        if surface in GRAPHS and surface not in LIT_THROUGH:
            made.notes.append(
                f"surface '{surface}' cannot carry the light that comes through fabric '{fabric}'; "
                f"it is left out there: use {' or '.join(LIT_THROUGH)}"
            )


def material_recipe(
    name: str, graphs: Mapping[str, Graph], plain: Inputs, looks: Mapping[str, Look], opaque: bool,
    inputs: Inputs | None = None, more: Mapping[str, Value | Texture] | None = None,
) -> MaterialRecipe:  # fmt: skip
    """A material of UsdPreviewSurface over `plain` and the first of `graphs`.

    looks : by kind of surface, "preview", "principled" and those of `graphs`
    inputs : the maps of `graphs`, None for `plain`
    more : inputs of the material that no network reads
    """
    first = next(iter(graphs))
    fitted = parameter_values(looks[first]) | parameter_values(looks["principled"], BLENDER)
    return MaterialRecipe(
        name=name,
        graphs=(("", preview(plain, looks["preview"], opaque)), ("", unrolled(graphs[first]))),
        parameters={**fitted, **(more or {})},
        inputs=plain if inputs is None else inputs,
        looks=looks,
        opaque=opaque,
    )


def texture_inputs(maps: MapSet, path: Path, made: Written) -> Inputs:
    """Return the textures of a garment, with constants for those that are missing."""
    found: dict[str, Texture | Value] = {}
    for name, kind in MAPS.items():
        pattern = maps.pattern(name)
        if pattern is not None and name == "normal":
            pattern = _coded_normals(maps, path, made)
        found[name] = NEUTRAL[name] if pattern is None else Texture(pattern, kind == "color3")
    return found


def maps_folder(path: Path) -> Path:
    """Return the folder beside a look for its own textures, and create it if necessary."""
    folder = path.with_name(f"{path.stem}_maps")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise FabricError(
            str(folder), f"cannot be created: {error.strerror}; write the look elsewhere"
        ) from error
    return folder


def _coded_normals(maps: MapSet, path: Path, made: Written) -> Path:
    """Write normals as 16-bit PNG files, mapped to [0, 1] as readers of normal maps expect."""
    folder = maps_folder(path)
    name = f"normal.{maps.spanned}" if maps.spanned else "normal"
    for number, source in maps.textures["normal"].items():
        target = folder / f"{maps.name}.{name}.{number}.png"
        if target in made.files:
            continue
        codes = np.clip(0.5 * read_mip_level(source) + 0.5, 0.0, 1.0)
        # Texels outside the UV layout have no normal; use the unperturbed one.
        codes[np.all(codes == 0.5, axis=-1)] = (0.5, 0.5, 1.0)
        write_png(target, np.rint(codes * 65535).astype(np.uint16), color_space="raw")
        made.files.append(target)
    return folder / f"{maps.name}.{name}.{'<UDIM>' if maps.udim else number}.png"


def mean_inputs(maps: MapSet, number: int) -> dict[str, Value]:
    """Return a constant for each map: the mean texel of a lay."""
    texel = mean_texel(maps, number)
    if "normal" in texel:
        texel["normal"] = tuple(0.5 * x + 0.5 for x in texel["normal"])
    return {
        name: Value(kind, texel[name] if kind != "float" else texel[name][0])
        if name in texel
        else NEUTRAL[name]
        for name, kind in MAPS.items()
    }


def _shown(maps: MapSet, path: Path, made: Written) -> list[MapSet]:
    """Return the maps of each lay: where texels do not resolve threads, those that shape
    reflections are those of `spanning`."""
    seen = []
    for number, lay in enumerate(maps.lays):
        shown = maps
        if takes_the_mean(maps, lay):
            shown, files = write_spanning_maps(maps, number, maps_folder(path))
            made.files += files
        seen.append(shown)
    return seen


def _garment_looks(
    maps: MapSet, seen: list[MapSet], path: Path, settings: Settings, made: Written,
    progress: Progress | None,
) -> tuple[list[dict[str, Look]], MapSet]:  # fmt: skip
    """Return the looks of each lay, and the maps that include each thread's own fit.

    seen : the maps of each lay

    Where texels resolve threads, all surfaces except UsdPreviewSurface take the latter.
    """
    looks, factors = [], {}
    for number in range(len(maps.lays)):
        of_lay, of_threads = _looks(seen[number], number, settings, made, progress)
        looks.append(of_lay)
        if of_threads:
            factors[number] = of_threads
    if not factors:
        return looks, maps
    fitted = write_thread_maps(maps, factors, maps_folder(path))
    made.files += [fitted.textures[name][t] for name in COLUMNS for t in fitted.textures[name]]
    return looks, fitted


def _kinds(settings: Settings) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The surfaces that are written, and all that are fitted to texels."""
    besides = [kind for target, _ in chosen(settings.targets) for kind in target.fits]
    named = tuple(dict.fromkeys((*settings.surfaces, *besides)))
    return named, ("preview", "principled", *(s for s in named if s in GRAPHS))


def _jobs(
    folder: BakeFolder, seen: Mapping[str, list[MapSet]], settings: Settings
) -> list[Surfaces | Lobes]:
    """The fits of a look, each of which a worker of a cluster can do."""
    found: dict[Any, Surfaces | Lobes] = {}
    _, kinds = _kinds(settings)
    for maps in folder.garments:
        for number, lay in enumerate(maps.lays):
            if lay.fabric is None or not settings.fitted:
                continue
            texels = draw_texels(seen[maps.name][number], number, lay)
            if texels is not None:
                found[maps.name, number] = Surfaces(texels, lay.fabric, kinds)
            if "lobes" in settings.surfaces:
                near = settings.near != OFF
                found[lay.fabric] = Lobes(lay.fabric, settings.lobes, settings.max_error, near)
    return list(found.values())


def _looks(
    maps: MapSet, number: int, settings: Settings, made: Written,
    progress: Progress | None,
) -> tuple[dict[str, Look], Factors]:  # fmt: skip
    """Return the look of each surface that is written, and the factors of each thread, if any."""
    lay = maps.lays[number]
    named, kinds = _kinds(settings)
    plain = dict.fromkeys(("preview", "principled", *named), Look())
    if not settings.fitted:
        return plain, {}
    if lay.fabric is None:
        made.notes.append(
            f"fabric '{lay.name}' is not in the bake folder; its parameters are not fitted"
        )
        return plain, {}
    texels = draw_texels(maps, number, lay)
    if texels is None:
        note = f"{maps.name} lacks maps that the fit needs; its parameters are not fitted"
        if note not in made.notes:
            made.notes.append(note)
        return plain, {}

    where = f"{maps.name} {lay.name}"

    def waiting(what: str) -> Callable[[], None]:
        line = f"fitting {what} to {lay.name} on {maps.name}"
        return lambda: progress(line) if progress else None

    found, threads, factors = fit_lay(texels, lay.fabric, kinds, waiting=waiting)
    if threads:
        made.threads[where] = threads
    for kind in kinds:
        made.remarks += [
            f"{kind} of {where}: {told}" for told in bounds_met(kind, found[kind].look)
        ]
    made.fits[where] = found
    return plain | {kind: one.look for kind, one in found.items()}, factors
