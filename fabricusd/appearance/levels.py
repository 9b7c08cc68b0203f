"""Levels `weave` and `thread`: the thread under a point, and the place across it.

`L_o(x) = f_s M P(x)/Q cos theta_i` with `far`'s own `Q`, so the mean over the repeat is `far`; at
level `thread` the two terms are modulated across the width by factors whose mean is 1, so the mean
over the width is `weave`. Both directions above the cloth, else 0; a gap reflects nothing.
Shadowing multiplies the value and is applied by the caller. Source: `docs/model.md` section 4,
[Bisker2011] eq. 5.1.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.appearance.blocks import (
    ACROSS_I,
    ACROSS_O,
    AXIS_I,
    AXIS_O,
    BLOCK,
    BLUE,
    GREEN,
    NORMALIZATION,
    OVERLAP,
    RED,
    SCALE_I,
    SCALE_O,
    UP_I,
    UP_O,
    add_masking,
    node_range,
    prepare,
)
from fabricusd.appearance.far import NOTHING, normalization
from fabricusd.appearance.frame import WARP, WEFT, cos_inclination, unit_azimuth
from fabricusd.appearance.real import INLINE, KERNEL, LEAN, cos, sin
from fabricusd.appearance.segment import across, along_set, seen_along, segment
from fabricusd.appearance.thread_terms import (
    ALBEDO_B,
    ALBEDO_G,
    ALBEDO_R,
    CONSERVING,
    MODEL,
    THESIS,
)

_ROWS = 26
_FOUND = 13 * BLOCK
"""Where the compacted copy of a block's rows starts, and after its nine rows psi0 and w."""
_ANGLE, _ACROSS = _FOUND + 9 * BLOCK, _FOUND + 10 * BLOCK


@njit(**LEAN)
def point_value(R, tables, across_too, thread_set, thread, psi0, w, ix, iy, iz, ox, oy, oz):
    """(r, g, b) on `thread` of `thread_set` at tangent angle psi0 [rad], published models.

    across_too : level `thread` at `w` in [-1, 1] across the visible width; else level `weave`
    """
    none = R(0)
    row = tables.threads[thread]
    if iz <= none or oz <= none or row[MODEL] == R(CONSERVING):
        return none, none, none
    q = normalization(R, tables, ix, iy, iz, ox, oy, oz)
    if q <= R(NOTHING):
        return none, none, none
    a_i, b_i, scale_i, a_o, b_o, scale_o, u = along_set(
        R, thread_set, tables.overlap_precision, ix, iy, iz, ox, oy, oz
    )
    c, s = cos(R, psi0), sin(R, psi0)
    p = seen_along(R, c, s, a_i, iz, scale_i, a_o, oz, scale_o, u)
    surface, volume = _bit_of_thread(
        R, row[MODEL] == R(THESIS), across_too, row, tables.overlap_precision,
        c, s, w, a_i, b_i, iz, a_o, b_o, oz,
    )  # fmt: skip
    p /= q
    surface *= p
    volume *= p
    return (
        surface + volume * row[ALBEDO_R],
        surface + volume * row[ALBEDO_G],
        surface + volume * row[ALBEDO_B],
    )


@njit(**INLINE)
def _bit_of_thread(R, thesis, across_too, row, precision, c, s, w, a_i, b_i, iz, a_o, b_o, oz):
    """`segment`, with the factors across the width where they are asked for."""
    surface, volume = segment(R, thesis, row, precision, c, s, a_i, b_i, iz, a_o, b_o, oz)
    if across_too:
        n_i, n_o = s * a_i + c * iz, s * a_o + c * oz
        on_surface, on_volume = across_at(R, row, w, b_i, n_i, b_o, n_o)
        return surface * on_surface, volume * on_volume
    return surface, volume


@njit(**INLINE)
def across_at(R, row, w, b_i, n_i, b_o, n_o):
    """`across` of two directions' components b and n in the thread frame."""
    sin_i, cos_i = unit_azimuth(R, b_i, n_i, cos_inclination(R, b_i, n_i))
    sin_o, cos_o = unit_azimuth(R, b_o, n_o, cos_inclination(R, b_o, n_o))
    return across(R, row, w, sin_i, cos_i, sin_o, cos_o)


@njit(**KERNEL)
def point_values(R, tables, across_too, sets, threads, psi0, w, wi, wo, out, begin, end):
    """`point_value` at the places from `begin` to before `end`.

    sets, threads : (n,) ints; psi0, w : (n,) real; wi, wo, out : (3, n) real

    Points of one thread are brought together in each block, so that the thread's numbers are
    constants of a loop that LLVM vectorises. A set that is neither weft nor warp is a gap.
    """
    block = np.empty(_ROWS * BLOCK, wi.dtype)
    where = np.empty(BLOCK, np.int32)
    for start in range(begin, end, BLOCK):
        size = min(BLOCK, end - start)
        for x in range(size):
            block[NORMALIZATION + x] = tables.gap * wo[2, start + x]
            block[RED + x] = block[GREEN + x] = block[BLUE + x] = R(0)
        for thread_set in (WEFT, WARP):
            prepare(R, thread_set, tables.overlap_precision, wi, wo, start, size, block)
            first, last = node_range(tables, thread_set)
            for k in range(first, last):
                add_masking(R, tables, k, size, block)
            for thread in range(tables.threads.shape[0]):
                model = tables.threads[thread, MODEL]
                if model == R(CONSERVING):
                    continue
                found = _bring_together(
                    thread_set, thread, sets, threads, psi0, w, start, size, block, where
                )
                if model == R(THESIS):
                    _of_one_thread(R, True, across_too, tables, thread, found, block, where)
                else:
                    _of_one_thread(R, False, across_too, tables, thread, found, block, where)
        for x in range(size):
            q = block[NORMALIZATION + x]
            dark = wi[2, start + x] <= R(0) or wo[2, start + x] <= R(0) or q <= R(NOTHING)
            inverse = R(0) if dark else R(1) / q
            out[0, start + x] = R(0) if dark else block[RED + x] * inverse
            out[1, start + x] = R(0) if dark else block[GREEN + x] * inverse
            out[2, start + x] = R(0) if dark else block[BLUE + x] * inverse


@njit(**INLINE)
def _bring_together(thread_set, thread, sets, threads, psi0, w, start, size, block, where):
    """Copy the block's points that lie on `thread` side by side; their number and old places."""
    found = 0
    for x in range(size):
        if sets[start + x] == thread_set and threads[start + x] == thread:
            where[found] = x
            found += 1
    for row in range(AXIS_I, NORMALIZATION, BLOCK):
        for y in range(found):
            block[_FOUND + row + y] = block[row + where[y]]
    for y in range(found):
        block[_ANGLE + y] = psi0[start + where[y]]
        block[_ACROSS + y] = w[start + where[y]]
    return found


@njit(**INLINE)
def _of_one_thread(R, thesis, across_too, tables, thread, found, block, where):
    """The value without `1/Q` of the points brought together, back to their places."""
    row, precision = tables.threads[thread], tables.overlap_precision
    for y in range(found):
        x = _FOUND + y
        c, s = cos(R, block[_ANGLE + y]), sin(R, block[_ANGLE + y])
        a_i, b_i, iz = block[AXIS_I + x], block[ACROSS_I + x], block[UP_I + x]
        a_o, b_o, oz = block[AXIS_O + x], block[ACROSS_O + x], block[UP_O + x]
        p = seen_along(
            R, c, s, a_i, iz, block[SCALE_I + x], a_o, oz, block[SCALE_O + x], block[OVERLAP + x]
        )
        surface, volume = _bit_of_thread(
            R, thesis, across_too, row, precision, c, s, block[_ACROSS + y],
            a_i, b_i, iz, a_o, b_o, oz,
        )  # fmt: skip
        block[AXIS_I + x], block[ACROSS_I + x] = surface * p, volume * p
    for y in range(found):
        surface, volume = block[_FOUND + AXIS_I + y], block[_FOUND + ACROSS_I + y]
        block[RED + where[y]] = surface + volume * row[ALBEDO_R]
        block[GREEN + where[y]] = surface + volume * row[ALBEDO_G]
        block[BLUE + where[y]] = surface + volume * row[ALBEDO_B]
