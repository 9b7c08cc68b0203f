"""The fabric shader: applies the appearance kernels to blocks of hits on cloth.

Every fabric has tables for both of its sides. At levels `weave` and `thread`, the thread under each
hit is looked up first. Vectorised loops then evaluate the law towards the light and in the sampled
direction; they need these directions in arrays of their own.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.law import (
    PUBLISHED_ONLY,
    SurfaceLaw,
    law_density,
    law_direction,
    law_value,
    surface_law,
)
from fabricusd.appearance.published.levels import point_values
from fabricusd.appearance.sampling.blocks import Drawn, sample_points
from fabricusd.appearance.scattering.models import translucent
from fabricusd.appearance.shadow.methods import NONE, Shadow, compile_shadow, shade
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.coverage import GAP, WARP
from fabricusd.appearance.weave.lookup import back_of, find
from fabricusd.appearance.weave.place import Hit, Places, place_at
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import INLINE, LEAN
from fabricusd.reference.rays.embree import aligned_empty
from fabricusd.reference.rays.wave import (
    CHANCE,
    F_PDF,
    FAR_LEVEL,
    GO,
    GO_PDF,
    KEEP,
    PLACE,
    THREAD,
    THREAD_LEVEL,
    WEIGHT,
    F,
    Wave,
)
from fabricusd.reference.surfaces.fabric_far import STRAIGHT, finish_far, gather, shade_far

R = np.float32
_ONE_AT_A_TIME = threading.Lock()


class Points(NamedTuple):
    """The thread under each of n hits, as `weave.lookup.find` gives it.

    sets : (n,) uint8; threads : (n,) int32; along, across, psi0, length : (n,) float32
    """

    sets: NDArray[np.uint8]
    threads: NDArray[np.int32]
    along: NDArray[np.float32]
    across: NDArray[np.float32]
    psi0: NDArray[np.float32]
    length: NDArray[np.float32]


def places_of(points: Points) -> Places:
    """What the surface laws read of `points`."""
    return Places(points.sets, points.threads, points.psi0, points.across)


class Scattering(NamedTuple):
    """Directions and values of n hits in the surface frame, each (3, n) float32.

    wo, wi, go : directions to the viewer, to the light, and sampled
    towards, onwards : f times cosine, unshadowed, for `wi` and for `go`
    """

    wo: NDArray[np.float32]
    wi: NDArray[np.float32]
    go: NDArray[np.float32]
    towards: NDArray[np.float32]
    onwards: NDArray[np.float32]


class _Scratch:
    """Arrays for the directions and values of up to `capacity` hits; one per worker."""

    def __init__(self, capacity: int) -> None:
        self.vectors = [aligned_empty((3 * capacity,)) for _ in range(5)]
        self.sets = np.empty(capacity, np.uint8)
        self.threads = np.empty(capacity, np.int32)
        self.psi0 = aligned_empty((capacity,))
        self.across = aligned_empty((capacity,))
        self.along = aligned_empty((capacity,))
        self.length = aligned_empty((capacity,))

    def scattering(self, count: int) -> Scattering:
        """C-contiguous arrays for `count` hits."""
        return Scattering(*(v[: 3 * count].reshape(3, count) for v in self.vectors))

    def points(self, count: int) -> Points:
        """Arrays for `count` hits."""
        return Points(
            self.sets[:count], self.threads[:count], self.along[:count], self.across[:count],
            self.psi0[:count], self.length[:count],
        )  # fmt: skip


class _Side:
    """The tables of one side of a cloth, made on demand."""

    def __init__(self, fabric: Fabric, shadow: str, make_ready: Callable[[], None]) -> None:
        self.fabric, self.method, self.make_ready = fabric, shadow, make_ready
        self.types = len(fabric.threads)
        self._law: SurfaceLaw | None = None
        self._near: dict[int, tuple[CompiledFabric, Shadow]] = {}

    @property
    def law(self) -> SurfaceLaw:
        """The surface law, made when it is first needed: often a cloth's back is never seen."""
        with _ONE_AT_A_TIME:
            if self._law is None:
                self._law = surface_law(self.fabric, precision=np.float32)
            return self._law

    def near(self, level: int) -> tuple[CompiledFabric, Shadow]:
        """Weave and shadowing for level `weave` or `thread`, made when they are first needed."""
        # One lock for all cloths: numba's own workers compute some of these tables, and they may
        # not be called from two threads at once.
        with _ONE_AT_A_TIME:
            if level not in self._near:
                self.make_ready()
                name = "thread" if level == THREAD_LEVEL else "weave"
                self._near[level] = (
                    compile_fabric(self.fabric, precision=np.float32),
                    compile_shadow(self.fabric, self.method, level=name),
                )
            return self._near[level]


class FabricShader:
    """Shades hits of one fabric: rows F, F_PDF, GO, WEIGHT, GO_PDF, KEEP of `Hits.rows`.

    shadow : one of `shadow.METHODS`, at levels `weave` and `thread`
    make_ready : called before the first hit at one of those levels; many pictures have none
    """

    def __init__(
        self, fabric: Fabric, shadow: str, make_ready: Callable[[], None] = lambda: None
    ) -> None:
        self.fabric = fabric
        self.sides = tuple(_Side(f, shadow, make_ready) for f in (fabric, back_of(fabric)))
        self.gap = 0.0 if fabric.opaque else float(self.sides[0].law.published.gap)
        self.translucent = translucent(fabric)

    def __call__(self, level: int, back: int, wave: Wave, first: int, last: int) -> None:
        """Shade the hits from `first` to before `last`, all on one side and at one level."""
        side, hits = self.sides[back], wave.hits.rows
        if level == FAR_LEVEL and side.law.kind == PUBLISHED_ONLY:
            shade_far(R, side.law.published, side.law.lobes, R(self.gap), hits, first, last)
            return
        scratch = wave.scratch or _Scratch(wave.capacity)
        wave.scratch = scratch
        scattering = scratch.scattering(last - first)
        gather(hits, first, last - first, scattering.wo, scattering.wi)
        if level == FAR_LEVEL:
            self._shade_by_law(side, hits, first, scattering)
        else:
            points = scratch.points(last - first)
            self._shade_near(side, level, back, hits, first, scattering, points)

    def _shade_by_law(
        self, side: _Side, hits: NDArray[np.float32], first: int, scattering: Scattering
    ) -> None:
        """Shade hits at level `far` on cloth with `conserving` threads."""
        _, _, go, towards, onwards = scattering
        count = go.shape[1]
        none, real = np.zeros(count, np.uint8), np.zeros(count, np.float32)
        points = Points(none, none.astype(np.int32), real, real, real, real)
        _by_law(R, side.law, FAR_LEVEL, hits, first, scattering, places_of(points))
        finish_far(R, hits, first, count, R(self.gap), go, towards, onwards)

    def _shade_near(
        self,
        side: _Side,
        level: int,
        back: int,
        hits: NDArray[np.float32],
        first: int,
        scattering: Scattering,
        points: Points,
    ) -> None:
        wo, wi, go, towards, onwards = scattering
        law, (cloth, shadow) = side.law, side.near(level)
        count = wo.shape[1]
        places = places_of(points)
        v_sign = R(-1) if back else R(1)
        look_up(R, cloth, v_sign, hits, first, points)
        if law.kind == PUBLISHED_ONLY:
            sample_points(
                R, law.published.threads, law.lobes, level == THREAD_LEVEL, places, wo, wi,
                tuple(hits[CHANCE : CHANCE + 3]), Drawn(go, hits[F_PDF], hits[GO_PDF]), first,
                count,
            )  # fmt: skip
            near = (R, law.published, level == THREAD_LEVEL, places)
            point_values(*near, wi, wo, towards, 0, count)
            point_values(*near, go, wo, onwards, 0, count)
        else:
            _by_law(R, law, level, hits, first, scattering, places)
        finish_point(
            R, cloth, shadow, v_sign, R(0 if self.gap == 0 else 1), side.types, hits, first,
            scattering, points,
        )  # fmt: skip


@njit(**LEAN)
def _by_law(R, law, level, hits, first, scattering, places):
    """Sample and evaluate cloth with `conserving` threads, one hit at a time."""
    wo, wi, go, towards, onwards = scattering
    for k in range(wo.shape[1]):
        h = first + k
        place = place_at(places, k)
        ox, oy, oz = wo[0, k], wo[1, k], wo[2, k]
        x, y, z = law_direction(
            R, law, level, place, ox, oy, oz,
            hits[CHANCE, h], hits[CHANCE + 1, h], hits[CHANCE + 2, h],
        )  # fmt: skip
        go[0, k], go[1, k], go[2, k] = x, y, z
        # Loop over both directions: the functions are large and inlined at each call.
        for turn in range(2):
            pdf = law_density(R, law, level, place, x, y, z, ox, oy, oz)
            red, green, blue = law_value(R, law, level, place, x, y, z, ox, oy, oz)
            if turn == 0:
                hits[GO_PDF, h] = pdf
                onwards[0, k], onwards[1, k], onwards[2, k] = red, green, blue
                x, y, z = wi[0, k], wi[1, k], wi[2, k]
            else:
                hits[F_PDF, h] = pdf
                towards[0, k], towards[1, k], towards[2, k] = red, green, blue


@njit(**INLINE)
def _finish(hits, h, keep, k, go, onwards):
    pdf = hits[GO_PDF, h]
    chance = hits[CHANCE + 3, h]
    hits[F_PDF, h] *= keep
    if chance >= keep:
        hits[GO_PDF, h] = STRAIGHT
        return
    hits[CHANCE + 3, h] = chance / keep
    hits[GO, h], hits[GO + 1, h], hits[GO + 2, h] = go[0, k], go[1, k], go[2, k]
    inverse = R(1) / (pdf * keep) if pdf > R(0) else R(0)
    hits[WEIGHT, h], hits[WEIGHT + 1, h] = onwards[0, k] * inverse, onwards[1, k] * inverse
    hits[WEIGHT + 2, h] = onwards[2, k] * inverse
    hits[GO_PDF, h] = pdf * keep


@njit(**LEAN)
def look_up(R, cloth, v_sign, hits, first, points):
    """Look up the thread under each hit."""
    sets, threads, along, across, psi0, length = points
    for k in range(sets.shape[0]):
        h = first + k
        which, thread, s, w, angle, run = find(
            R, cloth, float(hits[PLACE, h]), float(v_sign * hits[PLACE + 1, h])
        )
        sets[k], threads[k], along[k], across[k] = which, thread, s, w
        psi0[k], length[k] = angle, run


@njit(**LEAN)
def finish_point(R, cloth, shadow, v_sign, open_gap, types, hits, first, scattering, points):
    """Apply the shadowing of neighbouring threads; in a gap, the path goes straight on or ends."""
    _, wi, go, towards, onwards = scattering
    sets, threads, along, across, _, length = points
    for k in range(wi.shape[1]):
        h = first + k
        if sets[k] == GAP:
            hits[F, h], hits[F + 1, h], hits[F + 2, h] = R(0), R(0), R(0)
            hits[F_PDF, h] = R(0)
            hits[KEEP, h], hits[THREAD, h] = R(1) - open_gap, R(-1)
            hits[GO_PDF, h] = -open_gap
            continue
        u, v = float(hits[PLACE, h]), float(v_sign * hits[PLACE + 1, h])
        light, bounce = R(1), R(1)
        hit = Hit(sets[k], threads[k], along[k], across[k], length[k])
        if shadow.method != NONE:
            # Light from behind the cloth is shadowed by the threads on that side.
            light = R(1) if wi[2, k] <= R(0) else shade(
                R, cloth, shadow, u, v, hit, wi[0, k], wi[1, k], wi[2, k],
            )  # fmt: skip
            bounce = R(1) if go[2, k] <= R(0) else shade(
                R, cloth, shadow, u, v, hit, go[0, k], go[1, k], go[2, k],
            )  # fmt: skip
        for row in range(3):
            hits[F + row, h] = light * towards[row, k]
            onwards[row, k] = bounce * onwards[row, k]
        # The same number as `weave.thread_number`.
        hits[KEEP, h] = R(1)
        hits[THREAD, h] = R(threads[k] + (types if sets[k] == WARP else 0))
        _finish(hits, h, R(1), k, go, onwards)
