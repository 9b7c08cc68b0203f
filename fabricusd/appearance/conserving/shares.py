"""The shares of the lobes of `conserving_sampling`, by `share_fit`: cloth and points."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from fabricusd.appearance.conserving.multiple import conserving_point_value, conserving_value
from fabricusd.appearance.conserving.sampling import (
    POINT_LOBES,
    UNIFORM,
    ConservingSamplingTables,
    even_density,
    far_lobe_direction,
    point_lobe_direction,
    stretch_densities,
)
from fabricusd.appearance.conserving.single import ConservingTables
from fabricusd.appearance.sampling.share_fit import (
    AZIMUTHS,
    DRAWS,
    ELEVATIONS,
    EVEN,
    LOBES,
    VALUE,
    VIEWS,
    best_shares,
    grid_view,
    noted,
    stratum,
)
from fabricusd.appearance.sampling.stretches import (
    COS,
    PSI0,
    SET,
    SIN,
    SURFACE_WIDTH,
    TAN,
    THREAD,
    VOLUME_WIDTH,
    stretches_of,
)
from fabricusd.appearance.scattering.columns import GAMMA_SURFACE, GAMMA_VOLUME
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import INLINE, KERNEL, PART

LEAST_SHARE = 0.02
"""See `share_fit.best_shares`."""


def conserving_sampling_tables(
    fabric: Fabric, tables: ConservingTables
) -> ConservingSamplingTables:
    """Stretches of `fabric` and the shares of their lobes, measured on `tables`."""
    R = tables.nodes.dtype.type
    single: Any = np.float32
    rows = stretches_of(fabric)
    kept = _in_single_precision(tables)
    stretches = rows.astype(single)
    lobes = 6 * len(rows) + 2
    possible = np.arange(lobes)
    if tables.opaque:
        possible = np.delete(possible, [*range(3 * len(rows), 6 * len(rows)), lobes - 1])
    found = noted(len(possible), lobes)
    _draw_far(single, kept, stretches, possible, found)
    shares = best_shares(found, possible, UNIFORM, LEAST_SHARE)
    at_points = np.zeros((VIEWS, len(rows), POINT_LOBES))
    possible = np.array([0, 1, 2, 6]) if tables.opaque else np.arange(POINT_LOBES)
    for y, stretch in enumerate(stretches):
        found = noted(len(possible), POINT_LOBES)
        _draw_points(single, kept, stretch, possible, found)
        at_points[:, y] = best_shares(found, possible, UNIFORM, LEAST_SHARE)
    shape = (ELEVATIONS, AZIMUTHS, -1)
    return ConservingSamplingTables(
        rows.astype(R), shares.reshape(shape).astype(R), at_points.reshape(shape).astype(R),
        tables.opaque,
    )  # fmt: skip


def _in_single_precision(tables: ConservingTables) -> ConservingTables:
    """Shares need no more, and one kernel serves both precisions."""
    return tables._replace(
        threads=tables.threads.astype(np.float32),
        nodes=tables.nodes.astype(np.float32),
        covered=np.float32(tables.covered),
        lost=tables.lost.astype(np.float32),
        strength=tables.strength.astype(np.float32),
        forward=np.float32(tables.forward),
    )


@njit(**INLINE)
def _note(R, opaque, value, found, ix, iy, iz):  # type: ignore[no-untyped-def]
    """The value as a grey, the uniform part's density, and the cosine lobes' into the last two."""
    found[VALUE] = (value[0] + value[1] + value[2]) * R(1.0 / 3.0)
    found[EVEN] = even_density(R, opaque, iz)
    last = found.shape[0] - 1
    found[last - 1 if iz > R(0) else last] = abs(iz) * R(1 / math.pi)


@njit(**KERNEL)
def _draw_far(R, tables, stretches, possible, found):  # type: ignore[no-untyped-def]
    """Directions of every possible lobe at every view: found (views, draws, lobes + 2)."""
    for view in range(found.shape[0]):
        ox, oy, oz = grid_view(R, view)
        for k in range(possible.size):
            for m in range(DRAWS):
                u1, u2 = stratum(R, m)
                ix, iy, iz = far_lobe_direction(R, stretches, possible[k], ox, oy, oz, u1, u2)
                if abs(iz) > R(1e-6):
                    _describe_far(
                        R, tables, stretches, ix, iy, iz, ox, oy, oz, found[view, k * DRAWS + m]
                    )


@njit(**PART)
def _describe_far(R, tables, stretches, ix, iy, iz, ox, oy, oz, found):  # type: ignore[no-untyped-def]
    _note(R, tables.opaque, conserving_value(R, tables, ix, iy, iz, ox, oy, oz), found, ix, iy, iz)
    first = LOBES if iz > R(0) else LOBES + 3 * stretches.shape[0]
    for y in range(stretches.shape[0]):
        row = stretches[y]
        k = first + 3 * y
        found[k], found[k + 1], found[k + 2] = stretch_densities(
            R, row[COS], row[SIN], row[PSI0], row[TAN], row[SURFACE_WIDTH], row[VOLUME_WIDTH],
            int(row[SET]), ix, iy, iz, ox, oy, oz,
        )  # fmt: skip


@njit(**KERNEL)
def _draw_points(R, tables, stretch, possible, found):  # type: ignore[no-untyped-def]
    """`_draw_far` at the middle of one stretch: found (views, draws, POINT_LOBES + 2)."""
    thread_set, thread, psi0 = int(stretch[SET]), int(stretch[THREAD]), stretch[PSI0]
    for view in range(found.shape[0]):
        ox, oy, oz = grid_view(R, view)
        c, s = stretch[COS], stretch[SIN]
        for k in range(possible.size):
            for m in range(DRAWS):
                u1, u2 = stratum(R, m)
                ix, iy, iz = point_lobe_direction(
                    R, tables.threads[thread], possible[k], c, s, psi0, thread_set,
                    ox, oy, oz, u1, u2,
                )  # fmt: skip
                if abs(iz) > R(1e-6):
                    _describe_point(
                        R, tables, thread_set, thread, c, s, psi0, ix, iy, iz, ox, oy, oz,
                        found[view, k * DRAWS + m],
                    )  # fmt: skip


@njit(**PART)
def _describe_point(R, tables, thread_set, thread, c, s, psi0, ix, iy, iz, ox, oy, oz, found):  # type: ignore[no-untyped-def]
    value = conserving_point_value(R, tables, thread_set, thread, psi0, ix, iy, iz, ox, oy, oz)
    _note(R, tables.opaque, value, found, ix, iy, iz)
    row = tables.threads[thread]
    k = LOBES if iz > R(0) else LOBES + 3
    found[k], found[k + 1], found[k + 2] = stretch_densities(
        R, c, s, psi0, s / c, R(2) * row[GAMMA_SURFACE], R(2) * row[GAMMA_VOLUME], thread_set,
        ix, iy, iz, ox, oy, oz,
    )  # fmt: skip
