"""Kernels made ready while a scene is read: loaded by a thread, or compiled by other processes.

numba keeps on disk what it compiled. A thread calls every kernel of one list once, on next to
nothing, so that numba loads them while the scene is read and its triangles are prepared.

On a machine's first picture there is nothing to load. numba compiles one function at a time in a
process, so processes of their own go through the list, from one end or the other, each taking
the next that none has, and whoever wanted to render waits and finds them on disk. They compile
without Python's collector of cycles, which costs a fifth of the time, and end with the memory that
this takes. Whatever they fail to make is compiled by the caller.
"""

from __future__ import annotations

import atexit
import gc
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba.core.dispatcher import Dispatcher

from fabricusd.appearance.numba_start import load_as_they_are, load_without_blas
from fabricusd.appearance.surface_sampling import SamplingTables
from fabricusd.appearance.surface_shares import sampling_tables
from fabricusd.appearance.surface_tables import SurfaceTables, surface_tables
from fabricusd.fabric import Fabric
from fabricusd.reference.arrivals import arrive, sort_lanes
from fabricusd.reference.camera import build_lens, camera_rays
from fabricusd.reference.defaults import default_lights
from fabricusd.reference.departures import depart
from fabricusd.reference.embree import Accelerator
from fabricusd.reference.far_shading import shade_far
from fabricusd.reference.film import Film
from fabricusd.reference.hits import prepare
from fabricusd.reference.lights import build_lights
from fabricusd.reference.preview_surface import build_surfaces, shade_preview
from fabricusd.reference.scene import Camera, Mesh, PreviewSurface, Scene
from fabricusd.reference.shadow_rays import settle, thin_out
from fabricusd.reference.sobol import new_numbers
from fabricusd.reference.triangles import build_tables
from fabricusd.reference.wave import LANE_SPREAD, LANE_WIDTH, Wave
from fabricusd.reference.workers import worker_count

R = np.float32
_LONGEST = 120.0
"""Seconds after which the other processes are no longer waited for."""
_MOST_PROCESSES = 4
"""More would wait for the longest kernel."""


class CompileAhead:
    """The thread, or where the cloth's kernel has not been compiled the processes."""

    def __init__(self) -> None:
        self._processes: list[subprocess.Popen[bytes]] = []
        self._thread: threading.Thread | None = None
        if _compiled():
            # No daemon: Python must not take LLVM apart while it loads code.
            self._thread = threading.Thread(target=_load_kernels, args=(_kernels(),))
            self._thread.start()
            return
        load_without_blas()
        # Inside another program `executable` is that program, which must not be started again.
        if not Path(sys.executable or "").name.startswith("python"):
            return
        atexit.register(self._stop)
        self._claims = tempfile.TemporaryDirectory(prefix="fabricusd-")
        none = subprocess.DEVNULL
        for k in range(min(worker_count(None), _MOST_PROCESSES)):
            call = f"compile_kernels({self._claims.name!r}, {k % 2 == 1})"
            code = f"import {__name__} as ahead; ahead.{call}"
            process = subprocess.Popen(
                [sys.executable, "-c", code], stdin=none, stdout=none, stderr=none
            )
            self._processes.append(process)

    def wait(self) -> None:
        """Return when the kernels are ready, or will not be."""
        if self._thread is not None:
            self._thread.join()
        while self._processes:
            process = self._processes.pop()
            try:
                process.wait(_LONGEST)
            except subprocess.TimeoutExpired:
                process.kill()
            if not self._processes:
                self._claims.cleanup()

    def _stop(self) -> None:
        for process in self._processes:
            process.kill()


@cache
def compile_ahead() -> CompileAhead:
    """Start the thread or the processes, once; for `wait` before the first kernel is called."""
    return CompileAhead()


def _compiled() -> bool:
    """Whether numba has the cloth's kernel on disk."""
    return any(Path(shade_far.stats.cache_path).glob("far_shading.shade_far*.nbi"))


def _load_kernels(kernels: list[Dispatcher]) -> None:
    """Call every kernel; one that cannot be loaded complains where it is needed."""
    load_as_they_are(kernels)
    for task in TASKS:
        with suppress(Exception):
            task()


def _kernels() -> list[Dispatcher]:
    """Those of the appearance model and of the tracer, as far as they have been imported."""
    return [
        value
        for name, module in sys.modules.copy().items()
        if name.startswith("fabricusd.")
        for value in vars(module).copy().values()
        if isinstance(value, Dispatcher)
    ]


def compile_kernels(claims: str, backwards: bool) -> None:
    """Compile every kernel that is not claimed yet by a file of its name in folder `claims`."""
    # Most of what a compiler makes lives until the end.
    gc.disable()
    load_without_blas()
    for task in TASKS[::-1] if backwards else TASKS:
        try:
            os.close(os.open(os.path.join(claims, task.__name__), os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            continue
        task()


class _Sample(NamedTuple):
    """A triangle, lit as a scene without lights is, and buffers: what kernels take their types
    from."""

    scene: Scene
    wave: Wave
    tables: Any
    lights: Any
    dome: Any


@cache
def _sample() -> _Sample:
    points, material = np.eye(3), np.zeros(1, np.int32)
    mesh = Mesh(path="", points=points, triangles=np.array([[0, 1, 2]]), material=material)
    scene = Scene(meshes=[mesh], materials=[PreviewSurface()])
    tables = build_tables(scene)
    wave = Wave(16, aovs=False)
    wave.hits[:], wave.tags[:], wave.film[:] = 0, 0, 0
    return _Sample(scene, wave, tables, *build_lights(default_lights(scene), tables.centre))


def _cloth() -> tuple[Any, SurfaceTables]:
    # Level threads: next to nothing to sample.
    fabric = Fabric()
    return fabric, surface_tables(fabric, precision=np.float32)


def _prepare() -> None:
    _, wave, tables, lights, dome = _sample()
    prepare(
        0, 0, np.zeros(6, np.int64), wave.rays, wave.lanes, wave.lane_tags, wave.keys, wave.order,
        tables.records, lights, dome, R(0), wave.path_pixel, wave.path_sample, new_numbers(0),
        wave.hits, wave.tags,
    )  # fmt: skip


def _shade_far() -> None:
    lobes = SamplingTables(*(np.zeros(shape, np.float32) for shape in ((0, 8), *2 * [(1, 1, 0)])))
    shade_far(R, _cloth()[1], lobes, R(0), _sample().wave.hits, 0, 0)


def _share_lobes() -> None:
    sampling_tables(*_cloth())


def _arrive() -> None:
    _, wave, tables, lights, dome = _sample()
    counts, limits = np.zeros(6, np.int64), np.zeros((1, 4), np.float32)
    arrive(
        0, 0, 0, 0, wave.rays, wave.lanes, wave.lane_tags, lights, dome, wave.film, wave.keys,
        tables.material, limits, tables.records, 0, wave.path_pixel, wave.path_sample,
        new_numbers(0), counts,
    )  # fmt: skip
    sort_lanes(0, wave.keys, np.cumsum(counts) - counts, wave.order)


def _shade_preview() -> None:
    scene, wave, *_ = _sample()
    shade_preview(build_surfaces(scene), wave.hits, wave.tags, 0, 0)


def _camera_rays() -> None:
    _, wave, tables, *_ = _sample()
    camera_rays(
        build_lens(Camera(), 1, 1, tables.centre, "tent"), 1, np.zeros(0, np.int32), 0, 1,
        new_numbers(0), wave.rays.reshape(len(wave.rays), -1),
        wave.lanes[LANE_WIDTH : LANE_SPREAD + 1], wave.path_pixel, wave.path_sample,
    )  # fmt: skip


def _depart() -> None:
    wave = _sample().wave
    depart(
        0, 0, 0, 1, wave.hits, wave.tags, wave.film, wave.shadow_rays, wave.shadow,
        wave.shadow_path, wave.next_rays, wave.next_lanes, wave.next_tags, np.zeros(3, np.int64),
    )  # fmt: skip


def _trace_and_settle() -> None:
    scene, wave, tables, *_ = _sample()
    rays = Accelerator(scene.meshes[0].points, scene.meshes[0].triangles)
    rays.intersect(wave.rays, 0)
    rays.occluded(wave.rays, 0)
    shadows = (wave.shadow_rays, wave.shadow, wave.shadow_path)
    settle(0, *shadows, wave.film, False)
    thin_out(
        0, *shadows, np.ones(1, np.float32), build_surfaces(scene), tables.material,
        tables.records, R(0), False, wave.film,
    )  # fmt: skip
    Film(4, 4, ("beauty",)).add(np.zeros(1, np.int32), 16, wave.film)


TASKS: tuple[Callable[[], None], ...] = (
    _shade_far, _share_lobes, _shade_preview, _depart, _trace_and_settle, _camera_rays, _arrive,
    _prepare,
)  # fmt: skip
"""Those that take longest at both ends, beside those with which they have parts in common."""
