"""Cloth as a surface of the path tracer: the appearance kernels on hits, in blocks.

Every fabric has tables for both its sides. At levels `weave` and `thread` the thread under each hit
is looked up first; the laws are then evaluated towards the light and in the sampled direction by
the vectorised loops, which want directions of their own, side by side.
"""

from __future__ import annotations

import threading

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.compiled import CompiledFabric, compile_fabric
from fabricusd.appearance.coverage import GAP
from fabricusd.appearance.far import far_values
from fabricusd.appearance.levels import point_values
from fabricusd.appearance.real import LEAN
from fabricusd.appearance.shadow import NONE, Shadow, compile_shadow, lit
from fabricusd.appearance.surface_sampling import (
    SamplingTables,
    far_density,
    far_direction,
    point_density,
    point_direction,
    sampling_tables,
)
from fabricusd.appearance.surface_tables import SurfaceTables, surface_tables
from fabricusd.appearance.weave import back_of, find
from fabricusd.fabric import Fabric
from fabricusd.reference.embree import aligned_empty
from fabricusd.reference.wave import (
    CHANCE,
    F_PDF,
    FAR_LEVEL,
    GO_PDF,
    KEEP,
    PLACE,
    THREAD,
    THREAD_LEVEL,
    WEIGHT,
    WI,
    WO,
    F,
    Wave,
)

R = np.float32
_STRAIGHT = R(-1)


class _Scratch:
    """Directions and values of up to `capacity` hits, side by side; one per worker."""

    def __init__(self, capacity: int) -> None:
        self.vectors = [aligned_empty((3 * capacity,)) for _ in range(5)]
        self.sets = np.empty(capacity, np.uint8)
        self.threads = np.empty(capacity, np.int32)
        self.psi0 = aligned_empty((capacity,))
        self.across = aligned_empty((capacity,))
        self.along = aligned_empty((capacity,))
        self.length = aligned_empty((capacity,))

    def views(self, count: int) -> list[NDArray[np.float32]]:
        """Five (3, count) arrays, C-contiguous."""
        return [v[: 3 * count].reshape(3, count) for v in self.vectors]


class _Side:
    """One side of a cloth, made ready."""

    def __init__(self, fabric: Fabric, shadow: str) -> None:
        self.fabric, self.method = fabric, shadow
        self.tables: SurfaceTables = surface_tables(fabric, precision=np.float32)
        self.sampling: SamplingTables = sampling_tables(fabric, self.tables)
        self._near: dict[int, tuple[CompiledFabric, Shadow]] = {}
        self._lock = threading.Lock()

    def near(self, level: int) -> tuple[CompiledFabric, Shadow]:
        """Weave and shadowing of level `weave` or `thread`, made when first needed."""
        with self._lock:
            if level not in self._near:
                name = "thread" if level == THREAD_LEVEL else "weave"
                self._near[level] = (
                    compile_fabric(self.fabric, precision=np.float32),
                    compile_shadow(self.fabric, self.method, level=name),
                )
            return self._near[level]


class FabricShader:
    """Shades hits of one fabric: rows F, F_PDF, GO, WEIGHT, GO_PDF, KEEP of `Wave.hits`.

    shadow : one of `shadow.METHODS`, at levels `weave` and `thread`
    """

    def __init__(self, fabric: Fabric, shadow: str) -> None:
        self.sides = (_Side(fabric, shadow), _Side(back_of(fabric), shadow))
        self.gap = 0.0 if fabric.opaque else float(self.sides[0].tables.gap)

    def __call__(self, level: int, back: int, wave: Wave, first: int, last: int) -> None:
        """Shade hits `first` to `last`, all on one side at one level."""
        side = self.sides[back]
        scratch = wave.scratch or _Scratch(wave.capacity)
        wave.scratch = scratch
        count = last - first
        wo, wi, go, towards, onwards = scratch.views(count)
        _gather(wave.hits, first, wo, wi)
        if level == FAR_LEVEL:
            _sample_far(R, side.tables, side.sampling, wave.hits, first, wo, wi, go)
            far_values(R, side.tables, wi, wo, towards)
            far_values(R, side.tables, go, wo, onwards)
            _finish_far(R, wave.hits, first, R(self.gap), towards, onwards)
            return
        cloth, shadow = side.near(level)
        found = (
            scratch.sets[:count], scratch.threads[:count], scratch.along[:count],
            scratch.across[:count], scratch.psi0[:count], scratch.length[:count],
        )  # fmt: skip
        sets, threads, _, across, psi0, _ = found
        v_sign = R(-1) if back else R(1)
        _sample_point(
            R, cloth, side.tables, side.sampling, v_sign, wave.hits, first, wo, wi, go, *found
        )
        across_too = level == THREAD_LEVEL
        point_values(R, side.tables, across_too, sets, threads, psi0, across, wi, wo, towards)
        point_values(R, side.tables, across_too, sets, threads, psi0, across, go, wo, onwards)
        _finish_point(
            R, cloth, shadow, v_sign, R(0 if self.gap == 0 else 1), wave.hits, first, wi, go,
            towards, onwards, *found,
        )  # fmt: skip


@njit(**LEAN)
def _gather(hits, first, wo, wi):
    for row in range(3):
        for k in range(wo.shape[1]):
            wo[row, k] = hits[WO + row, first + k]
            wi[row, k] = hits[WI + row, first + k]


@njit(**LEAN)
def _sample_far(R, tables, sampling, hits, first, wo, wi, go):
    """Directions and both densities at level `far`."""
    for k in range(wo.shape[1]):
        h = first + k
        ox, oy, oz = wo[0, k], wo[1, k], wo[2, k]
        x, y, z = far_direction(
            R, sampling, ox, oy, oz, hits[CHANCE, h], hits[CHANCE + 1, h], hits[CHANCE + 2, h]
        )
        go[0, k], go[1, k], go[2, k] = x, y, z
        hits[GO_PDF, h] = far_density(R, sampling, x, y, z, ox, oy, oz)
        hits[F_PDF, h] = far_density(R, sampling, wi[0, k], wi[1, k], wi[2, k], ox, oy, oz)


@njit(**LEAN)
def _finish_far(R, hits, first, gap, towards, onwards):
    """Values and weights; the gap lets its share of the paths go straight on."""
    keep = R(1) - gap
    for k in range(towards.shape[1]):
        h = first + k
        for row in range(3):
            hits[F + row, h] = towards[row, k]
        hits[KEEP, h], hits[THREAD, h] = keep, R(-1)
        _finish(hits, h, keep, k, onwards)


@njit(**LEAN)
def _finish(hits, h, keep, k, onwards):
    pdf = hits[GO_PDF, h]
    chance = hits[CHANCE + 3, h]
    hits[F_PDF, h] *= keep
    if chance >= keep:
        hits[GO_PDF, h] = _STRAIGHT
        return
    hits[CHANCE + 3, h] = chance / keep
    inverse = R(1) / (pdf * keep) if pdf > R(0) else R(0)
    hits[WEIGHT, h], hits[WEIGHT + 1, h] = onwards[0, k] * inverse, onwards[1, k] * inverse
    hits[WEIGHT + 2, h] = onwards[2, k] * inverse
    hits[GO_PDF, h] = pdf * keep


@njit(**LEAN)
def _sample_point(
    R, cloth, tables, sampling, v_sign, hits, first, wo, wi, go,
    sets, threads, along, across, psi0, length,
):  # fmt: skip
    """The thread under each hit, a direction there, and both densities."""
    for k in range(wo.shape[1]):
        h = first + k
        which, thread, s, w, angle, run = find(
            R, cloth, float(hits[PLACE, h]), float(v_sign * hits[PLACE + 1, h])
        )
        sets[k], threads[k], along[k], across[k], psi0[k], length[k] = (
            which, thread, s, w, angle, run,
        )  # fmt: skip
        ox, oy, oz = wo[0, k], wo[1, k], wo[2, k]
        x, y, z = point_direction(
            R, tables, sampling, which, thread, angle, ox, oy, oz,
            hits[CHANCE, h], hits[CHANCE + 1, h], hits[CHANCE + 2, h],
        )  # fmt: skip
        go[0, k], go[1, k], go[2, k] = x, y, z
        hits[GO_PDF, h] = point_density(
            R, tables, sampling, which, thread, angle, x, y, z, ox, oy, oz
        )
        hits[F_PDF, h] = point_density(
            R, tables, sampling, which, thread, angle, wi[0, k], wi[1, k], wi[2, k], ox, oy, oz
        )


@njit(**LEAN)
def _finish_point(
    R, cloth, shadow, v_sign, open_gap, hits, first, wi, go, towards, onwards,
    sets, threads, along, across, psi0, length,
):  # fmt: skip
    """Shadow the values by the neighbouring threads; in a gap the path goes straight on or ends."""
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
        if shadow.method != NONE:
            light = lit(
                R, cloth, shadow, u, v, sets[k], threads[k], along[k], across[k], length[k],
                wi[0, k], wi[1, k], wi[2, k],
            )  # fmt: skip
            bounce = lit(
                R, cloth, shadow, u, v, sets[k], threads[k], along[k], across[k], length[k],
                go[0, k], go[1, k], go[2, k],
            )  # fmt: skip
        for row in range(3):
            hits[F + row, h] = light * towards[row, k]
            onwards[row, k] = bounce * onwards[row, k]
        hits[KEEP, h], hits[THREAD, h] = R(1), R(threads[k])
        _finish(hits, h, R(1), k, onwards)
