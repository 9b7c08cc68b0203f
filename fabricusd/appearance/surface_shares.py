"""The shares of the lobes of `surface_sampling`, by `share_fit`: of the cloth, and at a point.

`1/Q` moves them too much for any closed form: on velvet the variance falls from half of uniform's
to less than a tenth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.far import far_values
from fabricusd.appearance.levels import point_value
from fabricusd.appearance.real import INLINE, KERNEL, PART
from fabricusd.appearance.share_fit import (
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
from fabricusd.appearance.stretches import (
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
from fabricusd.appearance.surface_sampling import (
    UNIFORM,
    SamplingTables,
    even_density,
    stretch_densities,
    stretch_direction,
)
from fabricusd.appearance.surface_tables import SurfaceTables
from fabricusd.appearance.thread_terms import GAMMA_SURFACE, GAMMA_VOLUME
from fabricusd.fabric import Fabric

LEAST_SHARE = 0.1
"""See `share_fit.best_shares`: grazing views see narrow bright places that a few directions a lobe
miss, and without it satin's variance doubles."""


def sampling_tables(fabric: Fabric, tables: SurfaceTables) -> SamplingTables:
    """Stretches of `fabric` and the shares of their lobes, measured on `tables`."""
    R = tables.nodes.dtype.type
    single: Any = np.float32
    rows = stretches_of(fabric)
    kept = _in_single_precision(tables)
    stretches = rows.astype(single)
    lobes = np.arange(3 * len(rows))
    shares = best_shares(_far_directions(kept, stretches), lobes, UNIFORM, LEAST_SHARE)
    at_points = np.zeros((VIEWS, len(rows), 3))
    for y, stretch in enumerate(stretches):
        found = noted(3, 3)
        _draw_points(single, kept, stretch, found)
        at_points[:, y] = best_shares(found, np.arange(3), UNIFORM, LEAST_SHARE)
    shape = (ELEVATIONS, AZIMUTHS, 3 * len(rows))
    return SamplingTables(
        rows.astype(R), shares.reshape(shape).astype(R), at_points.reshape(shape).astype(R)
    )


def _far_directions(tables: SurfaceTables, stretches: NDArray[np.float32]) -> NDArray[np.float32]:
    """`noted` directions of every lobe at every view, at level `far`."""
    lobes = 3 * len(stretches)
    found = noted(lobes, lobes)
    wi, wo, values = np.zeros((3, 3, found.shape[0] * found.shape[1]), np.float32)
    _draw_far(np.float32, stretches, wi, wo, found)
    # By the law's loop over directions, which takes a fifth of what calls one by one would.
    far_values(np.float32, tables, wi, wo, values, 0, wi.shape[1])
    grey = values.mean(axis=0).reshape(found.shape[:2])
    found[:, :, VALUE] = np.where(found[:, :, EVEN] > 0, grey, 0.0)
    return found


def _in_single_precision(tables: SurfaceTables) -> SurfaceTables:
    """Shares need no more, and one kernel serves both precisions."""
    return tables._replace(
        threads=tables.threads.astype(np.float32),
        smooth=tables.smooth.astype(np.float32),
        nodes=tables.nodes.astype(np.float32),
        gap=np.float32(tables.gap),
        overlap_precision=np.float32(tables.overlap_precision),
    )


@njit(**INLINE)
def _grey(R, value):
    return (value[0] + value[1] + value[2]) * R(1.0 / 3.0)


@njit(**KERNEL)
def _draw_far(R, stretches, wi, wo, found):
    """Directions of every lobe at every view, and the densities of all lobes there.

    wi, wo : (3, views draws) - directions to the light and to the viewer; zeros where that to the
    light is below the cloth. found : (views, draws, lobes + 2), all but VALUE
    """
    for view in range(found.shape[0]):
        ox, oy, oz = grid_view(R, view)
        for k in range(found.shape[1]):
            n = view * found.shape[1] + k
            wo[0, n], wo[1, n], wo[2, n] = ox, oy, oz
            u1, u2 = stratum(R, k % DRAWS)
            row = stretches[k // (3 * DRAWS)]
            ix, iy, iz = stretch_direction(
                R, k // DRAWS % 3, row[COS], row[SIN], row[PSI0], row[TAN], row[SURFACE_WIDTH],
                row[VOLUME_WIDTH], int(row[SET]), ox, oy, oz, u1, u2,
            )  # fmt: skip
            if iz > R(1e-6):
                wi[0, n], wi[1, n], wi[2, n] = ix, iy, iz
                _describe_far(R, stretches, ix, iy, iz, ox, oy, oz, found[view, k])


@njit(**PART)
def _describe_far(R, stretches, ix, iy, iz, ox, oy, oz, found):
    found[EVEN] = even_density(R)
    for y in range(stretches.shape[0]):
        row = stretches[y]
        k = LOBES + 3 * y
        found[k], found[k + 1], found[k + 2] = stretch_densities(
            R, row[COS], row[SIN], row[PSI0], row[TAN], row[SURFACE_WIDTH], row[VOLUME_WIDTH],
            int(row[SET]), ix, iy, iz, ox, oy, oz,
        )  # fmt: skip


@njit(**KERNEL)
def _draw_points(R, tables, stretch, found):
    """`_draw_far` at the middle of one stretch: found (views, draws, 3 + 2)."""
    thread_set, thread, psi0 = int(stretch[SET]), int(stretch[THREAD]), stretch[PSI0]
    c, s, tangent = stretch[COS], stretch[SIN], stretch[TAN]
    surface = R(2) * tables.threads[thread, GAMMA_SURFACE]
    volume = R(2) * tables.threads[thread, GAMMA_VOLUME]
    for view in range(found.shape[0]):
        ox, oy, oz = grid_view(R, view)
        for k in range(found.shape[1]):
            u1, u2 = stratum(R, k % DRAWS)
            ix, iy, iz = stretch_direction(
                R, k // DRAWS, c, s, psi0, tangent, surface, volume, thread_set, ox, oy, oz, u1, u2
            )
            if iz > R(1e-6):
                here = found[view, k]
                here[VALUE] = _grey(
                    R,
                    point_value(
                        R, tables, False, thread_set, thread, psi0, R(0), ix, iy, iz, ox, oy, oz
                    ),
                )
                here[EVEN] = even_density(R)
                here[LOBES], here[LOBES + 1], here[LOBES + 2] = stretch_densities(
                    R, c, s, psi0, tangent, surface, volume, thread_set, ix, iy, iz, ox, oy, oz
                )
