"""Rendering a scene to a picture: the path tracer's public entry point."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.shadow.kinds import METHODS
from fabricusd.appearance.weave.footprint import DEFAULT, Limits
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, Fabric
from fabricusd.images.view import View, parse_view
from fabricusd.ranges import RANGES, require_picture, require_ranges
from fabricusd.reference.defaults import default_lights
from fabricusd.reference.denoise import GUIDES, denoised, require_denoiser
from fabricusd.reference.farm import Picture, sample_on
from fabricusd.reference.film import Film, require_aovs
from fabricusd.reference.integrator import Tracer
from fabricusd.reference.passes import Progress, Sampling, sample
from fabricusd.reference.picture_files import DENOISED, picture_targets, write_picture
from fabricusd.reference.rays.camera import build_lens, default_camera
from fabricusd.reference.rays.wave import ALPHA
from fabricusd.reference.start.compile_ahead import EVERY_PICTURE, compile_ahead
from fabricusd.reference.told import asked_for, note_losses, versions
from fabricusd.run.cluster import Cluster, Kept, Made, cluster_or_threads
from fabricusd.run.workers import worker_count
from fabricusd.scene.read import read_scene
from fabricusd.scene.scene import Camera, Scene
from fabricusd.scene.staging import Staging, over_background, put
from fabricusd.steps import watched
from fabricusd.stop import Stop

MOST_SAMPLES = 4096
"""Most samples per pixel of adaptive sampling if no number is given."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RenderResult:
    """A rendered picture with its statistics.

    For several frames, the result holds the sums of the counts and times, all notes, the mean
    number of samples and the worst noise and cut, but only the last frame's layers.

    layers : AOV name -> (h, w, c) float32
    paths : the files written; notes : what was left out or assumed, one line each
    rays : number of rays traced, including shadow rays; seconds : sampling time, without reading
        the scene; processor_seconds : processor time of this process, all workers together, over
        the same span
    not_finite : number of values that were left out because they were not finite
    cut : share of the light that bounds on bounces cut off: what the paths that they ended still
        carried, relative to what the paths that met a surface began with. It is what surfaces
        would gain in an even white surrounding, and at most that in a darker one
    noise : estimated relative error that 99 % of the pixels' means stay below
    complete : False after Ctrl-C
    met : whether in every picture some camera ray hit a surface
    """

    layers: dict[str, NDArray[np.float32]]
    paths: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    rays: int = 0
    seconds: float = 0.0
    processor_seconds: float = 0.0
    not_finite: int = 0
    cut: float = 0.0
    samples: float = 0.0
    noise: float = 0.0
    complete: bool = True
    met: bool = True
    metadata: dict[str, Any] = field(default_factory=dict)


def render(
    scene: str | os.PathLike[str] | Scene,
    out: str | os.PathLike[str] | None = None,
    *,
    fabric: str | Fabric | Binding | None = None,
    camera: str | None = None,
    width: int = 960,
    height: int = 540,
    spp: int | None = None,
    noise: float | None = None,
    max_bounces: int = 4,
    max_translucent: int | None = None,
    level: str = "auto",
    shadow: str = "horizon",
    limits: Limits = DEFAULT,
    aovs: tuple[str, ...] = (),
    frames: tuple[float, ...] | None = None,
    seed: int = 0,
    workers: int | None = None,
    pixel_filter: str = "tent",
    exposure: float = 0.0,
    view: str | View = "neutral",
    staging: Staging = Staging(),  # noqa: B008
    denoise: bool = False,
    estimator: str = "mis",
    complexity: str = "auto",
    units: str | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> RenderResult:
    """Path-trace `scene` (a USD, OBJ, GLB or PLY file, or a `Scene`) and write `out`.

    out : `.exr` for all layers with a `.png` beside it, `.png` alone, or None to write nothing; for
        several frames, each file's name gets the frame's number before the suffix
    fabric : the fabric of every mesh file and of every surface without a material of its own
    spp : samples per pixel; with `noise`, the most that a pixel gets. 64 if neither is given
    limits : where level "auto" changes from one level to the next
    noise : stop sampling a pixel when its relative error is below this
    max_bounces : most bounces of a path at all surfaces but translucent cloth
    max_translucent : most bounces of a path at translucent cloth; None for 64, or for none with
        `max_bounces` 0
    frames : time codes; None for the stage's default time
    exposure : of the PNG, in stops, added to the camera's own
    view : of the PNG, see `images.view`: "neutral", "srgb", "aces" or "ocio CONFIG[:VIEW]"
    staging : the dome, the background, the studio and the camera of a review
    denoise : add the layer `denoised`, which the PNG then shows; needs the extra `denoise`
    complexity : how finely subdivision surfaces are refined: "low" (their cages), "medium", "high"
        or "veryhigh" as in usdrecord and usdview, or "auto" for what the picture can show
    units : of an .obj or .ply, see `read_scene`
    scheduler : of the Dask cluster that samples the pictures, see `run.cluster.open_cluster`; None
        for workers of this process

    Raises `FabricError` if the scene cannot be rendered at all. Whatever had to be left out is in
    the result's `notes`. On Ctrl-C, the samples taken so far are written, and `complete` is False.

    >>> import fabricusd, tempfile
    >>> from fabricusd.samples.write import write_samples
    >>> skirt = write_samples(tempfile.mkdtemp())[0]
    >>> made = fabricusd.render(skirt, fabric="linen_plain", units="cm", width=32, height=18, spp=1)
    >>> made.layers["beauty"].shape  # radiance, scene-linear Rec. 709, and alpha
    (18, 32, 4)
    """
    _require_settings(
        width, height, spp, noise, max_bounces, max_translucent, seed, workers, exposure, shadow
    )
    shown = view if isinstance(view, View) else parse_view(view, "view")
    layers = _layers(aovs, denoise)
    targets = picture_targets(out, _numbers(frames, staging.orbit))
    compile_ahead(EVERY_PICTURE)
    begun = time.perf_counter()
    settings: dict[str, Any] = {
        "width": width, "height": height, "spp": spp, "noise": noise, "max_bounces": max_bounces,
        "max_translucent": max_translucent, "level": level, "shadow": shadow, "limits": limits,
        "aovs": layers, "seed": seed, "pixel_filter": pixel_filter, "estimator": estimator,
    }  # fmt: skip
    found: dict[int, RenderResult] = {}
    paths: dict[int, tuple[str, ...]] = {}
    stops: dict[int, float] = {}

    def scene_of(number: int) -> Scene:
        time_code = None if staging.orbit else targets[number][0]
        loaded = scene if isinstance(scene, Scene) else read_scene(
            scene, fabric=fabric, camera=camera, time_code=time_code, complexity=complexity,
            width=width, units=units, instanced=True,
        )  # fmt: skip
        loaded = _staged(loaded, staging, width / height, number)
        stops[number] = exposure + (loaded.camera.exposure if loaded.camera else 0.0)
        return loaded

    def finish(number: int, result: RenderResult) -> None:
        time_code = None if staging.orbit else targets[number][0]
        _finish(result, staging, denoise)
        result.metadata.update(asked_for(scene, time_code, stops[number], shown))
        paths[number] = write_picture(
            targets[number][1], result.layers, result.metadata, stops[number], shown
        )
        # Keep only the last frame's layers: those of all frames would fill the memory.
        found[number] = result
        for other in found:
            if other != max(found):
                found[other] = replace(found[other], layers={})

    with Stop() as stop, cluster_or_threads(scheduler, workers) as cluster:
        if cluster is not None and len(targets) >= max(cluster.threads, 2):
            _frames_on(cluster, len(targets), settings, scene_of, finish, progress, stop)
        else:
            for number in range(len(targets)):
                result = render_scene(
                    scene_of(number), **settings, workers=workers, stop=stop, cluster=cluster,
                    progress=progress and _of_frame(progress, number, len(targets), begun),
                )  # fmt: skip
                finish(number, result)
                stop.release()
                if stop.asked or not result.complete:
                    break
        notes = tuple(cluster.notes) if cluster is not None else ()
    if not found:
        raise KeyboardInterrupt
    order = sorted(found)
    results, written = [found[k] for k in order], sum((paths[k] for k in order), ())
    return _together(results, written, notes, complete=len(found) == len(targets))


def _frames_on(
    cluster: Cluster,
    count: int,
    settings: dict[str, Any],
    scene_of: Callable[[int], Scene],
    finish: Callable[[int, RenderResult], None],
    progress: Progress | None,
    stop: Stop,
) -> None:
    """Render whole frames as jobs; scenes are read here, shortly before they are handed out."""
    begun, over = time.perf_counter(), 0

    def done(number: int, result: RenderResult) -> None:
        nonlocal over
        finish(number, result)
        over += 1
        if progress is not None:
            progress(over / count, time.perf_counter() - begun)

    stop.hold()
    cluster.run(_frame_on_worker, settings, Made(count, scene_of), done, stop)


def _frame_on_worker(kept: Kept, scene: Scene) -> RenderResult:
    """A frame, on one thread of a worker."""
    return render_scene(scene, **kept.thing, workers=1)


def _layers(aovs: tuple[str, ...], denoise: bool) -> tuple[str, ...]:
    """The layers to render: those asked for, and the guides of the denoiser, if there is one."""
    if denoise:
        require_denoiser()
    layers = tuple(dict.fromkeys(("beauty", *aovs, *(GUIDES if denoise else ()))))
    require_aovs(layers)
    return layers


def _numbers(frames: tuple[float, ...] | None, orbit: int) -> tuple[float, ...] | None:
    """The numbers of the pictures: time codes, or places on an orbit; None for one picture."""
    for code in frames or ():
        RANGES["frame"].require("frames", code)
    if orbit and frames:
        raise FabricError("orbit", "cannot be had with frames; it must be one of both")
    return tuple(range(1, orbit + 1)) or frames


def _staged(scene: Scene, staging: Staging, aspect: float, number: int) -> Scene:
    """`scene` as `staging` asks for it, for picture `number` from 0 of an orbit.

    A scene in memory stays the caller's.
    """
    own = replace(
        scene, lights=[*scene.lights], meshes=[*scene.meshes], materials=[*scene.materials]
    )
    if staging.dome is None and not staging.studio:
        _light(own)
    put(staging, own, aspect, turn=math.tau * number / (staging.orbit or 1))
    return own


def _finish(result: RenderResult, staging: Staging, denoise: bool) -> None:
    """Lay the picture over its background, and denoise it."""
    layers = result.layers
    if denoise:
        layers[DENOISED] = denoised(layers)
    if staging.background is not None:
        alpha = layers["beauty"][..., 3:4]
        layers["beauty"] = over_background(layers["beauty"], staging.background)
        if denoise:
            smooth = np.concatenate((layers[DENOISED], alpha), axis=-1)
            layers[DENOISED] = over_background(smooth, staging.background)[..., :3]


def _of_frame(progress: Progress, number: int, frames: int, begun: float) -> Progress:
    """A callback that reports the progress of frame `number` as a fraction of all frames."""

    def report(share: float, _seconds: float) -> None:
        progress((number + share) / frames, time.perf_counter() - begun)

    return report


def _together(
    results: list[RenderResult], paths: tuple[str, ...], notes: tuple[str, ...], *, complete: bool
) -> RenderResult:
    """Combine the results of several frames, keeping the last frame's layers."""
    return replace(
        results[-1],
        paths=paths,
        notes=(*notes, *dict.fromkeys(note for r in results for note in r.notes)),
        rays=sum(r.rays for r in results),
        seconds=sum(r.seconds for r in results),
        processor_seconds=sum(r.processor_seconds for r in results),
        not_finite=sum(r.not_finite for r in results),
        cut=max(r.cut for r in results),
        samples=float(np.mean([r.samples for r in results])),
        noise=max(r.noise for r in results),
        complete=complete and results[-1].complete,
        met=all(r.met for r in results),
    )


def _require_settings(
    width: int,
    height: int,
    spp: int | None,
    noise: float | None,
    max_bounces: int,
    max_translucent: int | None,
    seed: int,
    workers: int | None,
    exposure: float = 0.0,
    shadow: str = METHODS[0],
) -> None:
    require_picture(width, height)
    require_ranges(max_bounces=max_bounces, seed=seed, exposure=exposure)
    if shadow not in METHODS:
        raise FabricError("shadow", f"is '{shadow}'; it must be one of {', '.join(METHODS)}")
    optional = {
        "spp": spp, "noise": noise, "workers": workers, "max_translucent": max_translucent,
    }  # fmt: skip
    require_ranges(**{name: value for name, value in optional.items() if value is not None})


def render_scene(
    scene: Scene,
    *,
    width: int,
    height: int,
    spp: int | None = None,
    noise: float | None = None,
    max_bounces: int = 4,
    max_translucent: int | None = None,
    level: str = "auto",
    shadow: str = "horizon",
    limits: Limits = DEFAULT,
    aovs: tuple[str, ...] = ("beauty",),
    seed: int = 0,
    workers: int | None = None,
    pixel_filter: str = "tent",
    estimator: str = "mis",
    sampler: str = "sobol",
    progress: Progress | None = None,
    stop: Stop | None = None,
    cluster: Cluster | None = None,
) -> RenderResult:
    """As `render`, for a `Scene` in memory and without writing files.

    cluster : the workers that sample the picture; None for workers of this process
    stop : the handler that asks rendering to stop; it is installed when sampling starts, and the
        caller must release it
    """
    _require_settings(width, height, spp, noise, max_bounces, max_translucent, seed, workers)
    begun = time.perf_counter()
    most = spp or (MOST_SAMPLES if noise else 64)
    camera = _furnished(scene, width, height)
    settings: dict[str, Any] = {
        "max_bounces": max_bounces, "max_translucent": max_translucent, "level": level,
        "shadow": shadow, "limits": limits, "seed": seed, "estimator": estimator,
        "sampler": sampler,
    }  # fmt: skip
    with watched(stop=stop):
        tracer = Tracer(scene, **settings)
    if not len(tracer.tables.triangles):
        scene.note("the scene", "has no triangles to render; only its lights are seen")
    lens = build_lens(camera, width, height, tracer.tables.centre, pixel_filter)
    tracer.aim(lens, width, height)
    film = Film(width, height, aovs)
    sampling = Sampling(width=width, height=height, most=most, noise=noise)
    built = time.perf_counter()
    stop = stop or Stop()
    stop.hold()
    if cluster is None:
        count = worker_count(workers)
        complete, spent = sample(tracer, lens, film, sampling, count, progress, stop)
    else:
        count = cluster.threads
        picture = Picture(
            scene=scene, camera=camera, settings=settings, sampling=sampling,
            pixel_filter=pixel_filter, layers=film.extra,
        )  # fmt: skip
        complete, spent = sample_on(cluster, picture, film, progress, stop)
    if not complete and not film.samples.any():
        # Interrupted in the tables that the first samples need: there is no picture to keep.
        raise KeyboardInterrupt
    seconds = time.perf_counter() - built
    rays, shadow_rays, not_finite = (int(x) for x in spent.counters)
    begun_at = float(film.sums[ALPHA].sum(dtype=np.float64))
    met, cut = begun_at > 0 or not complete, spent.lost / max(begun_at, 1.0)
    note_losses(scene, tracer, lens, not_finite, cut, met, (width, height))
    max_translucent = tracer.max_translucent
    embree, triangles = tracer.accelerator.version, len(tracer.tables.triangles)
    instances = len(tracer.tables.placements)
    # Free the triangles and their acceleration structure before the layers are made.
    del tracer
    error = film.relative_error()
    metadata = {
        **versions(), "fabricusd:embree": embree,
        "fabricusd:estimator": estimator, "fabricusd:sampler": sampler,
        "fabricusd:limits": str(limits),
        "fabricusd:samples": most, "fabricusd:noise": noise or 0.0,
        "fabricusd:maxBounces": max_bounces, "fabricusd:maxTranslucent": max_translucent,
        "fabricusd:cut": cut, "fabricusd:level": level, "fabricusd:shadow": shadow,
        "fabricusd:seed": seed, "fabricusd:workers": count, "fabricusd:pixelFilter": pixel_filter,
        "fabricusd:camera": camera.path, "fabricusd:triangles": triangles,
        "fabricusd:instances": instances,
        "fabricusd:rays": str(rays + shadow_rays), "fabricusd:seconds": round(seconds, 3),
        "fabricusd:preparationSeconds": round(built - begun, 3),
        "fabricusd:notFinite": not_finite, "fabricusd:complete": int(complete),
        "fabricusd:notes": "\n".join(scene.notes),
    }  # fmt: skip
    return RenderResult(
        layers=film.layers(),
        notes=tuple(scene.notes),
        rays=rays + shadow_rays,
        seconds=seconds,
        processor_seconds=spent.seconds,
        not_finite=not_finite,
        cut=cut,
        samples=float(film.samples.mean()),
        noise=_typical_worst(error),
        complete=complete,
        met=met,
        metadata=metadata,
    )


def _light(scene: Scene) -> None:
    """Add lights to a scene without any, with a note."""
    if not scene.lights:
        scene.lights = default_lights(scene)
        scene.note("the scene", "has no light; a sky and a key light are added")


def _furnished(scene: Scene, width: int, height: int) -> Camera:
    """The scene's camera, or one that sees the whole scene. Adds lights to a scene without any."""
    _light(scene)
    if scene.camera is None:
        scene.note("the scene", "has no camera; one that sees all of it from the front is used")
    return scene.camera or default_camera(scene, width, height)


def _typical_worst(error: NDArray[np.float32]) -> float:
    """The relative error that 99 % of the pixels stay below; infinite if no error is known."""
    known = error[np.isfinite(error)]
    return float(np.quantile(known, 0.99)) if known.size else float("inf")
