"""The kernels that a picture calls, as tasks that `compile_ahead` runs with minimal arguments.

A task calls one kernel, or a few kernels that share parts. A test compares the tasks with the
kernels that pictures call.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from fabricusd.appearance.laws import law_of
from fabricusd.appearance.published.levels import point_values
from fabricusd.appearance.published.shares import published_mixture
from fabricusd.appearance.published.tables import SurfaceTables, surface_tables
from fabricusd.appearance.sampling.blocks import Drawn, sample_points
from fabricusd.appearance.sampling.fit import no_mixture
from fabricusd.appearance.scattering.models import any_conserving
from fabricusd.appearance.shadow.kinds import Shadow
from fabricusd.appearance.shadow.mean import GROUPS, fill_means
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.place import Places
from fabricusd.appearance.weave.yarn.compiled import compile_yarn
from fabricusd.fabric import Fabric
from fabricusd.reference.defaults import default_lights
from fabricusd.reference.film import Film
from fabricusd.reference.lights.table import Lights, build_lights
from fabricusd.reference.rays.camera import Lens, build_lens, camera_rays
from fabricusd.reference.rays.embree import Accelerator
from fabricusd.reference.rays.sobol import new_numbers
from fabricusd.reference.rays.triangles import Triangles, build_tables
from fabricusd.reference.rays.wave import (
    CHANCE,
    F_PDF,
    GO_PDF,
    LANE_SPREAD,
    LANE_WIDTH,
    PRIMITIVE,
    Wave,
)
from fabricusd.reference.stages.arrivals import Settings, arrive
from fabricusd.reference.stages.departures import depart
from fabricusd.reference.stages.hits import prepare
from fabricusd.reference.stages.shadow_rays import settle, thin_out
from fabricusd.reference.surfaces.fabric import NOWHERE_ELSE, Scattering, finish_point
from fabricusd.reference.surfaces.fabric_far import gather, shade_far
from fabricusd.reference.surfaces.fabric_gap import TABLE, pass_gaps, pass_published
from fabricusd.reference.surfaces.fabric_near import (
    Lit,
    Points,
    look_up,
    look_up_uneven,
    places_of,
    shadows_by_horizon,
)
from fabricusd.reference.surfaces.preview import build_surfaces, shade_preview
from fabricusd.scene.scene import Camera, Mesh, PreviewSurface, Scene

R = np.float32
_SETTINGS = Settings(estimator=0, level=0, max_depth=1, max_through=0)


class _Sample(NamedTuple):
    """One triangle under the default lights, and buffers: arguments of the kernels' types."""

    scene: Scene
    wave: Wave
    triangles: Triangles
    lights: Lights
    lens: Lens


@cache
def _sample() -> _Sample:
    points, material = np.eye(3), np.zeros(1, np.int32)
    mesh = Mesh(path="", points=points, triangles=np.array([[0, 1, 2]]), material=material)
    scene = Scene(meshes=[mesh], materials=[PreviewSurface()])
    tables = build_tables(scene)
    wave = Wave(16, aovs=False)
    for rows in (*wave.hits, wave.film):
        rows[:] = 0
    return _Sample(
        scene, wave, Triangles(tables.records, tables.material),
        build_lights(default_lights(scene), tables.centre),
        build_lens(Camera(), 1, 1, tables.centre, "tent"),
    )  # fmt: skip


@cache
def _cloth(law: str = Fabric().surface_law) -> tuple[Any, SurfaceTables]:
    # The default fabric's threads are level, so its lobes are made quickly.
    fabric = Fabric(surface_law=law)
    shadow = compile_shadow(fabric, "none") if law_of(fabric).absolute else None
    return fabric, surface_tables(fabric, precision=np.float32, shadow=shadow)


def _prepare() -> None:
    _, wave, triangles, lights, _ = _sample()
    prepare(
        0, _SETTINGS, np.zeros(6, np.int64), wave.lanes, wave.queues, wave.paths, new_numbers(0),
        triangles, lights, R(0), wave.hits,
    )  # fmt: skip


def _shade_far() -> None:
    shade_far(R, _cloth()[1], no_mixture(R), R(0), _sample().wave.hits.rows, 0, 0)


def _share_lobes() -> None:
    published_mixture(*_cloth())


def _shade_far_absolute(law: str) -> None:
    tables = _cloth(law)[1]
    shade_far(R, tables, no_mixture(R), R(0), _sample().wave.hits.rows, 0, 0)
    pass_published(R, tables, R(1), np.zeros((3, 0), np.float32), np.zeros(0, np.float32))


def _shade_far_projected() -> None:
    _shade_far_absolute("projected")


def _share_lobes_projected() -> None:
    published_mixture(*_cloth("projected"))


def _shade_far_visible() -> None:
    _shade_far_absolute("visible")


def _share_lobes_visible() -> None:
    published_mixture(*_cloth("visible"))


def _arrive() -> None:
    _, wave, triangles, lights, _ = _sample()
    ends, limits = np.zeros(6, np.int64), np.zeros((1, 4), np.float32)
    arrive(
        0, _SETTINGS, 0, wave.lanes, wave.paths, new_numbers(0), lights, triangles, limits,
        wave.film, wave.queues, ends, np.zeros(1),
    )  # fmt: skip


def _shade_preview() -> None:
    scene, wave, *_ = _sample()
    shade_preview(build_surfaces(scene), wave.hits.rows, wave.hits.tags, 0, 0)


def _camera_rays() -> None:
    _, wave, _, _, lens = _sample()
    rays, rows, _ = wave.lanes
    camera_rays(
        lens, 1, np.zeros(0, np.int32), 0, 1, new_numbers(0), rays.reshape(len(rays), -1),
        rows[LANE_WIDTH : LANE_SPREAD + 1], wave.paths,
    )  # fmt: skip


def _depart() -> None:
    wave = _sample().wave
    depart(
        0, _SETTINGS, 0, np.zeros(1, np.uint8), wave.hits, wave.film, wave.shadows,
        wave.next_lanes, np.zeros(3, np.int64),
    )  # fmt: skip


def _trace_and_settle() -> None:
    scene, wave, triangles, *_ = _sample()
    rays = Accelerator(scene.meshes[0].points, scene.meshes[0].triangles)
    rays.intersect(wave.lanes.rays, 0)
    rays.occluded(wave.lanes.rays, 0)
    settle(0, wave.shadows, wave.film, False, R(0))
    thin_out(
        0, wave.shadows, np.ones(1, np.float32), np.zeros((0, *TABLE), np.float32),
        build_surfaces(scene), triangles, R(0), False, wave.film,
    )  # fmt: skip
    Film(4, 4, ("beauty",)).add(np.zeros(1, np.int32), 16, wave.film)


def _points() -> Points:
    """The arrays of hits at levels `weave` and `thread`, each of length 0."""
    real = np.zeros(0, np.float32)
    return Points(np.zeros(0, np.uint8), np.zeros(0, np.int32), *[real] * 6)


def _places() -> Places:
    return places_of(_points())


@cache
def _woven() -> tuple[CompiledFabric, Shadow]:
    fabric = Fabric()
    return compile_fabric(fabric, precision=np.float32), compile_shadow(fabric, "none")


def _shadow_table() -> None:
    compile_shadow(Fabric(), "horizon", azimuths=16, texels=2)


def _mean_table() -> None:
    fill_means(np.float64, np.zeros((2, GROUPS)), 1.0, np.zeros((2, 2)))


def _look_up() -> None:
    look_up(R, *_woven(), R(1), _sample().wave.hits.rows, 0, _points())


def _look_up_uneven() -> None:
    wave = _sample().wave
    look_up_uneven(
        R, *_woven(), compile_yarn(Fabric()), NOWHERE_ELSE, R(1), wave.hits.tags[PRIMITIVE],
        wave.hits.rows, 0, _points(),
    )  # fmt: skip


def _sample_points() -> None:
    hits, vectors = _sample().wave.hits.rows, np.zeros((3, 0), np.float32)
    sample_points(
        R, _cloth()[1].threads, no_mixture(R), False, _places(), vectors, vectors,
        tuple(hits[CHANCE : CHANCE + 3]), Drawn(vectors, hits[F_PDF], hits[GO_PDF]), 0, 0,
    )  # fmt: skip


def _near(tables: SurfaceTables) -> None:
    vectors = np.zeros((3, 0), np.float32)
    point_values(R, tables, False, _places(), vectors, vectors, vectors, 0, 0)
    pass_gaps(R, tables, R(0), _points().sets, vectors, np.zeros(0, np.float32))


def _near_masked() -> None:
    _near(_cloth()[1])


def _near_projected() -> None:
    _near(_cloth("projected")[1])


def _near_visible() -> None:
    _near(_cloth("visible")[1])


def _lit() -> Lit:
    return Lit(*[np.zeros(0, np.float32)] * 2)


def _finish_point() -> None:
    scattering = Scattering(*[np.zeros((3, 0), np.float32)] * 5)
    gather(_sample().wave.hits.rows, 0, 0, scattering.wo, scattering.wi)
    finish_point(
        R, True, 1, _sample().wave.hits.rows, 0, scattering, _points(), np.zeros(0, np.float32),
        _lit(),
    )  # fmt: skip


def _shadows() -> None:
    vectors = np.zeros((3, 0), np.float32)
    shadows_by_horizon(
        R, *_woven(), R(1), _sample().wave.hits.rows, 0, (vectors, vectors), _points(), _lit()
    )


EVERY_PICTURE, CLOSE_UPS = "every picture", "close-ups"
MASKED, PROJECTED, VISIBLE = "cloth that masks", "projected cloth", "cloth of visible places"
NEAR_MASKED, NEAR_PROJECTED, NEAR_VISIBLE = (
    f"close-ups of {cloth}" for cloth in (MASKED, PROJECTED, VISIBLE)
)
TASKS: dict[str, tuple[Callable[[], None], ...]] = {
    EVERY_PICTURE: (
        _trace_and_settle, _shade_preview, _depart, _camera_rays, _arrive, _prepare,
    ),
    MASKED: (_shade_far, _share_lobes),
    PROJECTED: (_shadow_table, _mean_table, _share_lobes_projected, _shade_far_projected),
    VISIBLE: (_shadow_table, _mean_table, _share_lobes_visible, _shade_far_visible),
    CLOSE_UPS: (
        _sample_points, _look_up_uneven, _shadows, _finish_point, _look_up, _shadow_table,
    ),
    NEAR_MASKED: (_near_masked,),
    NEAR_PROJECTED: (_near_projected,),
    NEAR_VISIBLE: (_near_visible,),
}  # fmt: skip
"""The tasks of each list. Tasks that take longest stand at both ends, next to those with which they
share parts. Every picture needs the first list, levels `weave` and `thread` also CLOSE_UPS, and
cloth that of its law, `of_law`, and at those levels `near_of_law`. Cloth of other laws compiles its
own kernels. A name stands for one task, whatever lists it is in.
"""


def of_law(fabric: Fabric) -> str | None:
    """The list that `fabric` needs at level `far`; None where there is none for its law."""
    if any_conserving(fabric):
        return None
    return {"masked": MASKED, "projected": PROJECTED, "visible": VISIBLE}.get(fabric.surface_law)


def near_of_law(fabric: Fabric) -> str | None:
    """As `of_law`, for levels `weave` and `thread`."""
    near = {MASKED: NEAR_MASKED, PROJECTED: NEAR_PROJECTED, VISIBLE: NEAR_VISIBLE}
    return near.get(of_law(fabric) or "")


LONGEST = {
    EVERY_PICTURE: prepare, CLOSE_UPS: sample_points, MASKED: shade_far, PROJECTED: pass_published,
    VISIBLE: pass_published, NEAR_MASKED: point_values, NEAR_PROJECTED: point_values,
    NEAR_VISIBLE: point_values,
}  # fmt: skip
"""A kernel of each list that takes long to compile, or comes last: if it is cached, so are the
others. (Of the laws' own, if that of another law is: the first picture of a second law then waits
for its kernels.)"""
