"""The path integrator: batches of paths go through trace, arrive, shade and depart until they end.

Each stage is one compiled loop over all rays of a batch and releases Python's global interpreter
lock. Workers can therefore be plain Python threads, and the scheduler hands out batches.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.footprint import DEFAULT, Limits
from fabricusd.errors import FabricError
from fabricusd.kernels.calls import Calls
from fabricusd.reference.lights.table import build_lights, share_out
from fabricusd.reference.rays.camera import Lens, camera_rays
from fabricusd.reference.rays.embree import (
    DX,
    DZ,
    GEOMETRY,
    MISS,
    OX,
    OZ,
    ROWS,
    TFAR,
    Accelerator,
    has_instances,
)
from fabricusd.reference.rays.placed import Carrier
from fabricusd.reference.rays.sobol import new_numbers
from fabricusd.reference.rays.triangles import build_tables
from fabricusd.reference.rays.wave import (
    BEAUTY_ROWS,
    FAR_LEVEL,
    LANE_BETA,
    LANE_PDF,
    LANE_SPREAD,
    LANE_WIDTH,
    THREAD_LEVEL,
    WEAVE_LEVEL,
    Wave,
)
from fabricusd.reference.stages import arrivals
from fabricusd.reference.stages.arrivals import AUTO_LEVEL, QUEUES, Settings, arrive
from fabricusd.reference.stages.departures import depart, record_first
from fabricusd.reference.stages.hits import add_emission, prepare
from fabricusd.reference.stages.shadow_rays import settle, share_that_goes_on, thin_out
from fabricusd.reference.start.compile_ahead import (
    EVERY_PICTURE,
    close_ups_of,
    compile_ahead,
    of_law,
)
from fabricusd.reference.surfaces.fabric import FabricShader
from fabricusd.reference.surfaces.fabric_gap import BY_DIRECTION, TABLE
from fabricusd.reference.surfaces.normal_map import shade_mapped
from fabricusd.reference.surfaces.preview import (
    EMISSIVE,
    EMISSIVE_MAP,
    NORMAL_MAP,
    OPACITY,
    OPACITY_MAP,
    build_surfaces,
    shade_preview,
)
from fabricusd.reference.surfaces.thin import is_thin, shade_thin, shade_thin_mapped
from fabricusd.scene.copies import with_copies
from fabricusd.scene.scene import FabricSurface, Material, Scene

LEVELS = {
    "far": FAR_LEVEL, "weave": WEAVE_LEVEL, "thread": THREAD_LEVEL, "auto": AUTO_LEVEL,
}  # fmt: skip
ESTIMATORS = {
    "mis": arrivals.MIS,
    "light": arrivals.LIGHT_ONLY,
    "surface": arrivals.SURFACE_ONLY,
    "uniform": arrivals.UNIFORM,
}
AIMED = 16
"""Number of rays along each side of the picture that find the places to be lit."""
_PLAIN = {
    (False, False): shade_preview, (False, True): shade_mapped,
    (True, False): shade_thin, (True, True): shade_thin_mapped,
}  # fmt: skip
"""The shader of a plain surface: (lets scattered light through, has a normal map)."""
MOST_LAYERS = 32
"""Number of see-through surfaces that a ray may pass before it counts as blocked."""
MOST_TRANSLUCENT = 64
"""Bounces at translucent cloth that a path may have by default. Russian roulette ends nearly all
paths before: light that cloth of albedo .9 scattered 64 times is a thousandth of what it was."""


def _shaders(scene: Scene, shadow: str, level: str) -> list[FabricShader | None]:
    """The shaders of all materials, made once the kernels that they need are ready."""
    cloths = [one.binding.fabric for one in scene.materials if isinstance(one, FabricSurface)]
    waiting = [compile_ahead(of) for of in dict.fromkeys(map(of_law, cloths)) if of is not None]
    if level in ("weave", "thread"):
        for cloth in cloths:
            close_ups_of(cloth)
    for one in (compile_ahead(EVERY_PICTURE), *waiting):
        one.wait()
    return [_shader(surface, shadow) for surface in scene.materials] or [None]


def _shader(surface: Material, shadow: str) -> FabricShader | None:
    """The shader of a cloth; None for a plain surface, which needs no shader of its own."""
    if not isinstance(surface, FabricSurface):
        return None
    fabric = surface.binding.fabric

    def make_ready() -> None:
        for kernels in close_ups_of(fabric):
            kernels.wait()

    return FabricShader(fabric, shadow, make_ready)


class Tracer:
    """A scene prepared for path tracing.

    max_bounces : most bounces of a path at all surfaces but translucent cloth
    max_translucent : most bounces of a path at translucent cloth; None for MOST_TRANSLUCENT, or for
        0 if `max_bounces` is 0
    limits : where level "auto" changes from one level to the next
    estimator : "mis", or for tests "light", "surface" or "uniform"; all have the same mean
    sampler : "sobol", or for tests "random"

    Raises `FabricError` for an unknown level and for a negative bound on bounces.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        max_bounces: int = 4,
        max_translucent: int | None = None,
        level: str = "auto",
        shadow: str = "horizon",
        limits: Limits = DEFAULT,
        seed: int = 0,
        estimator: str = "mis",
        sampler: str = "sobol",
    ) -> None:
        if level not in LEVELS:
            raise FabricError("level", f"is '{level}'; it must be one of {', '.join(LEVELS)}")
        if max_translucent is None:
            max_translucent = MOST_TRANSLUCENT if max_bounces else 0
        for noun, bound in (("bounces", max_bounces), ("translucent", max_translucent)):
            if bound < 0:
                raise FabricError(f"max {noun}", f"is {bound}; it must be at least 0")
        # Load the kernels and build the cloths' laws on a worker thread while the triangles are
        # built. Build the triangles on the main thread: temporary memory that is freed on a worker
        # thread's heap is not returned to the system.
        beside = ThreadPoolExecutor(1)
        # Some laws need a table of shadows, a long step: whoever watches this thread watches it.
        shaders = beside.submit(copy_context().run, _shaders, scene, shadow, level)
        beside.shutdown(wait=False)
        self.tables = build_tables(scene if has_instances() else with_copies(scene))
        self.accelerator = Accelerator(
            self.tables.points, self.tables.triangles, self.tables.groups, self.tables.placements
        )
        self.shaders = shaders.result()
        self._call = Calls()
        for cloth in filter(None, self.shaders):
            cloth.home = self.tables.home
        self.carrier = Carrier(self.tables, self.accelerator.begins)
        self.lights = build_lights(scene.lights, self.tables.centre)
        self.surfaces = build_surfaces(scene)
        shining = self.surfaces.table[:, [EMISSIVE, EMISSIVE + 1, EMISSIVE + 2]].any(axis=1)
        self.shines = bool((shining | (self.surfaces.table[:, EMISSIVE_MAP] >= 0)).any())
        self.mapped = self.surfaces.table[:, NORMAL_MAP] >= 0
        self.thin = is_thin(self.surfaces.table)
        self.translucent = np.array(
            [thin if s is None else s.translucent
             for s, thin in zip(self.shaders, self.thin, strict=True)], np.uint8
        )  # fmt: skip
        through = max_translucent if self.translucent.any() else 0
        self.max_bounces, self.max_translucent = max_bounces, max_translucent
        self.steps = max_bounces + through + 2 + MOST_LAYERS
        self.settings = Settings(ESTIMATORS[estimator], LEVELS[level], max_bounces, through)
        self.numbers = new_numbers(seed, independent=sampler == "random")
        self.epsilon = np.float32(1e-7 * self.tables.radius + 1e-12)
        self._limits = np.zeros((len(self.shaders), 4), np.float32)
        self.opacity = np.where(
            self.surfaces.table[:, OPACITY_MAP] >= 0, -1.0, self.surfaces.table[:, OPACITY]
        ).astype(np.float32)
        directed = any(shader is not None and shader.gaps is not None for shader in self.shaders)
        self.gaps = np.zeros((len(self.shaders) if directed else 0, *TABLE), np.float32)
        for k, shader in enumerate(self.shaders):
            if shader is not None:
                self._limits[k] = limits.row(shader.fabric)
                self.opacity[k] = 1.0 - shader.gap
                if shader.gaps is not None:
                    self.opacity[k], self.gaps[k] = BY_DIRECTION, shader.gaps
        passing = np.where(self.opacity < 0, np.float32(1), 1 - self.opacity)
        for number in np.flatnonzero(self.opacity == BY_DIRECTION):
            passing[number] = self.gaps[number].max()
        self.blocked_go_on = share_that_goes_on(passing.max(initial=0.0))

    def aim(self, lens: Lens, width: int, height: int) -> None:
        """Set the chance of choosing each light by how brightly it lights what the camera sees."""
        if len(self.lights.table) < 2:
            return
        x, y = (np.arange(AIMED) * size // AIMED for size in (width, height))
        pixels = (y[:, None] * width + x).ravel().astype(np.int32)
        wave = Wave(len(pixels), aovs=False)
        rays = wave.lanes.rays
        camera_rays(
            lens, width, pixels, 0, 1, self.numbers, rays.reshape(len(rays), -1),
            wave.lanes.rows[LANE_WIDTH : LANE_SPREAD + 1], wave.paths,
        )  # fmt: skip
        self.accelerator.intersect(rays, len(rays))
        rows = rays.transpose(1, 0, 2).reshape(ROWS, -1)
        ends = rows[OX : OZ + 1] + rows[DX : DZ + 1] * rows[TFAR]
        met = rows.view(np.uint32)[GEOMETRY] != MISS
        share_out(self.lights, ends[:, met].T)

    def trace(
        self,
        wave: Wave,
        lens: Lens,
        width: int,
        pixels: NDArray[np.int32],
        first: int,
        samples: int,
        counters: NDArray[np.int64],
        lost: NDArray[np.float64],
    ) -> None:
        """Trace `samples` paths of each pixel to their end and write the results to `wave.film`.

        first : number of the first sample
        counters : (3,) int64 - numbers of rays, shadow rays and non-finite values, added to
        lost : (1,) float64 - throughput of the paths that were cut off, added to
        """
        count = len(pixels) * samples
        aovs = len(wave.film) > BEAUTY_ROWS
        wave.film[:, :count] = 0.0
        rays, rows, tags = wave.lanes
        camera_rays(
            lens, width, pixels, first, samples, self.numbers, rays.reshape(len(rays), -1),
            rows[LANE_WIDTH : LANE_SPREAD + 1], wave.paths,
        )  # fmt: skip
        rows[LANE_BETA : LANE_BETA + 3, :count] = 1.0
        rows[LANE_PDF, :count] = -1.0
        tags[0, :count] = np.arange(count)
        tags[1:, :count] = 0
        ends = np.zeros(QUEUES * len(self.shaders), np.int64)
        result = np.zeros(3, np.int64)
        triangles, uv = self.carrier.triangles(wave)
        call = self._call
        for step in range(self.steps):
            self.accelerator.intersect(wave.lanes.rays, (count + 15) // 16, coherent=step == 0)
            self.carrier.carry(wave, wave.lanes.rays, count)
            counters[0] += count
            call(
                arrive, step, self.settings, count, wave.lanes, wave.paths, self.numbers,
                self.lights, triangles, self._limits, wave.film, wave.queues, ends, lost,
            )  # fmt: skip
            hits = int(ends[-1])
            if hits == 0:
                break
            call(
                prepare, step, self.settings, ends, wave.lanes, wave.queues, wave.paths,
                self.numbers, triangles, self.lights, self.epsilon, wave.hits,
            )  # fmt: skip
            if self.shines:
                call(add_emission, hits, self.surfaces, wave.hits, wave.film)
            start = 0
            for queue, end in enumerate(ends.tolist()):
                if end > start:
                    self._shade(wave, queue, start, end)
                start = end
            if aovs and step <= MOST_LAYERS:
                record_first(hits, lens.eye, lens.axis, wave.hits, uv, wave.film)
            call(
                depart, step, self.settings, hits, self.translucent, wave.hits, wave.film,
                wave.shadows, wave.next_lanes, result,
            )  # fmt: skip
            counters[1] += result[0]
            counters[2] += result[2]
            self._settle(wave, int(result[0]), aovs)
            wave.swap()
            count = int(result[1])
            if count == 0:
                break
        else:
            lost[0] += wave.lanes.rows[LANE_BETA : LANE_BETA + 3, :count].mean(axis=0).sum()

    def _shade(self, wave: Wave, queue: int, start: int, end: int) -> None:
        """Shade the hits from `start` to before `end`, all of one queue, by their material."""
        shader = self.shaders[queue // QUEUES]
        if shader is None:
            shade = _PLAIN[bool(self.thin[queue // QUEUES]), bool(self.mapped[queue // QUEUES])]
            self._call(shade, self.surfaces, wave.hits.rows, wave.hits.tags, start, end)
        else:
            shader(queue // 2 % 3, queue % 2, wave, start, end)

    def _settle(self, wave: Wave, count: int, aovs: bool) -> None:
        """Trace the shadow rays and add the light that they bring."""
        if count == 0:
            return
        # Most rays meet nothing. To ask only that takes a quarter of the time of finding what a ray
        # meets, which matters for the others alone.
        self.accelerator.occluded(wave.shadows.rays, (count + 15) // 16)
        count = self._call(settle, count, wave.shadows, wave.film, aovs, self.blocked_go_on)
        triangles, _ = self.carrier.triangles(wave)
        for _ in range(MOST_LAYERS):
            if count == 0:
                break
            self.accelerator.intersect(wave.shadows.rays, (count + 15) // 16)
            self.carrier.carry(wave, wave.shadows.rays, count)
            count = self._call(
                thin_out, count, wave.shadows, self.opacity, self.gaps, self.surfaces, triangles,
                self.epsilon, aovs, wave.film,
            )  # fmt: skip
