"""The horizon table: elevation of the horizon by place on a thread and azimuth, [Max1988].

Texels lie on the visible threads, not on a raster over the cloth: a raster would average across
every edge between a high thread and a low one. A cell has a slot for the thread on top and, where
the coverage shows the set underneath, one for it. Azimuths are even in the diamond angle
`y/(|x| + |y|)`, quadrant by quadrant, which needs no arctangent.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.compiled import CompiledFabric
from fabricusd.appearance.coverage import GAP, WARP
from fabricusd.appearance.height import crown_of, steepest
from fabricusd.appearance.real import INLINE, KERNEL, LEAN
from fabricusd.appearance.weave import find, height_on, wrap
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

AZIMUTHS = 16
TEXELS = (8, 4)
"""Texels along and across a thread in one cell. See docs/shadowing.md for what finer ones bring."""

MOST_BYTES = 2**29
"""Largest horizon table. A jacquard of a million cells still fits; beyond, `traced` needs none."""

LOWEST = math.tan(math.radians(0.25))
"""Slope below which a horizon counts as level: half the sun's disc."""


def horizon_table(
    fabric: Fabric,
    cloth: CompiledFabric,
    rounded: int,
    highest: float,
    azimuths: int,
    texels: tuple[int, int],
) -> NDArray[np.uint8]:
    """(I, J, slots, along, across, azimuths) sine of the horizon's elevation, 255 for 1.

    cloth : `fabric` in float64. The table repeats as the threads' *shapes* do: types that differ in
    colour alone do not lengthen it.
    """
    if azimuths < 16 or azimuths % 4:
        raise FabricError("azimuths", f"is {azimuths}; it must be a multiple of 4, at least 16")
    if min(texels) < 2:
        raise FabricError("texels", f"is {texels}; it must be at least 2 by 2")
    repeat = shape_repeat(fabric)
    slots = 1 if cloth.under == GAP else 2
    size = math.prod((*repeat, slots, *texels, azimuths))
    if size > MOST_BYTES:
        raise FabricError(
            "shadow",
            f"horizon would take a table of {size / 1e9:.3g} GB for a repeat of "
            f"{repeat[0]} x {repeat[1]} cells; use 'traced' or 'peak', which need none",
        )
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
def _fill(cloth, rounded, highest, directions, table):  # type: ignore[no-untyped-def]
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
def _texel_centre(cloth, i, j, slot, along, across):  # type: ignore[no-untyped-def]
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


@njit(**INLINE)
def diamond(R, x, y):  # type: ignore[no-untyped-def]
    """Azimuth of (x, y) from 0 to 4: one per quadrant, linear in y/(|x| + |y|) inside it."""
    whole = abs(x) + abs(y)
    if y >= R(0):
        return y / whole if x >= R(0) else R(1) - x / whole
    return R(2) - y / whole if x < R(0) else R(3) + x / whole


@njit(**INLINE)
def _cell_of_texels(R, place, count):  # type: ignore[no-untyped-def]
    """Lower of the two texels around `place` in [0, 1], and the share of the upper one."""
    x = max(R(0), min(place * R(count) - R(0.5), R(count - 1)))
    k = min(int(x), count - 2)
    return k, x - R(k)


@njit(**INLINE)
def _between(R, table, i, j, slot, row, column, first, second, c):  # type: ignore[no-untyped-def]
    """A texel's horizon between two azimuths, c of the way from the first."""
    low = R(table[i, j, slot, row, column, first])
    return low + (R(table[i, j, slot, row, column, second]) - low) * c


@njit(**INLINE)
def horizon_sine(R, cloth, table, u, v, which, x, y):  # type: ignore[no-untyped-def]
    """Sine of the horizon's elevation at (u, v) on the thread of set `which` towards (x, y)."""
    end, pick = math.floor(u), math.floor(v)
    i, j = wrap(end, table.shape[0]), wrap(pick, table.shape[1])
    p, q = R(u - end), R(v - pick)
    top = which
    if table.shape[2] > 1:
        top = int(cloth.grid[wrap(end, cloth.grid.shape[0]), wrap(pick, cloth.grid.shape[1])])
    if top == WARP:
        p, q = q, p
    width = cloth.width[top]
    slot = 0
    if which == top:
        along, across = p, (q - R(0.5)) / width + R(0.5)
    else:
        slot = 1
        seen = q if q < R(0.5) else q - width
        along, across = seen / (R(1) - width), (p - R(0.5)) / cloth.under_width + R(0.5)
    row, a = _cell_of_texels(R, along, table.shape[3])
    column, b = _cell_of_texels(R, across, table.shape[4])
    azimuths = table.shape[5]
    turn = diamond(R, x, y) * R(0.25 * azimuths)
    first = min(int(turn), azimuths - 1)
    c = turn - R(first)
    second = first + 1 if first + 1 < azimuths else 0
    here = _between(R, table, i, j, slot, row, column, first, second, c)
    beside = _between(R, table, i, j, slot, row, column + 1, first, second, c)
    ahead = _between(R, table, i, j, slot, row + 1, column, first, second, c)
    both = _between(R, table, i, j, slot, row + 1, column + 1, first, second, c)
    near = here + (beside - here) * b
    far = ahead + (both - ahead) * b
    return (near + (far - near) * a) * R(1.0 / 255.0)


@njit(parallel=True, **KERNEL)
def _compare(cloth, rounded, highest, table, uv, angle, out):  # type: ignore[no-untyped-def]
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
            sine = horizon_sine(np.float64, cloth, table, uv[k, 0], uv[k, 1], which, x, y)
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
