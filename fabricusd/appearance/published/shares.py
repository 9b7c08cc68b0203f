"""The shares of the lobes of `surface_sampling`, by `share_fit`: of the cloth, and at a point.

`1/Q` moves them too much for any closed form: on velvet the variance falls from half of uniform's
to less than a tenth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.published.far import far_values
from fabricusd.appearance.published.levels import point_value
from fabricusd.appearance.published.sampling import (
    UNIFORM,
    SamplingTables,
    even_density,
    stretch_densities,
    stretch_direction,
)
from fabricusd.appearance.published.tables import SurfaceTables
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
from fabricusd.kernels.real import INLINE, KERNEL, whole

LEAST_SHARE = 0.1
"""See `share_fit.best_shares`: grazing views see narrow bright places that a few directions a lobe
miss, and without it satin's variance doubles."""

BLOCK = 256
LOWEST = 1e-6
"""Height of a direction up to which it counts as below the cloth."""


def sampling_tables(fabric: Fabric, tables: SurfaceTables) -> SamplingTables:
    """Stretches of `fabric` and the shares of their lobes, measured on `tables`."""
    R = tables.nodes.dtype.type
    single: Any = np.float32
    rows = stretches_of(fabric)
    kept = _in_single_precision(tables)
    stretches = rows.astype(single)
    lobes = np.arange(3 * len(rows))
    shares = best_shares(_drawn_far(kept, stretches), lobes, UNIFORM, LEAST_SHARE)
    # The points of all stretches at once, as views of their own.
    found = np.zeros((len(rows), *noted(3, 3).shape), np.float32)
    for stretch, drawn in zip(stretches, found, strict=True):
        _draw_points(single, kept, stretch, drawn)
    found = found.reshape(-1, *found.shape[2:])
    at_points = best_shares(found, np.arange(3), UNIFORM, LEAST_SHARE)
    at_points = at_points.reshape(len(rows), VIEWS, 3).swapaxes(0, 1)
    shape = (ELEVATIONS, AZIMUTHS, 3 * len(rows))
    return SamplingTables(
        rows.astype(R), shares.reshape(shape).astype(R), at_points.reshape(shape).astype(R)
    )


def _in_single_precision(tables: SurfaceTables) -> SurfaceTables:
    """Shares need no more, and one kernel serves both precisions."""
    return tables._replace(
        threads=tables.threads.astype(np.float32),
        nodes=tables.nodes.astype(np.float32),
        gap=np.float32(tables.gap),
        overlap_precision=np.float32(tables.overlap_precision),
    )


@njit(**INLINE)
def _grey(R, value):
    return (value[0] + value[1] + value[2]) * R(1.0 / 3.0)


def _drawn_far(tables: SurfaceTables, stretches: NDArray[np.float32]) -> NDArray[np.float32]:
    """Directions of every lobe at every view, as `share_fit.noted`: (views, draws, lobes + 2)."""
    R: Any = np.float32
    lobes = 3 * len(stretches)
    found = noted(lobes, lobes)
    views, draws = found.shape[:2]
    wi, wo, value = (np.empty((3, views * draws), np.float32) for _ in range(3))
    density = np.empty((lobes, views * draws), np.float32)
    _draw_far(R, stretches, views, wi, wo)
    far_values(R, tables, wi, wo, value, 0, views * draws)
    _describe_far(R, stretches, wi, wo, density)
    found[:, :, VALUE] = value.mean(axis=0).reshape(views, draws)
    found[:, :, EVEN] = even_density.py_func(R)
    found[:, :, LOBES:] = density.reshape(lobes, views, draws).transpose(1, 2, 0)
    found[(wi[2] <= LOWEST).reshape(views, draws)] = 0.0
    return found


@njit(**KERNEL)
def _draw_far(R, stretches, views, wi, wo):
    """The directions, view by view and lobe by lobe: wi, wo (3, n)."""
    draws = wi.shape[1] // views
    for view in range(views):
        ox, oy, oz = grid_view(R, view)
        for k in range(draws):
            u1, u2 = stratum(R, k % DRAWS)
            row = stretches[k // (3 * DRAWS)]
            ix, iy, iz = stretch_direction(
                R, k // DRAWS % 3, row[COS], row[SIN], row[PSI0], row[TAN], row[SURFACE_WIDTH],
                row[VOLUME_WIDTH], int(row[SET]), ox, oy, oz, u1, u2,
            )  # fmt: skip
            x = view * draws + k
            wi[0, x], wi[1, x], wi[2, x] = ix, iy, iz
            wo[0, x], wo[1, x], wo[2, x] = ox, oy, oz


@njit(**KERNEL)
def _describe_far(R, stretches, wi, wo, density):
    """Densities of all lobes, (lobes, n); a block's rows lie in one array, so that LLVM vectorises
    the loop over it."""
    block = np.empty(9 * BLOCK, np.float32)
    for start in range(0, wi.shape[1], BLOCK):
        size = min(BLOCK, wi.shape[1] - start)
        for row in range(3):
            light, viewer = wi[row][start:], wo[row][start:]
            for x in range(size):
                block[row * BLOCK + x] = light[x]
            for x in range(size):
                block[(3 + row) * BLOCK + x] = viewer[x]
        for y in range(stretches.shape[0]):
            _describe_block(R, stretches[y], size, block)
            for row in range(3):
                into, at = density[3 * y + row][start:], whole((6 + row) * BLOCK)
                for x in range(size):
                    into[x] = block[at + x]


@njit(**INLINE)
def _describe_block(R, row, size, block):
    c, s, psi0, tangent, thread_set = row[COS], row[SIN], row[PSI0], row[TAN], int(row[SET])
    surface, volume = row[SURFACE_WIDTH], row[VOLUME_WIDTH]
    for x in range(size):
        block[6 * BLOCK + x], block[7 * BLOCK + x], block[8 * BLOCK + x] = stretch_densities(
            R, c, s, psi0, tangent, surface, volume, thread_set,
            block[x], block[BLOCK + x], block[2 * BLOCK + x],
            block[3 * BLOCK + x], block[4 * BLOCK + x], block[5 * BLOCK + x],
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
            if iz > R(LOWEST):
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
