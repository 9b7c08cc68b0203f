"""Fit the shares of a mixture's lobes, for the whole cloth and for points of each stretch.

The shares are measured on the values of a law. No closed form has been found for them: `1/Q` alone
changes them too much. On velvet, measured shares reduce the variance from half of that of uniform
directions to less than a tenth.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.sampling.lobes import THREAD_LOBES
from fabricusd.appearance.sampling.mixture import (
    Mixture,
    count_lobes,
    even_density,
    lobe_direction,
    stretch_densities,
)
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
    OF_THREAD,
    STRETCH_COLUMNS,
    SURFACE_WIDTH,
    VOLUME_WIDTH,
    stretch_of,
    stretches_of,
)
from fabricusd.appearance.scattering import columns
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import BLOCK, INLINE, KERNEL, whole
from fabricusd.kernels.unrolled import tuple_writer

Singles = NDArray[np.float32]
FarValues = Callable[[Singles, Singles, Singles], None]
"""(wi, wo, out), each (3, n): writes the law's values at level `far` to out."""
PointValues = Callable[[Singles, Singles, Singles, Singles], None]
"""(stretch, wi, wo, out): writes the law's values at level `weave`, on a thread of the stretch."""

LOWEST = 1e-6
"""A direction whose |N.w| is at most this counts as being on neither side of the cloth."""


def no_mixture(precision: Any, *, sides: int = 1, cosines: int = 0) -> Mixture:
    """The mixture of a law without threads: all directions are uniform."""
    nothing = np.zeros((0, STRETCH_COLUMNS), precision)
    none = np.zeros((ELEVATIONS, AZIMUTHS, 0), precision)
    return Mixture(nothing, none, none, precision(1), sides, 1, cosines)


def fitted_mixture(
    fabric: Fabric,
    threads: NDArray[Any],
    *,
    even: float,
    least: float,
    sides: int,
    opaque: bool,
    cosines: bool,
    far: FarValues,
    at_point: PointValues,
) -> Mixture:
    """The mixture for `fabric` whose shares leave the least variance, in the precision of
    `threads`.

    threads : rows of `pack_threads`
    even, sides, opaque, cosines : see `Mixture`
    least : see `share_fit.best_shares`
    far, at_point : the law's values, in single precision, which suffices for the shares
    """
    R = threads.dtype.type
    rows = stretches_of(fabric)
    if not len(rows) and not cosines:
        return no_mixture(R)
    single: Any = np.float32
    none: Any = np.zeros((ELEVATIONS, AZIMUTHS, 0), single)
    mixture = Mixture(
        rows.astype(single), none, none, single(even), sides, int(opaque), int(cosines)
    )
    possible = _possible(len(rows), mixture)
    shares = best_shares(_noted(mixture, possible, far), possible, even, least)
    # At a point there is a single stretch, whose lobes are as wide as the thread's own. The points
    # of all stretches are fitted together, as if they were further views.
    possible = _possible(1, mixture)
    found = []
    for row in mixture.stretches:
        stretch = row.copy()
        thread = threads[int(row[OF_THREAD])]
        stretch[SURFACE_WIDTH] = thread[columns.SURFACE_WIDTH]
        stretch[VOLUME_WIDTH] = thread[columns.VOLUME_WIDTH]
        one = mixture._replace(stretches=stretch[None])

        def values(wi: Singles, wo: Singles, out: Singles, stretch: Singles = stretch) -> None:
            at_point(stretch, wi, wo, out)

        found.append(_noted(one, possible, values))
    lobes = count_lobes(1, sides, int(cosines))
    at_points: NDArray[np.float64] = np.zeros((0, lobes))
    if found:
        at_points = best_shares(np.concatenate(found), possible, even, least)
    by_view = at_points.reshape(len(rows), VIEWS, lobes).swapaxes(0, 1)
    shape = (ELEVATIONS, AZIMUTHS)
    return mixture._replace(
        stretches=rows.astype(R), shares=shares.reshape(*shape, -1).astype(R),
        point_shares=np.ascontiguousarray(by_view.reshape(*shape, len(rows) * lobes), R),
        even=R(even),
    )  # fmt: skip


def _possible(stretches: int, mixture: Mixture) -> NDArray[np.intp]:
    """Indices of the lobes that may have a share; those below opaque cloth may not."""
    lobes = THREAD_LOBES * stretches
    sides = 1 if mixture.opaque else mixture.sides
    first = mixture.sides * lobes
    return np.array([*range(sides * lobes), *range(first, first + sides * mixture.cosines)], int)


def _noted(mixture: Mixture, possible: NDArray[np.intp], values: FarValues) -> Singles:
    """Records of directions from every possible lobe at every view, as in `share_fit.noted`."""
    R: Any = np.float32
    lobes = count_lobes(len(mixture.stretches), mixture.sides, mixture.cosines)
    found = noted(len(possible), lobes)
    views, draws = found.shape[:2]
    wi, wo, value = (np.empty((3, views * draws), R) for _ in range(3))
    density = np.zeros((lobes, views * draws), R)
    even = np.empty(views * draws, R)
    _draw(R, mixture, possible, views, wi, wo)
    values(wi, wo, value)
    _describe(R, mixture, wi, wo, even, density)
    found[:, :, VALUE] = value.mean(axis=0).reshape(views, draws)
    found[:, :, EVEN] = even.reshape(views, draws)
    found[:, :, LOBES:] = density.reshape(lobes, views, draws).transpose(1, 2, 0)
    height = wi[2] if mixture.sides == 1 else np.abs(wi[2])
    found[(height <= LOWEST).reshape(views, draws)] = 0.0
    return found


@njit(**KERNEL)
def _draw(R, mixture, possible, views, wi, wo):
    """Draw the directions, view by view and lobe by lobe: wi, wo are (3, n)."""
    for view in range(views):
        ox, oy, oz = grid_view(R, view)
        for k in range(possible.size * DRAWS):
            u1, u2 = stratum(R, k % DRAWS)
            ix, iy, iz = lobe_direction(R, mixture, possible[k // DRAWS], ox, oy, oz, u1, u2)
            x = view * possible.size * DRAWS + k
            wi[0, x], wi[1, x], wi[2, x] = ix, iy, iz
            wo[0, x], wo[1, x], wo[2, x] = ox, oy, oz


@njit(**KERNEL)
def _describe(R, mixture, wi, wo, even, density):
    """Compute the densities of the uniform part, (n,), and of all lobes, (lobes, n), initially 0.

    The rows of a block are in a single array, so that LLVM vectorises the loop over it.
    """
    lobes = THREAD_LOBES * mixture.stretches.shape[0]
    block = np.empty((6 + THREAD_LOBES) * BLOCK, np.float32)
    for start in range(0, wi.shape[1], BLOCK):
        size = min(BLOCK, wi.shape[1] - start)
        for row in range(3):
            light, viewer = wi[row][start:], wo[row][start:]
            for x in range(size):
                block[row * BLOCK + x] = light[x]
            for x in range(size):
                block[(3 + row) * BLOCK + x] = viewer[x]
        for y in range(mixture.stretches.shape[0]):
            _describe_block(R, mixture.stretches[y], size, block)
            for lobe in range(THREAD_LOBES):
                at = whole((6 + lobe) * BLOCK)
                for side in range(mixture.sides):
                    into = density[side * lobes + THREAD_LOBES * y + lobe][start:]
                    for x in range(size):
                        ours = (block[2 * BLOCK + x] > R(0)) == (side == 0)
                        into[x] = block[at + x] if ours else R(0)
        for x in range(start, start + size):
            even[x] = even_density(R, mixture, wi[2, x])
            if mixture.cosines != 0:
                side = 0 if wi[2, x] > R(0) else 1
                density[mixture.sides * lobes + side, x] = abs(wi[2, x]) * R(1 / np.pi)


_OUT = 6 * BLOCK
_store = tuple_writer(THREAD_LOBES, BLOCK)


@njit(**INLINE)
def _describe_block(R, row, size, block):
    stretch = stretch_of(row)
    for x in range(size):
        found = stretch_densities(
            R, stretch, block[x], block[BLOCK + x], block[2 * BLOCK + x],
            block[3 * BLOCK + x], block[4 * BLOCK + x], block[5 * BLOCK + x],
        )  # fmt: skip
        _store(block, _OUT + x, found)
