"""Build the horizon table: the elevation of the horizon by place on a thread and azimuth [Max1988].

The texels lie along the visible threads instead of on a raster over the cloth, because a raster
would average across every edge between a high thread and a low one. A texel holds the mean across
the thread: light that goes into a thread leaves it all over its lit side, so no place across it has
a shadow of its own. Each cell has a slot for the thread
on top and, if the coverage shows the set underneath, a second slot for it. Azimuths are evenly
spaced in the diamond angle, which needs no arctangent. `horizon_lookup` reads the table.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP
from fabricusd.appearance.shadow.height import Origin, steepest
from fabricusd.appearance.shadow.neighbourhoods import MOST_KINDS, neighbourhoods
from fabricusd.appearance.weave.compiled import CompiledFabric
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.lookup import crown_on, find, height_on
from fabricusd.cache import kept
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.kernels.cache import fingerprint
from fabricusd.kernels.real import KERNEL, PART
from fabricusd.steps import parts

NO_KINDS = np.zeros((0, 0), np.int32)
"""`Horizon.kinds` of a table that has an entry for each cell."""

AZIMUTHS = 16
TEXELS = 8
"""Texels along a thread in one cell. docs/shadowing.md shows the gain of finer texels."""

ACROSS = 6
"""Places across a thread over which a texel's horizon is averaged."""

KEPT_CELLS = 512
"""Cells from which on a table is kept on disk: fewer are computed within half a second."""

CHUNK = 48
"""Cells that are filled before an interrupt is heard: a fraction of a second."""

SOFTNESS = math.radians(8.0)
"""Width [rad] of the edge of a shadow from the table. Light leaves a thread all over its lit side,
so shadows have no edge: traced tubes are met as well at 8 degrees as at 1, docs/geometry.md."""

LOWEST = math.tan(math.radians(0.25))
"""Slope below which a horizon counts as level: that of a quarter of a degree, half the sun's
disc."""

FEWER_ACROSS, LARGE_LOWEST = 3, math.tan(math.radians(1.0))
"""ACROSS and LOWEST of tables by neighbourhood, whose entries are not exact: a quarter of the
time."""


class Horizon(NamedTuple):
    """A horizon table.

    table : (I, J, slots, along, azimuths) uint8 - sine of the horizon's elevation, with 255 for 1;
        of a repeat of more than MOST_KINDS cells (1, n, slots, along, azimuths), by kind of cell
    kinds : (I, J) int32 - the kind of each cell, see `neighbourhoods`; (0, 0) for the former
    """

    table: NDArray[np.uint8]
    kinds: NDArray[np.int32]


def horizon_table(
    fabric: Fabric,
    cloth: CompiledFabric,
    highest: float,
    azimuths: int,
    texels: int,
) -> Horizon:
    """The horizons of `fabric`.

    cloth : `fabric` in float64

    The table has the period of the threads' *shapes*: types that differ in colour only do not
    lengthen it. A table that takes more than a moment is kept in the user's cache.
    """
    if azimuths < 16 or azimuths % 4:
        raise FabricError("azimuths", f"is {azimuths}; it must be a multiple of 4, at least 16")
    if texels < 2 or texels % 2:
        raise FabricError("texels", f"is {texels}; it must be an even number of at least 2")
    repeat = shape_repeat(fabric)
    shape = (cloth.runs.shape[2], texels, azimuths)
    most = MOST_KINDS // shape[0]
    if math.prod(repeat) <= most:
        kinds, lead, across, lowest = NO_KINDS, repeat, ACROSS, LOWEST
        cells = np.argwhere(np.ones(repeat, bool))
    else:
        around = neighbourhoods(fabric, cloth, repeat, most)
        kinds, cells, lead = around.kinds, around.first, (1, len(around.first))
        across, lowest = FEWER_ACROSS, LARGE_LOWEST
    if highest <= 0:
        return Horizon(np.zeros((*lead, *shape), np.uint8), kinds)

    directions = diamond_directions(azimuths)

    def entries() -> NDArray[np.uint8]:
        made = np.zeros((len(cells), *shape), np.uint8)
        begins = range(0, len(cells), CHUNK)
        for begin in parts(f"horizon table of '{fabric.name}'", begins):
            part = slice(begin, begin + CHUNK)
            _fill(cloth, highest, directions, across, lowest, cells[part], made[part])
        return made

    if len(cells) < KEPT_CELLS:
        return Horizon(entries().reshape(*lead, *shape), kinds)
    key = (fingerprint(), *(x for x in cloth), cells, highest, shape)
    return Horizon(kept("horizons", key, entries).reshape(*lead, *shape), kinds)


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


def diamond_directions(azimuths: int) -> NDArray[np.float64]:
    """(azimuths, 2) unit directions, evenly spaced in the diamond angle, from +U towards +V."""
    quadrant, f = np.divmod(np.arange(azimuths) * (4.0 / azimuths), 1.0)
    x, y = 1.0 - f, f
    for turn in range(1, 4):
        later = quadrant >= turn
        x, y = np.where(later, -y, x), np.where(later, x, y)
    found: NDArray[np.float64] = np.stack((x, y), axis=1) / np.hypot(x, y)[:, None]
    return found


@njit(parallel=True, **KERNEL)
def _fill(cloth, highest, directions, across, lowest, cells, entries):
    """Compute the mean horizon across every texel of `cells` (n, 2), in every direction."""
    count, slots, rows = entries.shape[:3]
    for cell in prange(count):
        for slot in range(slots):
            for row in range(rows):
                _fill_texel(
                    cloth, highest, directions, across, lowest, cells[cell, 0], cells[cell, 1],
                    slot, (row + 0.5) / rows, entries[cell, slot, row],
                )  # fmt: skip


@njit(**KERNEL)
def _fill_texel(cloth, highest, directions, across, lowest, i, j, slot, along, out):
    azimuths = out.size
    total, count = np.zeros(azimuths), 0
    for column in range(across):
        u, v, seen = _texel_centre(cloth, i, j, slot, along, (column + 0.5) / across)
        which, thread, s, w, _, length = find(np.float64, cloth, u, v)
        if not seen or which == GAP or cloth.pile[thread] != 0:
            continue
        count += 1
        crown = crown_on(np.float64, cloth, which, thread, w)
        h = height_on(np.float64, cloth, which, thread, s, length) + crown
        origin = Origin(u, v, which, crown, h)
        for a in range(azimuths):
            k = steepest(cloth, highest, origin, directions[a, 0], directions[a, 1], lowest, False)
            total[a] += k / math.sqrt(1.0 + k * k) if k > lowest else 0.0
    for a in range(azimuths):
        out[a] = np.uint8(255.0 * total[a] / max(count, 1) + 0.5)


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
