"""Tubes with fibres: straight ones, which stand off the threads, as the truth of `appearance.fuzz`.

A fibre begins on top of a thread, at a place that is chosen evenly over the cloth, and points
anywhere above it, unless a thread is in its way. It scatters as its thread does, and casts a shadow
on threads and on other fibres. Fibres are prisms; everything about tubes is as in `paths`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance.fuzz import FIBRE, ON_A_FACE
from fabricusd.appearance.scattering.columns import ALBEDO_B, ALBEDO_G, ALBEDO_R
from fabricusd.appearance.scattering.terms import terms
from fabricusd.appearance.weave.coverage import sets
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.geometry.cloth import Cloth, tubes
from fabricusd.geometry.mesh import SIDES
from fabricusd.geometry.paths import (
    USUAL,
    Paths,
    Reflectance,
    Tracer,
    bounces_of,
    directions,
    mean_of,
)
from fabricusd.geometry.rays import NOTHING, Hits, blocked, from_outside, nearest
from fabricusd.kernels.real import KERNEL
from fabricusd.reference.rays.embree import Accelerator

Floats = NDArray[np.float64]

CORNERS = 6
"""Faces of a fibre. The perimeter of its section is that of a circle of its diameter, so that it is
as wide as a round one on average."""

OUTSIDE = 1.05
"""How far from its axis light leaves a fibre, over the prism's corners."""

LENGTH = 0.6e-3
"""Length of a fibre [m]. The layer is thin: what it does depends on the length of all of them."""


class Field(NamedTuple):
    """axis : (f, 3) float - direction of each fibre; root : (f, 3) float [m]; kind : (f,) int32 -
    its thread's type; first : int - number of the first triangle, of 2 CORNERS a fibre."""

    axis: Floats
    root: Floats
    kind: NDArray[np.int32]
    first: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Hairy:
    """cloth : Cloth - tubes and fibres in one accelerator; field : Field; depth : float - optical
    depth of the fibres over the threads."""

    cloth: Cloth
    field: Field
    depth: float


def hairy_tubes(fabric: Fabric, threads: tuple[int, int], seed: int = 0) -> Hairy:
    """`fabric` as tubes with as many fibres as the hairiness of its threads asks for.

    threads : ends and picks of the patch, at least; the patch is repeated

    Raises FabricError for cloth without hairiness, or of which no tubes can be made.
    """
    cloth = tubes(fabric, threads=threads)
    rng = np.random.default_rng(seed)
    listed = fabric.thread_list
    per_area = sum(
        s.density * float(np.mean([listed[k].hairiness for k in s.sequence])) for s in sets(fabric)
    )
    count = round(ON_A_FACE * per_area * float(np.prod(cloth.patch.size)) / LENGTH)
    if count == 0:
        raise FabricError(f"fabric '{fabric.name}'", "has no fibres; a thread must be hairy")
    root, axis, kind = _planted(cloth, count, rng)
    copies, points, triangles = _prisms(cloth, root, axis)
    first = len(cloth.mesh.triangles)
    covered = len(root) / count
    mesh = np.concatenate((cloth.mesh.points, points))
    faces = np.concatenate((cloth.mesh.triangles, triangles + len(cloth.mesh.points)))
    top = max(cloth.patch.top, float(points[:, 2].max()) + 1e-6)
    number = copies[:, 0].astype(np.int64)
    field = Field(axis[number], copies[:, 1:], kind[number], first)
    return Hairy(
        cloth=replace(
            cloth, patch=cloth.patch._replace(top=top), accelerator=Accelerator(mesh, faces)
        ),
        field=field,
        depth=math.pi / 4 * FIBRE * count * LENGTH / float(np.prod(cloth.patch.size)) * covered,
    )


def reflectance(
    hairy: Hairy,
    wo: ArrayLike,
    wi: ArrayLike,
    *,
    count: int = 1 << 14,
    bounces: int | None = None,
    seed: int = 0,
) -> Reflectance:
    """As `paths.reflectance`, of tubes with fibres."""
    viewers, lights = np.broadcast_arrays(directions("wo", wo), directions("wi", wi))
    cloth = hairy.cloth
    tracer = _Tracer(hairy, bounces_of(cloth, bounces), np.random.default_rng(seed))
    return tracer.reflectance(viewers, lights, count)


def white_sky(hairy: Hairy, wo: ArrayLike, *, count: int = 1 << 14, seed: int = 0) -> Floats:
    """(n, 2, 3) what reaches viewers from a sky of radiance 1 above, and from one below; the latter
    with what meets no thread."""
    viewers = directions("wo", wo)
    tracer = _Tracer(hairy, bounces_of(hairy.cloth, None), np.random.default_rng(seed))
    ways = mean_of(tracer.by_way(viewers, None, count))[0]
    return np.stack((ways[:, 0], ways[:, 1] + ways[:, 6]), axis=1)


def _planted(
    cloth: Cloth, count: int, rng: np.random.Generator
) -> tuple[Floats, Floats, NDArray[np.int32]]:
    """Roots [m], directions and thread types of up to `count` fibres: those over gaps are left
    out, and directions in which a thread is in the way are drawn again."""
    down = np.repeat([[0.0, 0.0, -1.0]], count, axis=0)
    start = from_outside(cloth, rng.random((count, 2)), -down)
    hits = nearest(cloth, start, down)
    on = np.flatnonzero(hits.primitive != NOTHING)
    rings = cloth.mesh.rings
    line = rings.line[rings.first[hits.primitive[on] // 2 // SIDES]]
    root = start[on]
    root[:, 2] = _heights(cloth, hits.primitive[on], hits.u[on], hits.v[on]) + 0.05 * FIBRE
    axis = np.zeros_like(root)
    todo = np.arange(len(root))
    for _ in range(64):
        z = rng.random(len(todo))
        turn = 2 * math.pi * rng.random(len(todo))
        flat = np.sqrt(1.0 - z * z)
        axis[todo] = np.stack((flat * np.cos(turn), flat * np.sin(turn), z), axis=-1)
        todo = todo[blocked(cloth, root[todo], axis[todo])]
        if not len(todo):
            break
    axis[todo] = (0.0, 0.0, 1.0)
    return root, axis, cloth.lines.kind[line]


def _heights(
    cloth: Cloth, primitive: NDArray[np.int32], u: NDArray[np.float32], v: NDArray[np.float32]
) -> Floats:
    """(n,) heights [m] of places on triangles."""
    z = cloth.mesh.points[cloth.mesh.triangles[primitive], 2]
    return np.asarray(z[:, 0] * (1.0 - u - v) + z[:, 1] * u + z[:, 2] * v)


def _prisms(cloth: Cloth, root: Floats, axis: Floats) -> tuple[Floats, Floats, NDArray[np.int32]]:
    """((f, 4) number and root of each copy that the patch needs, points, triangles)."""
    shifts = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
    number = np.tile(np.arange(len(root)), len(shifts))
    at = root[number].copy()
    at[:, :2] += np.repeat(shifts, len(root), axis=0) * cloth.patch.size
    end = at + LENGTH * axis[number]
    inside = np.ones(len(at), np.bool_)
    for k in range(2):
        low, high = np.minimum(at[:, k], end[:, k]), np.maximum(at[:, k], end[:, k])
        inside &= (high > cloth.patch.low[k] - FIBRE) & (low < cloth.patch.high[k] + FIBRE)
    number, at, end = number[inside], at[inside], end[inside]
    b, n = _across(axis[number])
    radius = FIBRE * math.pi / (2 * CORNERS * math.sin(math.pi / CORNERS))
    around = 2 * math.pi * np.arange(CORNERS) / CORNERS
    ring = radius * (np.cos(around)[:, None] * b[:, None] + np.sin(around)[:, None] * n[:, None])
    points = np.stack((at[:, None] + ring, end[:, None] + ring), axis=1).reshape(-1, 3)
    here = np.arange(CORNERS)
    beside = (here + 1) % CORNERS
    one = np.concatenate(
        (
            np.stack((here, beside, beside + CORNERS), axis=-1),
            np.stack((here, beside + CORNERS, here + CORNERS), axis=-1),
        )
    )
    triangles = (one[None] + 2 * CORNERS * np.arange(len(at))[:, None, None]).reshape(-1, 3)
    return np.column_stack((number, at)), points, triangles.astype(np.int32)


def _across(axis: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors that complete right-handed frames."""
    aside = np.where(np.abs(axis[:, :1]) > 0.7, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    b = np.cross(axis, aside)
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    return b, np.cross(axis, b)


class _Tracer(Tracer):
    """Paths between tubes and fibres."""

    def __init__(self, hairy: Hairy, bounces: int, rng: np.random.Generator) -> None:
        super().__init__(hairy.cloth, USUAL, bounces, rng)
        self.field = hairy.field

    def _on_fibre(self, hits: Hits) -> NDArray[np.bool_]:
        return np.asarray(hits.primitive >= self.field.first)

    def _of_fibre(self, hits: Hits) -> NDArray[np.int64]:
        """(n,) the fibre of each hit."""
        return (hits.primitive.astype(np.int64) - self.field.first) // (2 * CORNERS)

    def _meet(self, paths: Paths) -> Hits:
        hits = super()._meet(paths)
        # Fibres have no inside: what starts there has left it.
        on = self._on_fibre(hits)
        hits.back[on] = False
        return hits

    def _light(self, paths: Paths, hits: Hits, towards: Floats, out: Floats) -> None:
        on = self._on_fibre(hits)
        super()._light(paths.only(~on), hits.only(~on), towards, out)
        paths, hits = paths.only(on), hits.only(on)
        light = towards[paths.group]
        value, origin = self._fibre_value(paths, hits, light)
        self.rays += len(light)
        lit = ~blocked(self.cloth, origin, light)
        np.add.at(out, paths.group[lit], (paths.throughput * value)[lit])

    def _scattered(self, paths: Paths, hits: Hits, depth: int) -> Paths:
        on = self._on_fibre(hits)
        tubes_on = super()._scattered(paths.only(~on), hits.only(~on), depth)
        paths, hits = paths.only(on), hits.only(on)
        z = 2.0 * self.rng.random(len(paths.group)) - 1.0
        turn = 2 * math.pi * self.rng.random(len(z))
        flat = np.sqrt(1.0 - z * z)
        onward = np.stack((flat * np.cos(turn), flat * np.sin(turn), z), axis=-1)
        value, origin = self._fibre_value(paths, hits, onward)
        found = Paths(origin, onward, paths.throughput * value * (4 * math.pi), paths.group)
        found = self._survivors(found, depth)
        return Paths(*(np.concatenate(pair) for pair in zip(tubes_on, found, strict=True)))

    def _fibre_value(self, paths: Paths, hits: Hits, light: Floats) -> tuple[Floats, Floats]:
        """(n, 3) radiance per unit `L_i dwi` from `light`, and (n, 3) where rays to it begin."""
        fibre = self._of_fibre(hits)
        low = (hits.primitive - self.field.first) % (2 * CORNERS) < CORNERS
        along = np.where(low, hits.v, hits.u + hits.v).astype(np.float64)
        axis = self.field.axis[fibre]
        b, n = _across(axis)
        frame = np.stack((axis, b, n), axis=1)
        i, o = (np.einsum("nij,nj->ni", frame, w) for w in (light, -paths.direction))
        value = np.empty((len(i), 3))
        _scatter(self.cloth.threads, self.field.kind[fibre], i, o, value)
        aside = i.copy()
        aside[:, 0] = 0.0
        length = np.linalg.norm(aside, axis=1, keepdims=True)
        aside = np.divide(
            aside, length, out=np.tile([0.0, 0.0, 1.0], (len(i), 1)), where=length > 0
        )
        radius = OUTSIDE * FIBRE * math.pi / (2 * CORNERS * math.sin(math.pi / CORNERS))
        origin = self.field.root[fibre] + (LENGTH * along)[:, None] * axis
        return value, origin + radius * np.einsum("nij,ni->nj", frame, aside)


@njit(**KERNEL)
def _scatter(threads, kind, i, o, value):
    """Write `f_s cos(theta_i)` (n, 3) for directions i, o (n, 3) in the frames of fibres."""
    for k in range(kind.size):
        row = threads[kind[k]]
        surface, volume = terms(
            np.float64, row, i[k, 0], i[k, 1], i[k, 2], o[k, 0], o[k, 1], o[k, 2]
        )
        inclined = math.sqrt(i[k, 1] ** 2 + i[k, 2] ** 2)
        value[k, 0] = inclined * (surface + row[ALBEDO_R] * volume)
        value[k, 1] = inclined * (surface + row[ALBEDO_G] * volume)
        value[k, 2] = inclined * (surface + row[ALBEDO_B] * volume)
