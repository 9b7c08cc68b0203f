"""The horizon table: elevation of the horizon by place on a thread and azimuth, [Max1988].

Texels lie on the visible threads, not on a raster over the cloth: a raster would average across
every edge between a high thread and a low one. A cell has a slot for the thread on top and, where
the coverage shows the set underneath, one for it. Azimuths are even in the diamond angle, which
needs no arctangent. `horizon_lookup` reads the table.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.compiled import CompiledFabric
from fabricusd.appearance.coverage import GAP
from fabricusd.appearance.frame import WARP
from fabricusd.appearance.height import crown_of, steepest
from fabricusd.appearance.horizon_lookup import horizon_at
from fabricusd.appearance.real import KERNEL, LEAN
from fabricusd.appearance.weave import find, height_on
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

AZIMUTHS = 16
TEXELS = (8, 4)
"""Texels along and across a thread in one cell. See docs/shadowing.md for what finer ones bring."""

MOST_BYTES = 2**25
"""Largest horizon table, 256 x 256 cells at the usual size: half a minute's work to fill."""

LOWEST = math.tan(math.radians(0.25))
"""Slope below which a horizon counts as level: half the sun's disc."""


def horizon_table(
    fabric: Fabric,
    cloth: CompiledFabric,
    rounded: int,
    highest: float,
    azimuths: int,
    texels: tuple[int, int],
) -> NDArray[np.uint8] | None:
    """(I, J, slots, along, across, azimuths) sine of the horizon's elevation, 255 for 1.

    None for a repeat whose table would be larger than MOST_BYTES.

    cloth : `fabric` in float64. The table repeats as the threads' *shapes* do: types that differ in
    colour alone do not lengthen it.
    """
    if azimuths < 16 or azimuths % 4:
        raise FabricError("azimuths", f"is {azimuths}; it must be a multiple of 4, at least 16")
    if min(texels) < 2:
        raise FabricError("texels", f"is {texels}; it must be at least 2 by 2")
    repeat = shape_repeat(fabric)
    slots = 1 if cloth.under == GAP else 2
    if math.prod((*repeat, slots, *texels, azimuths)) > MOST_BYTES:
        return None
    table = np.zeros((*repeat, slots, *texels, azimuths), np.uint8)
    if highest > 0:
        _fill(cloth, rounded, highest, _diamond_directions(azimuths), table)
    return table


def shape_repeat(fabric: Fabric) -> tuple[int, int]:
    """Ends and picks after which the height field repeats."""
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
    """(azimuths, 2) unit directions, even in the diamond angle from +U over +V."""
    quadrant, f = np.divmod(np.arange(azimuths) * (4.0 / azimuths), 1.0)
    x, y = 1.0 - f, f
    for turn in range(1, 4):
        later = quadrant >= turn
        x, y = np.where(later, -y, x), np.where(later, x, y)
    found: NDArray[np.float64] = np.stack((x, y), axis=1) / np.hypot(x, y)[:, None]
    return found


@njit(parallel=True, **KERNEL)
def _fill(cloth, rounded, highest, directions, table):
    """The horizon at the centre of every texel, in every direction."""
    ends, picks, slots, rows, columns, azimuths = table.shape
    for cell in prange(ends * picks):
        i, j = cell // picks, cell % picks
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
                    for a in range(azimuths):
                        k = steepest(
                            cloth, rounded, highest, u, v, which, crown, h,
                            directions[a, 0], directions[a, 1], LOWEST, False,
                        )  # fmt: skip
                        sine = k / math.sqrt(1.0 + k * k) if k > LOWEST else 0.0
                        table[i, j, slot, row, column, a] = np.uint8(255.0 * sine + 0.5)


@njit(**LEAN)
def _texel_centre(cloth, i, j, slot, along, across):
    """Weave coordinates of a place on a slot's thread, and whether that thread is seen at all."""
    top = int(cloth.grid[i % cloth.grid.shape[0], j % cloth.grid.shape[1]])
    width = float(cloth.width[top])
    if slot == 0:
        p, q = along, 0.5 + width * (across - 0.5)
        seen = width > 0.0
    else:
        q = along * (1.0 - width)
        q = q if q < 0.5 * (1.0 - width) else q + width
        p = 0.5 + float(cloth.under_width) * (across - 0.5)
        seen = cloth.under == 1 - top and width < 1.0
    if top == WARP:
        return i + q, j + p, seen
    return i + p, j + q, seen


@njit(parallel=True, **KERNEL)
def _compare(cloth, rounded, highest, table, uv, angle, out):
    """Elevation of the table minus that of the march [rad]; NaN where nothing casts shadows."""
    for k in prange(uv.shape[0]):
        which, thread, s, w, _, length = find(np.float64, cloth, uv[k, 0], uv[k, 1])
        out[k] = np.nan
        if which != GAP and cloth.pile[thread] == 0:
            x, y = math.cos(angle[k]), math.sin(angle[k])
            crown = crown_of(np.float64, cloth, rounded, which, thread, w)
            h = height_on(np.float64, cloth, thread, s, length) + crown
            slope = steepest(
                cloth, rounded, highest, uv[k, 0], uv[k, 1], which, crown, h, x, y, LOWEST, False
            )  # fmt: skip
            sine = horizon_at(np.float64, cloth, table, uv[k, 0], uv[k, 1], which, x, y)
            out[k] = math.asin(min(1.0, sine)) - math.atan(slope)


def horizon_error(
    cloth: CompiledFabric, rounded: int, highest: float, table: NDArray[np.uint8]
) -> float:
    """How wide the table's own edge is [rad]: median error of its elevation, at least 1 degree.

    Measured against the march at fixed places; the median, because at the foot of a thread every
    table is wrong by a right angle on a stretch of no width.
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
