"""What a picture calls, kernel by kernel, on next to nothing: for `compile_ahead`.

A task is one kernel or a few that have parts in common. A test compares with what pictures call.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from fabricusd.appearance.published.levels import point_values
from fabricusd.appearance.published.shares import published_mixture
from fabricusd.appearance.published.tables import SurfaceTables, surface_tables
from fabricusd.appearance.sampling.blocks import Drawn, sample_points
from fabricusd.appearance.sampling.fit import no_mixture
from fabricusd.appearance.shadow.methods import Shadow, compile_shadow
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.place import Places
from fabricusd.fabric import Fabric
from fabricusd.reference.defaults import default_lights
from fabricusd.reference.film import Film
from fabricusd.reference.lights.table import build_lights
from fabricusd.reference.rays.camera import build_lens, camera_rays
from fabricusd.reference.rays.embree import Accelerator
from fabricusd.reference.rays.sobol import new_numbers
from fabricusd.reference.rays.triangles import build_tables
from fabricusd.reference.rays.wave import CHANCE, F_PDF, GO_PDF, LANE_SPREAD, LANE_WIDTH, Wave
from fabricusd.reference.stages.arrivals import arrive, sort_lanes
from fabricusd.reference.stages.departures import depart
from fabricusd.reference.stages.hits import prepare
from fabricusd.reference.stages.shadow_rays import settle, thin_out
from fabricusd.reference.surfaces.fabric import finish_point, look_up
from fabricusd.reference.surfaces.fabric_far import shade_far
from fabricusd.reference.surfaces.preview import build_surfaces, shade_preview
from fabricusd.scene.scene import Camera, Mesh, PreviewSurface, Scene

R = np.float32


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
    shade_far(R, _cloth()[1], no_mixture(R), R(0), _sample().wave.hits, 0, 0)


def _share_lobes() -> None:
    published_mixture(*_cloth())


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


def _scratch() -> tuple[Any, ...]:
    """Of a hit in finer detail: side by side as the laws want them, none."""
    real = np.zeros(0, np.float32)
    return np.zeros(0, np.uint8), np.zeros(0, np.int32), real, real, real, real


def _places() -> Places:
    sets, threads, _, across, psi0, _ = _scratch()
    return Places(sets, threads, psi0, across)


@cache
def _woven() -> tuple[CompiledFabric, Shadow]:
    fabric = Fabric()
    return compile_fabric(fabric, precision=np.float32), compile_shadow(fabric, "none")


def _shadow_table() -> None:
    compile_shadow(Fabric(), "horizon", azimuths=16, texels=(2, 2))


def _look_up() -> None:
    look_up(R, _woven()[0], R(1), _sample().wave.hits, 0, *_scratch())


def _sample_points() -> None:
    hits, vectors = _sample().wave.hits, np.zeros((3, 0), np.float32)
    sample_points(
        R, _cloth()[1].threads, no_mixture(R), False, _places(), vectors, vectors,
        tuple(hits[CHANCE : CHANCE + 3]), Drawn(vectors, hits[F_PDF], hits[GO_PDF]), 0, 0,
    )  # fmt: skip


def _point_values() -> None:
    vectors = np.zeros((3, 0), np.float32)
    point_values(R, _cloth()[1], False, _places(), vectors, vectors, vectors, 0, 0)


def _finish_point() -> None:
    vectors = [np.zeros((3, 0), np.float32)] * 4
    finish_point(R, *_woven(), R(1), R(0), 1, _sample().wave.hits, 0, *vectors, *_scratch())


FAR, NEAR = "far", "near"
TASKS: dict[str, tuple[Callable[[], None], ...]] = {
    FAR: (
        _shade_far, _share_lobes, _shade_preview, _depart, _trace_and_settle, _camera_rays,
        _arrive, _prepare,
    ),
    NEAR: (_finish_point, _look_up, _sample_points, _point_values, _shadow_table),
}  # fmt: skip
"""Those that take longest at both ends, beside those with which they have parts in common. Level
`far` is what every picture needs, `near` what levels `weave` and `thread` need besides."""

LONGEST = {FAR: shade_far, NEAR: finish_point}
"""A kernel of each list that takes long: where numba has it on disk, it has the others."""
