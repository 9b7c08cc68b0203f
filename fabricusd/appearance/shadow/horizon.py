"""Build the horizon table: the elevation of the horizon by place on a thread and azimuth [Max1988].

The texels lie on the visible threads instead of on a raster over the cloth, because a raster would
average across every edge between a high thread and a low one. Each cell has a slot for the thread
on top and, if the coverage shows the set underneath, a second slot for it. Azimuths are evenly
spaced in the diamond angle, which needs no arctangent. `horizon_lookup` reads the table.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.shadow.height import Origin, crown_of, steepest
from fabricusd.appearance.shadow.horizon_lookup import horizon_at
from fabricusd.appearance.weave.compiled import CompiledFabric
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.lookup import find, height_on
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import KERNEL, PART

AZIMUTHS = 16
TEXELS = (8, 4)
"""Texels along and across a thread in one cell. docs/shadowing.md shows the gain of finer
texels."""

MOST_BYTES = 2**25
"""Size of the largest horizon table: 256 x 256 cells at the default size, filled in half a
minute."""

ELEVATIONS = 16
"""Number of rows of the table of the mean of `g`."""

MOST_CELLS = 256
"""Largest number of cells over which the mean of `g` is taken."""

LEAST_LIGHT = 0.1
"""Lower bound on the mean of `g`. The mean falls to 0 at the horizon, where `g` over its mean would
be unbounded. A set that lies in the shade of the other except at a few places is not compensated by
brightening those places."""

LOWEST = math.tan(math.radians(0.25))
"""Slope below which a horizon counts as level: that of a quarter of a degree, half the sun's
disc."""


def horizon_table(
    fabric: Fabric,
    cloth: CompiledFabric,
    rounded: int,
    highest: float,
    azimuths: int,
    texels: tuple[int, int],
) -> NDArray[np.uint8] | None:
    """(I, J, slots, along, across, azimuths) sine of the horizon's elevation, with 255 for 1.

    The result is None if the table of the repeat would be larger than MOST_BYTES.

    cloth : `fabric` in float64

    The table has the period of the threads' *shapes*: types that differ in colour only do not
    lengthen it.
    """
    if azimuths < 16 or azimuths % 4:
        raise FabricError("azimuths", f"is {azimuths}; it must be a multiple of 4, at least 16")
    if min(texels) < 2 or texels[0] % 2:
        raise FabricError(
            "texels", f"is {texels}; it must be at least 2 by 2, with an even number along a thread"
        )
    repeat = shape_repeat(fabric)
    slots = cloth.runs.shape[2]
    if math.prod((*repeat, slots, *texels, azimuths)) > MOST_BYTES:
        return None
    table = np.zeros((*repeat, slots, *texels, azimuths), np.uint8)
    if highest > 0:
        cells = np.argwhere(np.ones(repeat, bool))
        entries = table.reshape(-1, *table.shape[2:])
        _fill(cloth, rounded, highest, _diamond_directions(azimuths), cells, entries)
    return table


def shape_repeat(fabric: Fabric) -> tuple[int, int]:
    """Number of ends and of picks after which the height field repeats."""
    shapes = [(t.curve, t.thickness) for t in fabric.thread_list]
    lengths = []
    for count, sequence in (
        (fabric.weave.ends, fabric.warp.sequence),
        (fabric.weave.picks, fabric.weft.sequence),
    ):
        kinds = [shapes.index(shapes[k]) for k in sequence]
        period = next(
            p
            for p in range(1, len(kinds) + 1)
            if len(kinds) % p == 0 and kinds == kinds[:p] * (len(kinds) // p)
        )
        lengths.append(math.lcm(count, period))
    return lengths[0], lengths[1]


def _diamond_directions(azimuths: int) -> NDArray[np.float64]:
    """(azimuths, 2) unit directions, evenly spaced in the diamond angle, from +U towards +V."""
    quadrant, f = np.divmod(np.arange(azimuths) * (4.0 / azimuths), 1.0)
    x, y = 1.0 - f, f
    for turn in range(1, 4):
        later = quadrant >= turn
        x, y = np.where(later, -y, x), np.where(later, x, y)
    found: NDArray[np.float64] = np.stack((x, y), axis=1) / np.hypot(x, y)[:, None]
    return found


@njit(parallel=True, **KERNEL)
def _fill(cloth, rounded, highest, directions, cells, entries):
    """Compute the horizon at the centre of every texel of `cells` (n, 2), in every direction."""
    count, slots, rows, columns, azimuths = entries.shape
    for cell in prange(count):
        i, j = cells[cell, 0], cells[cell, 1]
        for slot in range(slots):
            for row in range(rows):
                for column in range(columns):
                    u, v, seen = _texel_centre(
                        cloth, i, j, slot, (row + 0.5) / rows, (column + 0.5) / columns
                    )
                    if not seen:
                        continue
                    which, thread, s, w, _, length = find(np.float64, cloth, u, v)
                    if which == GAP or cloth.pile[thread] != 0:
                        continue
                    crown = crown_of(np.float64, cloth, rounded, which, thread, w)
                    h = height_on(np.float64, cloth, thread, s, length) + crown
                    origin = Origin(u, v, which, crown, h)
                    for a in range(azimuths):
                        k = steepest(
                            cloth, rounded, highest, origin,
                            directions[a, 0], directions[a, 1], LOWEST, False,
                        )  # fmt: skip
                        sine = k / math.sqrt(1.0 + k * k) if k > LOWEST else 0.0
                        entries[cell, slot, row, column, a] = np.uint8(255.0 * sine + 0.5)


def mean_light(
    fabric: Fabric,
    cloth: CompiledFabric,
    rounded: int,
    highest: float,
    softness: float,
    table: NDArray[np.uint8] | None,
) -> NDArray[np.float64]:
    """(2, ELEVATIONS, azimuths + 1) mean of `g` over the threads of each set, at least LEAST_LIGHT.

    Each place is weighted by the light that it would catch unshadowed, max(n_t.wi, 0). Rows are
    evenly spaced in the square root of the sine of the light's elevation, columns in the diamond
    angle; the last column repeats the first. The mean is taken over at most MOST_CELLS cells of the
    horizon table; if `table` is None, these cells are computed for the purpose.
    """
    repeat = shape_repeat(fabric)
    number = np.arange(math.prod(repeat))
    if len(number) > MOST_CELLS:
        number = np.random.default_rng(0).choice(len(number), MOST_CELLS, replace=False)
    cells = np.stack(np.unravel_index(number, repeat), axis=1)
    if table is None:
        slots = cloth.runs.shape[2]
        entries = np.zeros((len(cells), slots, *TEXELS, AZIMUTHS), np.uint8)
        if highest > 0:
            _fill(cloth, rounded, highest, _diamond_directions(AZIMUTHS), cells, entries)
    else:
        entries = np.ascontiguousarray(table[cells[:, 0], cells[:, 1]])
    azimuths = entries.shape[-1]
    normal, area, sets = _texel_normals(cloth, cells, entries.shape[1:4])
    sine = entries.reshape(-1, azimuths) / 255.0
    # The lowest light is not quite level, because flat threads catch no level light.
    z = np.maximum(np.linspace(0.0, 1.0, ELEVATIONS) ** 2, 1e-3)
    found = np.empty((2, ELEVATIONS, azimuths + 1))
    for a, direction in enumerate(_diamond_directions(azimuths)):
        for row, up in enumerate(z):
            flat = math.sqrt(1.0 - up * up)
            caught = area * np.maximum(normal @ (*(flat * direction), up), 0.0)
            above = up * np.sqrt(1.0 - sine[:, a] ** 2) - flat * sine[:, a]
            t = np.clip(above / softness + 0.5, 0.0, 1.0)
            let = caught * t * t * (3.0 - 2.0 * t)
            for which in (WEFT, WARP):
                total = float(caught[sets == which].sum())
                found[which, row, a] = let[sets == which].sum() / total if total > 0 else 1.0
    # Nothing blocks light from the zenith, even where the soft edge darkens a steep place.
    found[:, -1] = 1.0
    found[:, :, azimuths] = found[:, :, 0]
    return np.maximum(found, LEAST_LIGHT)


def _texel_normals(
    cloth: CompiledFabric, cells: NDArray[np.int64], shape: tuple[int, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """(texels, 3) normals n_t of the threads at the table's texels, and (texels,) areas and
    sets."""
    texels = len(cells) * math.prod(shape)
    psi0, sets, area = np.zeros(texels), np.zeros(texels, np.int64), np.zeros(texels)
    _describe_texels(cloth, cells, shape, psi0, sets, area)
    along, up = np.sin(psi0), np.cos(psi0)
    warp = sets == WARP
    normal = np.stack((np.where(warp, 0.0, along), np.where(warp, along, 0.0), up), axis=1)
    return normal, area, sets


@njit(**KERNEL)
def _describe_texels(cloth, cells, shape, psi0, sets, area):
    """Compute tangent angle [rad], set and area [cells] of each texel; the area is 0 if unseen."""
    slots, rows, columns = shape
    k = 0
    for cell in range(cells.shape[0]):
        i, j = cells[cell, 0], cells[cell, 1]
        top = int(cloth.grid[i % cloth.grid.shape[0], j % cloth.grid.shape[1]])
        width = float(cloth.width[top])
        for slot in range(slots):
            whole = width if slot == 0 else (1.0 - width) * float(cloth.width[1 - top])
            for row in range(rows):
                for column in range(columns):
                    u, v, seen = _texel_centre(
                        cloth, i, j, slot, (row + 0.5) / rows, (column + 0.5) / columns
                    )
                    which, _, _, _, angle, _ = find(np.float64, cloth, u, v)
                    if seen and which != GAP:
                        psi0[k], sets[k], area[k] = angle, which, whole / (rows * columns)
                    k += 1


@njit(**PART)
def _texel_centre(cloth, i, j, slot, along, across):
    """(u, v, seen): weave coordinates of a place on a slot's thread, and whether it is visible."""
    top = int(cloth.grid[i % cloth.grid.shape[0], j % cloth.grid.shape[1]])
    width = float(cloth.width[top])
    if slot == 0:
        p, q = along, 0.5 + width * (across - 0.5)
        seen = width > 0.0
    else:
        q = along * (1.0 - width)
        q = q if q < 0.5 * (1.0 - width) else q + width
        p = 0.5 + float(cloth.width[1 - top]) * (across - 0.5)
        seen = width < 1.0 and cloth.width[1 - top] > 0.0
    if top == WARP:
        return i + q, j + p, seen
    return i + p, j + q, seen


@njit(parallel=True, **KERNEL)
def _compare(cloth, rounded, highest, table, uv, angle, out):
    """Compute the table's elevation minus that of the march [rad]; NaN in gaps and on pile."""
    for k in prange(uv.shape[0]):
        which, thread, s, w, _, length = find(np.float64, cloth, uv[k, 0], uv[k, 1])
        out[k] = np.nan
        if which != GAP and cloth.pile[thread] == 0:
            x, y = math.cos(angle[k]), math.sin(angle[k])
            crown = crown_of(np.float64, cloth, rounded, which, thread, w)
            h = height_on(np.float64, cloth, thread, s, length) + crown
            origin = Origin(uv[k, 0], uv[k, 1], which, crown, h)
            slope = steepest(cloth, rounded, highest, origin, x, y, LOWEST, False)
            sine = horizon_at(np.float64, cloth, table, uv[k, 0], uv[k, 1], which, x, y)
            out[k] = math.asin(min(1.0, sine)) - math.atan(slope)


def horizon_error(
    cloth: CompiledFabric, rounded: int, highest: float, table: NDArray[np.uint8]
) -> float:
    """Softness [rad] that hides the table's error: twice the median error, at least 1 degree.

    The error of the elevation is measured against the march at fixed places. The median is used
    because, at the foot of a thread, every table is wrong by a right angle over a vanishing width.
    """
    least = math.radians(1.0)
    if not highest > 0:
        return least
    rng = np.random.default_rng(0)
    uv = rng.random((2048, 2)) * table.shape[:2]
    error = np.empty(len(uv))
    _compare(cloth, rounded, highest, table, uv, rng.random(len(uv)) * 2 * math.pi, error)
    seen: Any = error[np.isfinite(error)]
    return max(least, 2.0 * float(np.median(np.abs(seen)))) if seen.size else least
