"""The fabric shader: applies the appearance kernels to blocks of hits on cloth.

Every fabric has tables for both of its sides. At levels `weave` and `thread`, the thread under each
hit is looked up first. Vectorised loops then evaluate the law towards the light and in the sampled
direction; they need these directions in arrays of their own.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.conserving.blocks import conserving_point_values
from fabricusd.appearance.conserving.single import ConservingTables
from fabricusd.appearance.fuzz import Fuzz, optical_depth
from fabricusd.appearance.law import (
    CONSERVING_ONLY,
    PUBLISHED_ONLY,
    SurfaceLaw,
    law_density,
    law_direction,
    law_value,
    surface_law,
)
from fabricusd.appearance.laws import law_of
from fabricusd.appearance.published.levels import point_values
from fabricusd.appearance.sampling.blocks import Drawn, sample_points, sample_points_both
from fabricusd.appearance.sampling.mixture import Mixture, density, direction
from fabricusd.appearance.scattering.models import translucent
from fabricusd.appearance.shadow.kinds import Shadow
from fabricusd.appearance.shadow.methods import compile_shadow
from fabricusd.appearance.surface import fuzz_of
from fabricusd.appearance.weave.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.weave.coverage import GAP, WARP
from fabricusd.appearance.weave.lookup import back_of
from fabricusd.appearance.weave.place import place_at
from fabricusd.appearance.weave.yarn.compiled import compile_yarn
from fabricusd.cache import kept_groups
from fabricusd.fabric import Fabric, one_side
from fabricusd.kernels.cache import fingerprint
from fabricusd.kernels.calls import Calls
from fabricusd.kernels.real import INLINE, KERNEL, LEAN
from fabricusd.reference.rays.embree import aligned_empty
from fabricusd.reference.rays.wave import (
    CHANCE,
    F_PDF,
    FAR_LEVEL,
    GO,
    GO_PDF,
    KEEP,
    PRIMITIVE,
    THREAD,
    THREAD_LEVEL,
    WEIGHT,
    F,
    Wave,
)
from fabricusd.reference.surfaces.fabric_far import (
    STRAIGHT,
    gather,
    shade_far,
    shade_far_conserving,
)
from fabricusd.reference.surfaces.fabric_fuzz import lay_fuzz
from fabricusd.reference.surfaces.fabric_gap import gap_table, pass_far, pass_gaps, pass_places
from fabricusd.reference.surfaces.fabric_near import (
    Lit,
    Points,
    look_up,
    look_up_uneven,
    places_of,
    shadows,
)

R = np.float32
_ONE_AT_A_TIME = threading.Lock()
NOWHERE_ELSE = np.zeros((0, 2), np.int64)
"""`TriangleTables.home` of a scene without uneven threads."""


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
        self.passes = aligned_empty((capacity,))
        self.along = aligned_empty((capacity,))
        self.length = aligned_empty((capacity,))
        self.strand = aligned_empty((capacity,))
        self.shade = aligned_empty((capacity,))
        self.light = aligned_empty((capacity,))
        self.bounce = aligned_empty((capacity,))

    def scattering(self, count: int) -> Scattering:
        """C-contiguous arrays for `count` hits."""
        return Scattering(*(v[: 3 * count].reshape(3, count) for v in self.vectors))

    def points(self, count: int, *, uneven: bool) -> Points:
        """Arrays for `count` hits."""
        across = self.across[:count]
        return Points(
            self.sets[:count], self.threads[:count], self.along[:count], across,
            self.psi0[:count], self.length[:count],
            self.strand[:count] if uneven else across, self.shade[: count if uneven else 0],
        )  # fmt: skip


class _Side:
    """The tables of one side of a cloth, made on demand."""

    def __init__(
        self, fabric: Fabric, front: Fabric | None, shadow: str, make_ready: Callable[[], None]
    ) -> None:
        self.fabric, self.method, self.make_ready = fabric, shadow, make_ready
        self.yarn = compile_yarn(fabric, back_of=front) if fabric.is_uneven else None
        self.types, self.hairy = len(fabric.threads), optical_depth(fabric) > 0.0
        self.call = Calls()
        self._law: SurfaceLaw | None = None
        self._fuzz: Fuzz | None = None
        self._near: tuple[CompiledFabric, Shadow] | None = None

    @property
    def law(self) -> SurfaceLaw:
        """The surface law, made when it is first needed: often a cloth's back is never seen."""
        with _ONE_AT_A_TIME:
            if self._law is None:
                key = fingerprint(), self.method, *one_side(self.fabric)
                kinds = {
                    "published": law_of(self.fabric).tables, "lobes": Mixture,
                    "conserving": ConservingTables, "conserving_lobes": Mixture,
                }  # fmt: skip
                found = kept_groups("laws", key, lambda: self._new_law()._asdict(), kinds)
                self._law = SurfaceLaw(**found)
            return self._law

    def _new_law(self) -> SurfaceLaw:
        held = self._made()[1] if law_of(self.fabric).absolute else None
        return surface_law(self.fabric, precision=np.float32, shadow=held)

    @property
    def fuzz(self) -> Fuzz | None:
        """The fuzz over this side, made like the law; None where no thread is hairy."""
        if self.hairy and self._fuzz is None:
            with _ONE_AT_A_TIME:
                self._fuzz = fuzz_of(self.fabric, np.float32)
        return self._fuzz

    @property
    def near(self) -> tuple[CompiledFabric, Shadow]:
        """Weave and shadowing for levels `weave` and `thread`, made when they are first needed."""
        # One lock for all cloths: numba's own workers compute some of these tables, and they may
        # not be called from two threads at once.
        self.make_ready()
        with _ONE_AT_A_TIME:
            return self._made()

    def _made(self) -> tuple[CompiledFabric, Shadow]:
        if self._near is None:
            cloth = compile_fabric(self.fabric, precision=np.float32)
            self._near = cloth, compile_shadow(self.fabric, self.method)
        return self._near


class FabricShader:
    """Shades hits of one fabric: rows F, F_PDF, GO, WEIGHT, GO_PDF, KEEP of `Hits.rows`.

    shadow : one of `shadow.METHODS`, at levels `weave` and `thread`
    make_ready : called before the first hit at one of those levels; many pictures have none

    gap : share of the light that passes between the threads, seen from above; gaps : table of the
        same by direction, None where the direction does not matter. Those of the front hold for
        both sides.
    home : `TriangleTables.home` of the scene, read if the threads are uneven
    """

    def __init__(
        self, fabric: Fabric, shadow: str, make_ready: Callable[[], None] = lambda: None
    ) -> None:
        self.fabric, self.home = fabric, NOWHERE_ELSE
        self.sides = (
            _Side(fabric, None, shadow, make_ready),
            _Side(back_of(fabric), fabric, shadow, make_ready),
        )
        law = self.sides[0].law
        self.gap = 0.0 if fabric.opaque else float(law.published.gap)
        self.gaps = gap_table(law, fabric.opaque)
        self.is_open = R(0 if fabric.opaque else 1)
        self.translucent = translucent(fabric)

    def __call__(self, level: int, back: int, wave: Wave, first: int, last: int) -> None:
        """Shade the hits from `first` to before `last`, all on one side and at one level."""
        side = self.sides[back]
        self._shade(level, back, wave, first, last)
        fuzz = side.fuzz
        if fuzz is not None:
            is_far, rows = level == FAR_LEVEL, wave.hits.rows
            side.call(lay_fuzz, R, fuzz, is_far, side.types, rows, first, last)

    def _shade(self, level: int, back: int, wave: Wave, first: int, last: int) -> None:
        side, hits = self.sides[back], wave.hits.rows
        if level == FAR_LEVEL and side.law.kind == PUBLISHED_ONLY:
            law = side.law
            side.call(shade_far, R, law.published, law.lobes, self.is_open, hits, first, last)
            return
        if level == FAR_LEVEL and side.law.kind == CONSERVING_ONLY:
            side.call(
                shade_far_conserving, R, side.law.conserving, side.law.conserving_lobes,
                self.sides[0].law.conserving, self.is_open, hits, first, last,
            )  # fmt: skip
            return
        scratch = wave.scratch or _Scratch(wave.capacity)
        wave.scratch = scratch
        scattering = scratch.scattering(last - first)
        side.call(gather, hits, first, last - first, scattering.wo, scattering.wi)
        passes = scratch.passes[: last - first]
        if level == FAR_LEVEL:
            self._shade_by_law(side, hits, first, scattering, passes)
        else:
            points = scratch.points(last - first, uneven=side.yarn is not None)
            lit = Lit(scratch.light[: last - first], scratch.bounce[: last - first])
            self._shade_near(side, level, back, wave, first, scattering, points, passes, lit)

    def _shade_by_law(
        self,
        side: _Side,
        hits: NDArray[np.float32],
        first: int,
        scattering: Scattering,
        passes: NDArray[np.float32],
    ) -> None:
        """Shade hits at level `far` on cloth whose threads follow both laws."""
        count = len(passes)
        none, real = np.zeros(count, np.uint8), np.zeros(count, np.float32)
        points = Points(none, none.astype(np.int32), real, real, real, real, real, real[:0])
        side.call(_by_law, R, side.law, FAR_LEVEL, hits, first, scattering, places_of(points))
        side.call(pass_far, R, self.sides[0].law.conserving, self.is_open, scattering.wo, passes)
        side.call(finish_by_law, R, hits, first, passes, scattering)

    def _shade_near(
        self,
        side: _Side,
        level: int,
        back: int,
        wave: Wave,
        first: int,
        scattering: Scattering,
        points: Points,
        passes: NDArray[np.float32],
        lit: Lit,
    ) -> None:
        wo, wi, go, towards, onwards = scattering
        hits = wave.hits.rows
        law, (cloth, shadow), call = side.law, side.near, side.call
        count = wo.shape[1]
        places = places_of(points)
        v_sign = R(-1) if back else R(1)
        if side.yarn is None:
            call(look_up, R, cloth, shadow, v_sign, hits, first, points)
        else:
            home = self.home if wave.carried is None else wave.carried.home
            call(
                look_up_uneven, R, cloth, shadow, side.yarn, home, v_sign,
                wave.hits.tags[PRIMITIVE], hits, first, points,
            )  # fmt: skip
        if law.kind == PUBLISHED_ONLY:
            call(
                sample_points, R, law.published.threads, law.lobes, level == THREAD_LEVEL, places,
                wo, wi, tuple(hits[CHANCE : CHANCE + 3]), Drawn(go, hits[F_PDF], hits[GO_PDF]),
                first, count,
            )  # fmt: skip
            near: tuple[Any, ...] = (R, law.published, level == THREAD_LEVEL, places)
            call(point_values, *near, wi, wo, towards, 0, count)
            call(point_values, *near, go, wo, onwards, 0, count)
            call(pass_gaps, R, law.published, self.is_open, points.sets, wo, passes)
        else:
            if law.kind == CONSERVING_ONLY:
                table, lobes = law.conserving, law.conserving_lobes
                across_too = level == THREAD_LEVEL
                call(
                    sample_points_both, R, table.threads, lobes, across_too, places, wo, wi,
                    tuple(hits[CHANCE : CHANCE + 3]), Drawn(go, hits[F_PDF], hits[GO_PDF]), first,
                    count,
                )  # fmt: skip
                call(sample_gaps, R, lobes, places.sets, hits, first, scattering)
                values, near = conserving_point_values, (R, table, across_too, places)
                call(values, *near, wi, wo, towards, 0, count)
                call(values, *near, go, wo, onwards, 0, count)
            else:
                call(_by_law, R, law, level, hits, first, scattering, places)
            call(pass_places, R, law.conserving, self.is_open, points.sets, wo, passes)
        shadows(call, cloth, shadow, v_sign, hits, first, (wi, go), points, lit)
        call(
            finish_point, R, law.kind == PUBLISHED_ONLY, side.types, hits, first, scattering,
            points, passes, lit,
        )  # fmt: skip


@njit(**LEAN)
def _by_law(R, law, level, hits, first, scattering, places):
    """Sample and evaluate cloth whose threads follow both laws, one hit at a time."""
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


@njit(**KERNEL)
def sample_gaps(R, lobes, sets, hits, first, scattering):
    """Sample hits in gaps as the whole repeat: what does not pass there is scattered like that."""
    wo, wi, go, _, _ = scattering
    for k in range(wo.shape[1]):
        if sets[k] <= WARP:
            continue
        h = first + k
        ox, oy, oz = wo[0, k], wo[1, k], wo[2, k]
        x, y, z = direction(
            R, lobes, ox, oy, oz, hits[CHANCE, h], hits[CHANCE + 1, h], hits[CHANCE + 2, h]
        )
        go[0, k], go[1, k], go[2, k] = x, y, z
        hits[GO_PDF, h] = density(R, lobes, x, y, z, ox, oy, oz)
        hits[F_PDF, h] = density(R, lobes, wi[0, k], wi[1, k], wi[2, k], ox, oy, oz)


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
def finish_by_law(R, hits, first, passes, scattering):
    """Write values and weights at level `far`; of each hit's paths, the share `passes` goes
    straight on."""
    _, _, go, towards, onwards = scattering
    for k in range(passes.size):
        h = first + k
        keep = R(1) - passes[k]
        for row in range(3):
            hits[F + row, h] = towards[row, k]
        hits[KEEP, h], hits[THREAD, h] = keep, R(-1)
        _finish(hits, h, keep, k, go, onwards)


@njit(**LEAN)
def finish_point(R, published, types, hits, first, scattering, points, passes, lit):
    """Apply the shadows of neighbouring threads, and let paths through.

    passes : (n,) probability with which a path goes straight on at its place; what does not pass a
        gap of `published` cloth ends there
    """
    _, _, go, towards, onwards = scattering
    sets, threads = points.sets, points.threads
    for k in range(go.shape[1]):
        h = first + k
        keep = R(1) - passes[k]
        if sets[k] == GAP and published:
            hits[F, h], hits[F + 1, h], hits[F + 2, h] = R(0), R(0), R(0)
            hits[F_PDF, h] = R(0)
            hits[KEEP, h], hits[THREAD, h] = keep, R(-1)
            hits[GO_PDF, h] = STRAIGHT if hits[CHANCE + 3, h] >= keep else R(0)
            continue
        if sets[k] == GAP:
            for row in range(3):
                hits[F + row, h] = towards[row, k]
            hits[KEEP, h], hits[THREAD, h] = keep, R(-1)
            _finish(hits, h, keep, k, go, onwards)
            continue
        light, bounce = lit.light[k], lit.bounce[k]
        for row in range(3):
            hits[F + row, h] = light * towards[row, k]
            onwards[row, k] = bounce * onwards[row, k]
        # The same number as `weave.thread_number`.
        hits[KEEP, h] = keep
        hits[THREAD, h] = R(threads[k] + (types if sets[k] == WARP else 0))
        _finish(hits, h, keep, k, go, onwards)
