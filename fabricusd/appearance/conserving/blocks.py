"""Evaluate the conserving law for many pairs of directions at a time, in loops LLVM vectorises.

This computes `multiple.conserving_value` and `levels.conserving_level_value` with the loop over
pairs innermost. Tables cannot be read
in a vectorised loop, since LLVM would have to prove that no store changes them, so what they hold
is first copied to rows of the block, which is a single array (`published.blocks` says why).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.appearance.conserving.grid import cell, share_in, side_in
from fabricusd.appearance.conserving.levels import share_of_closed
from fabricusd.appearance.conserving.single import NODE_COS, NODE_SIN, NODE_WEIGHT
from fabricusd.appearance.frame import cos_inclination, to_thread
from fabricusd.appearance.scattering.across import across_at
from fabricusd.appearance.scattering.columns import (
    ALBEDO_B,
    ALBEDO_G,
    ALBEDO_R,
    CONSTANTS,
    LAW,
    MODEL,
)
from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.appearance.scattering.terms import (
    conserving_position,
    conserving_read,
    conserving_terms_read,
)
from fabricusd.appearance.weave.coverage import WARP, WEFT
from fabricusd.fabric import PILE_ANGLE
from fabricusd.kernels.choice import for_each
from fabricusd.kernels.real import BLOCK, INLINE, KERNEL, PART, as_part, cos, index, sin, whole
from fabricusd.kernels.unrolled import tuple_reader

_STEEPEST_COS = math.cos(PILE_ANGLE)

# Rows of a block. For the light and for the viewer: the direction, the side that it is on as 1 or
# -1, the area of the facets that see it, what the thread's tables hold for it, and its cell of the
# table of sides with the place in it. Then the sums over the facets, and the factors of the pair.
_X, _Y, _Z, _SIDE, _SEEN, _FIRST, _SECOND, _ROW, _COLUMN, _T, _U = (
    row * BLOCK for row in range(11)
)
_LIGHT, _VIEWER = 0, 11 * BLOCK
_SURFACE, _RED, _GREEN, _BLUE, _ON_SURFACE, _ON_VOLUME, _LOST = (
    row * BLOCK for row in range(22, 29)
)
ROWS = 29
# At a point also: its set, its tangent angle, the position across the thread, its share of the
# light that threads scatter, and the columns of its thread.
_WARP, _COS, _SIN, _ACROSS, _SHARE, _THREAD = (row * BLOCK for row in range(ROWS, ROWS + 6))
_POINT_ROWS = ROWS + 5 + CONSTANTS

_row_at = tuple_reader(CONSTANTS, BLOCK)
"""Called with (block, _THREAD + x): the columns of the point's thread, like a row of the table."""


@njit(**KERNEL)
def conserving_far_values(R, tables, wi, wo, out, begin, end):
    """`conserving_value` of the pairs from `begin` to `end` - 1: wi, wo, out are (3, n) real."""
    block = np.empty(ROWS * BLOCK, wi.dtype)
    for start in range(begin, end, BLOCK):
        size = min(BLOCK, end - start)
        _load(R, wi, _LIGHT, start, size, block)
        _load(R, wo, _VIEWER, start, size, block)
        for x in range(size):
            block[_SURFACE + x] = block[_RED + x] = block[_GREEN + x] = block[_BLUE + x] = R(0)
        _add_sets(R, True, tables, size, block)
        _between_sides(R, tables, size, block)
        _finish(R, tables, R(1), out, start, size, block)


_far_values = as_part(conserving_far_values)


@njit(**KERNEL)
def conserving_point_values(R, tables, across_too, places, wi, wo, out, begin, end):
    """`conserving_level_value` at the n `Places` from `begin` to `end` - 1: wi, wo, out are (3, n).

    across_too : evaluate level `thread`, not level `weave`
    """
    block, gaps = np.empty(_POINT_ROWS * BLOCK, wi.dtype), np.empty((3, 3, BLOCK), wi.dtype)
    for start in range(begin, end, BLOCK):
        size = min(BLOCK, end - start)
        _load(R, wi, _LIGHT, start, size, block)
        _load(R, wo, _VIEWER, start, size, block)
        _add_sets(R, False, tables, size, block)
        _copy_threads(R, tables, places, start, size, block)
        _read_own(R, tables, places, start, _LIGHT, size, block)
        _read_own(R, tables, places, start, _VIEWER, size, block)
        _scatter_at(R, across_too, size, block)
        _between_sides(R, tables, size, block)
        _finish(R, tables, max(tables.covered, R(1e-30)), out, start, size, block)
        count = _share_with_gaps(R, tables, places, out, start, size, block)
        if count > 0:
            # In a gap, what does not pass is scattered as by the whole repeat.
            _gather_gaps(wi, wo, start, size, block, gaps)
            _far_values(R, tables, gaps[0], gaps[1], gaps[2], 0, count)
            _scatter_gaps(R, tables, out, start, size, block, gaps)


@njit(**PART)
def _copy_threads(R, tables, places, start, size, block):
    """Copy what each point's place says, and the numbers of its thread."""
    for x in range(size):
        k = index(start, x)
        on_thread = places.sets[k] <= WARP
        row = tables.threads[np.uintp(places.threads[k]) if on_thread else np.uintp(0)]
        block[_WARP + x] = R(1) if places.sets[k] == WARP else R(0)
        block[_ACROSS + x] = places.w[k]
        for column in range(CONSTANTS):
            block[_THREAD + column * BLOCK + x] = row[column]
        scatters = on_thread and row[LAW] == R(CONSERVING)
        block[_SHARE + x] = R(1) if scatters else R(0)
    if places.shade.size > 0:
        for x in range(size):
            for column in range(ALBEDO_R, ALBEDO_B + 1):
                block[_THREAD + column * BLOCK + x] *= R(places.shade[index(start, x)])
    for x in range(size):
        angle = min(max(places.psi0[index(start, x)], R(-PILE_ANGLE)), R(PILE_ANGLE))
        block[_COS + x], block[_SIN + x] = cos(R, angle), sin(R, angle)


@njit(**INLINE)
def _in_own(R, block, at, x):
    """A direction in the frame of the point's own thread, without a branch."""
    warp, c, s = block[_WARP + x], block[_COS + x], block[_SIN + x]
    dx, dy, dz = block[at + _X + x], block[at + _Y + x], block[at + _Z + x]
    along, across = warp * dy + (R(1) - warp) * dx, (R(1) - warp) * dy - warp * dx
    return c * along - s * dz, across, s * along + c * dz


@njit(**PART)
def _read_own(R, tables, places, start, at, size, block):
    """Read the tables of each point's thread at the inclination of a direction."""
    for x in range(size):
        _, b, n = _in_own(R, block, at, x)
        model = int(block[_THREAD + MODEL * BLOCK + x])
        block[at + _FIRST + x] = conserving_position(R, model, cos_inclination(R, b, n))
    for x in range(size):
        row = tables.threads[np.uintp(places.threads[index(start, x)])]
        block[at + _FIRST + x], block[at + _SECOND + x] = conserving_read(
            R, int(row[MODEL]), row, block[at + _FIRST + x]
        )


@njit(**PART)
def _scatter_at(R, across_too, size, block):
    """Compute what each point's thread scatters, in place of the sums over the facets."""
    for x in range(size):
        row = _row_at(block, _THREAD + x)
        t_i, b_i, n_i = _in_own(R, block, _LIGHT, x)
        t_o, b_o, n_o = _in_own(R, block, _VIEWER, x)
        seen = max(R(0), block[_SIDE + x] * n_i) * max(R(0), block[_VIEWER + _SIDE + x] * n_o)
        surface, volume = conserving_terms_read(
            R, row, block[_FIRST + x], block[_SECOND + x], block[_VIEWER + _FIRST + x],
            block[_VIEWER + _SECOND + x],
            t_i, b_i, n_i, t_o, b_o, n_o,
        )  # fmt: skip
        seen = seen * block[_SHARE + x] / max(block[_COS + x], R(_STEEPEST_COS))
        if across_too:
            on_surface, on_volume = across_at(R, row, block[_ACROSS + x], b_i, n_i, b_o, n_o)
            surface, volume = surface * on_surface, volume * on_volume
        volume *= seen
        block[_SURFACE + x] = seen * surface
        block[_RED + x] = volume * row[ALBEDO_R]
        block[_GREEN + x] = volume * row[ALBEDO_G]
        block[_BLUE + x] = volume * row[ALBEDO_B]


@njit(**INLINE)
def _share_of_gaps(R, tables, at, x, block):
    """`levels.share_of_gaps` of a direction."""
    open_to_it = R(1) - tables.covered
    if tables.gap.shape[0] > 0:
        row, column = whole(int(block[at + _ROW + x])), whole(int(block[at + _COLUMN + x]))
        found = share_in(R, tables.gap, row, column, block[at + _T + x], block[at + _U + x])
        open_to_it = min(R(1), found)
    return share_of_closed(R, tables, open_to_it)


@njit(**PART)
def _share_with_gaps(R, tables, places, out, start, size, block):
    """Give the threads their share of the scattered light, and find the points in gaps.

    The share of such a point is left in the row _SHARE. Returns how many have one.
    """
    found = 0
    for x in range(size):
        k = index(start, x)
        on_thread = places.sets[k] <= WARP
        in_gaps = R(0)
        if tables.covered < R(1):
            in_gaps = min(
                _share_of_gaps(R, tables, _LIGHT, x, block),
                _share_of_gaps(R, tables, _VIEWER, x, block),
            )
        keep = R(1) - in_gaps if on_thread else R(0)
        for channel in range(3):
            out[channel, k] *= keep
        block[_SHARE + x] = R(0) if on_thread else in_gaps
        if not on_thread and in_gaps > R(0):
            found += 1
    return found


@njit(**PART)
def _gather_gaps(wi, wo, start, size, block, gaps):
    """Copy the directions of points in gaps that scatter light: gaps is (3, 3, BLOCK)."""
    n = 0
    for x in range(size):
        if block[_SHARE + x] > 0:
            k = index(start, x)
            for row in range(3):
                gaps[0, row, n], gaps[1, row, n] = wi[row, k], wo[row, k]
            n += 1


@njit(**PART)
def _scatter_gaps(R, tables, out, start, size, block, gaps):
    """Write the values of the points of `_gather_gaps`."""
    n, bare = 0, max(R(1) - tables.covered, R(1e-30))
    for x in range(size):
        if block[_SHARE + x] > R(0):
            for channel in range(3):
                value = gaps[2, channel, n] * block[_SHARE + x] / bare
                out[channel, index(start, x)] = value
            n += 1


@njit(**INLINE)
def _load(R, w, at, start, size, block):
    for x in range(size):
        k = index(start, x)
        z = w[2, k]
        block[at + _X + x], block[at + _Y + x], block[at + _Z + x] = w[0, k], w[1, k], z
        block[at + _SIDE + x] = R(1) if z > R(0) else R(-1)
        block[at + _SEEN + x] = R(0)


@njit(**INLINE)
def _in_thread(R, thread_set, c, s, block, at, x):
    """A direction in the frame of a thread whose set is a constant."""
    return to_thread(
        R, thread_set, c, s, block[at + _X + x], block[at + _Y + x], block[at + _Z + x]
    )


@njit(**INLINE)
def _add_set(R, thread_set, scattered, tables, size, block):
    """Add the facets of one set, and what they scatter if `scattered`."""
    first, last = 0, tables.warp_start
    if thread_set == WARP:
        first, last = tables.warp_start, tables.nodes.shape[0]
    for k in range(first, last):
        c, s = tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN]
        weight = tables.nodes[k, NODE_WEIGHT]
        row = tables.threads[tables.node_thread[k]]
        for x in range(size):
            _, _, n_i = _in_thread(R, thread_set, c, s, block, _LIGHT, x)
            _, _, n_o = _in_thread(R, thread_set, c, s, block, _VIEWER, x)
            block[_SEEN + x] += weight * max(R(0), block[_SIDE + x] * n_i)
            block[_VIEWER + _SEEN + x] += weight * max(R(0), block[_VIEWER + _SIDE + x] * n_o)
        if not scattered or tables.scatters[k] == 0:
            continue
        _read(R, thread_set, c, s, row, _LIGHT, size, block)
        _read(R, thread_set, c, s, row, _VIEWER, size, block)
        red, green, blue = row[ALBEDO_R], row[ALBEDO_G], row[ALBEDO_B]
        for x in range(size):
            t_i, b_i, n_i = _in_thread(R, thread_set, c, s, block, _LIGHT, x)
            t_o, b_o, n_o = _in_thread(R, thread_set, c, s, block, _VIEWER, x)
            seen_i = weight * max(R(0), block[_SIDE + x] * n_i)
            seen = seen_i * max(R(0), block[_VIEWER + _SIDE + x] * n_o)
            surface, volume = conserving_terms_read(
                R, row, block[_FIRST + x], block[_SECOND + x], block[_VIEWER + _FIRST + x],
                block[_VIEWER + _SECOND + x],
                t_i, b_i, n_i, t_o, b_o, n_o,
            )  # fmt: skip
            surface, volume = seen * surface, seen * volume
            block[_SURFACE + x] += surface
            block[_RED + x] += volume * red
            block[_GREEN + x] += volume * green
            block[_BLUE + x] += volume * blue


_add_sets = for_each(_add_set, (WEFT, WARP))


@njit(**PART)
def _read(R, thread_set, c, s, row, at, size, block):
    """Read the thread's tables at the inclination of every direction."""
    model = int(row[MODEL])
    for x in range(size):
        _, b, n = _in_thread(R, thread_set, c, s, block, at, x)
        block[at + _FIRST + x] = conserving_position(R, model, cos_inclination(R, b, n))
    # A loop of its own: LLVM does not vectorise what reads a table at places that it computes.
    for x in range(size):
        block[at + _FIRST + x], block[at + _SECOND + x] = conserving_read(
            R, model, row, block[at + _FIRST + x]
        )


@njit(**PART)
def _find_cells(R, rows, columns, at, size, block):
    """Find every direction's cell of the table of sides."""
    for x in range(size):
        side = block[at + _SIDE + x]
        row, column, t, u = cell(
            R, rows, columns,
            side * block[at + _X + x], side * block[at + _Y + x], side * block[at + _Z + x],
        )  # fmt: skip
        block[at + _ROW + x], block[at + _COLUMN + x] = R(row), R(column)
        block[at + _T + x], block[at + _U + x] = t, u


@njit(**INLINE)
def _side_of(R, sides, side, at, x, block):
    row, column = whole(int(block[at + _ROW + x])), whole(int(block[at + _COLUMN + x]))
    return side_in(R, sides, side, row, column, block[at + _T + x], block[at + _U + x])


@njit(**PART)
def _between_sides(R, tables, size, block):
    """Compute `multiple.between_sides`, without the cosine, for all pairs."""
    sides = tables.sides
    for x in range(size):
        block[_ON_SURFACE + x] = block[_ON_VOLUME + x] = R(1)
        block[_LOST + x] = R(0)
    rows, columns = tables.gap.shape
    if rows == 0:
        return
    _find_cells(R, rows, columns, _LIGHT, size, block)
    _find_cells(R, rows, columns, _VIEWER, size, block)
    if sides.shape[1] == 0:
        return
    for x in range(size):
        side = 0 if block[_SIDE + x] == block[_VIEWER + _SIDE + x] else 1
        surface_i, volume_i, lost_i = _side_of(R, sides, side, _LIGHT, x, block)
        surface_o, volume_o, lost_o = _side_of(R, sides, side, _VIEWER, x, block)
        block[_ON_SURFACE + x] = surface_i * surface_o
        block[_ON_VOLUME + x] = volume_i * volume_o
        block[_LOST + x] = lost_i * lost_o


@njit(**PART)
def _finish(R, tables, spread, out, start, size, block):
    """Write the values of a block to out (3, n); what is scattered more than once, over `spread`.

    spread : the share of the cloth's area that the light is spread over
    """
    covered = max(tables.covered, R(1e-30))
    bare = tables.covered == R(0)
    for channel in range(3):
        own, other = tables.strength[0, channel], tables.strength[1, channel]
        for x in range(size):
            up_i, up_o = abs(block[_Z + x]), abs(block[_VIEWER + _Z + x])
            same = block[_SIDE + x] == block[_VIEWER + _SIDE + x]
            dark = min(up_i, up_o) <= R(0)
            # G1/|N.w| of both directions, times |N.wi|: see `single.visible`.
            area_i = max(max(up_i, block[_SEEN + x] / covered), R(1e-30))
            area_o = max(max(up_o, block[_VIEWER + _SEEN + x] / covered), R(1e-30))
            scale = up_i / (area_i * area_o)
            shut = dark or bare or (tables.opaque != 0 and not same)
            once = block[_ON_SURFACE + x] * block[_SURFACE + x]
            once += block[_ON_VOLUME + x] * block[_RED + channel * BLOCK + x]
            more = block[_LOST + x] * up_i * (own if same else other) / spread
            once = R(0) if shut else scale * once
            out[channel, index(start, x)] = once + (R(0) if dark else more)
