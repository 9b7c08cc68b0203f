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

from fabricusd.appearance.far import (
    _AI,
    _AO,
    _BI,
    _BO,
    _BLUE,
    _GREEN,
    _Q,
    _RED,
    _SI,
    _SO,
    _U,
    _ZI,
    _ZO,
    BLOCK,
    NOTHING,
    _add_masking,
    _prepare,
    node_range,
    normalization,
)
from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.real import INLINE, KERNEL, cos, sin
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


@njit(**KERNEL)
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
    surface, volume, sin_phi_i, sin_phi_o, cos_half = segment(
        R, thesis, row, precision, c, s, a_i, b_i, iz, a_o, b_o, oz
    )
    if across_too:
        on_surface, on_volume = across(R, row, w, sin_phi_i, sin_phi_o, cos_half)
        return surface * on_surface, volume * on_volume
    return surface, volume


@njit(**KERNEL)
def point_values(R, tables, across_too, sets, threads, psi0, w, wi, wo, out):
    """`point_value` at every place: sets, threads (n,) ints, psi0, w (n,) real, the rest (3, n).

    Points of one thread are brought together in each block, so that the thread's numbers are
    constants of a loop that LLVM vectorises. A set that is neither weft nor warp is a gap.
    """
    n = wi.shape[1]
    block = np.empty(_ROWS * BLOCK, wi.dtype)
    where = np.empty(BLOCK, np.int32)
    for start in range(0, n, BLOCK):
        size = min(BLOCK, n - start)
        for x in range(size):
            block[_Q + x] = tables.gap * wo[2, start + x]
            block[_RED + x] = block[_GREEN + x] = block[_BLUE + x] = R(0)
        for thread_set in (WEFT, WARP):
            _prepare(R, thread_set, tables.overlap_precision, wi, wo, start, size, block)
            first, last = node_range(tables, thread_set)
            for k in range(first, last):
                _add_masking(R, tables, k, size, block)
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
            q = block[_Q + x]
            dark = wi[2, start + x] <= R(0) or wo[2, start + x] <= R(0) or q <= R(NOTHING)
            inverse = R(0) if dark else R(1) / q
            out[0, start + x] = R(0) if dark else block[_RED + x] * inverse
            out[1, start + x] = R(0) if dark else block[_GREEN + x] * inverse
            out[2, start + x] = R(0) if dark else block[_BLUE + x] * inverse


@njit(**INLINE)
def _bring_together(thread_set, thread, sets, threads, psi0, w, start, size, block, where):
    """Copy the block's points that lie on `thread` side by side; their number and old places."""
    found = 0
    for x in range(size):
        if sets[start + x] == thread_set and threads[start + x] == thread:
            where[found] = x
            found += 1
    for row in range(_AI, _Q, BLOCK):
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
        a_i, b_i, iz = block[_AI + x], block[_BI + x], block[_ZI + x]
        a_o, b_o, oz = block[_AO + x], block[_BO + x], block[_ZO + x]
        p = seen_along(R, c, s, a_i, iz, block[_SI + x], a_o, oz, block[_SO + x], block[_U + x])
        surface, volume = _bit_of_thread(
            R, thesis, across_too, row, precision, c, s, block[_ACROSS + y],
            a_i, b_i, iz, a_o, b_o, oz,
        )  # fmt: skip
        block[_AI + x], block[_BI + x] = surface * p, volume * p
    for y in range(found):
        surface, volume = block[_FOUND + _AI + y], block[_FOUND + _BI + y]
        block[_RED + where[y]] = surface + volume * row[ALBEDO_R]
        block[_GREEN + where[y]] = surface + volume * row[ALBEDO_G]
        block[_BLUE + where[y]] = surface + volume * row[ALBEDO_B]
