"""Evaluate the published law at levels `weave` and `thread`: at a point of one thread.

`L_o(x) = f_s M P(x)/Q cos theta_i` with the same `Q` as level `far`, so the mean over the repeat is
the value at level `far`. At level `thread` the two terms are modulated across the width by factors
with a mean of 1, so the mean over the width is the value at level `weave`. The value is 0 unless
both directions are above the cloth; a gap reflects nothing. Shadowing multiplies the value and is
applied by the caller. Source: `docs/model.md` section 4, [Bisker2011] eq. 5.1.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.published.blocks import (
    ACROSS_I,
    ACROSS_O,
    AXIS_I,
    AXIS_O,
    BLUE,
    GREEN,
    NORMALIZATION,
    NOTHING,
    OVERLAP,
    RED,
    SCALE_I,
    SCALE_O,
    UP_I,
    UP_O,
    add_masking,
    divide,
    prepare,
)
from fabricusd.appearance.published.far import normalization
from fabricusd.appearance.published.segment import along_set, seen_along, segment
from fabricusd.appearance.scattering.across import across_at
from fabricusd.appearance.scattering.columns import (
    ALBEDO_B,
    ALBEDO_G,
    ALBEDO_R,
    LAW,
    MODEL,
    POINT_COLUMNS,
)
from fabricusd.appearance.scattering.model import PUBLISHED
from fabricusd.appearance.scattering.models import PUBLISHED_MODELS
from fabricusd.kernels.choice import for_each
from fabricusd.kernels.real import BLOCK, INLINE, KERNEL, PART, cos, index, sin
from fabricusd.kernels.unrolled import tuple_reader

_WARP = 13 * BLOCK
"""Offset of the nine rows of the warp; the weft uses the first nine rows of the block."""
_IS_WARP, _COS, _SIN, _ACROSS = 22 * BLOCK, 23 * BLOCK, 24 * BLOCK, 25 * BLOCK
_THREAD = 26 * BLOCK
"""Offset of the columns of each point's own thread."""
POINT_ROWS = 26 + POINT_COLUMNS
_NO_MODEL = -1.0


@njit(**PART)
def point_value(R, tables, across_too, thread_set, thread, psi0, w, ix, iy, iz, ox, oy, oz):
    """(r, g, b) of the published models on `thread` of `thread_set` at tangent angle psi0 [rad].

    across_too : evaluate level `thread` at `w` in [-1, 1] across the visible width, not `weave`
    """
    none = R(0)
    row = tables.threads[thread]
    if iz <= none or oz <= none or row[LAW] != R(PUBLISHED):
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
        R, int(row[MODEL]), across_too, row, tables.overlap_precision,
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
def _bit_of_thread(R, model, across_too, row, precision, c, s, w, a_i, b_i, iz, a_o, b_o, oz):
    """`segment`, times the factors across the width if `across_too`."""
    surface, volume = segment(R, model, row, precision, c, s, a_i, b_i, iz, a_o, b_o, oz)
    if across_too:
        n_i, n_o = s * a_i + c * iz, s * a_o + c * oz
        on_surface, on_volume = across_at(R, row, w, b_i, n_i, b_o, n_o)
        return surface * on_surface, volume * on_volume
    return surface, volume


@njit(**KERNEL)
def point_values(R, tables, across_too, sets, threads, psi0, w, wi, wo, out, begin, end):
    """`point_value` at the places from `begin` to `end` - 1.

    sets, threads : (n,) ints; psi0, w : (n,) real; wi, wo, out : (3, n) real
    """
    block = np.empty(POINT_ROWS * BLOCK, wi.dtype)
    for start in range(begin, end, BLOCK):
        point_block(
            R, tables, across_too, sets, threads, psi0, w, start, wi, wo, out, start,
            min(BLOCK, end - start), block,
        )  # fmt: skip


@njit(**PART)
def point_block(
    R, tables, across_too, sets, threads, psi0, w, first, wi, wo, out, start, size, block
):
    """`size` entries of `point_values`.

    first : index of the first place; start : index of the first pair of directions and result
    block : (POINT_ROWS*BLOCK,) real, overwritten

    A separate loop first copies the numbers of each point's thread into rows of the block, so that
    LLVM vectorises the loop that computes. A set that is neither weft nor warp is a gap.
    """
    for x in range(size):
        block[NORMALIZATION + x] = tables.gap * wo[2, index(start, x)]
        block[RED + x] = block[GREEN + x] = block[BLUE + x] = R(0)
    prepare(R, WEFT, tables.overlap_precision, wi, wo, start, size, block)
    prepare(R, WARP, tables.overlap_precision, wi, wo, start, size, block, _WARP)
    for k in range(tables.warp_start):
        add_masking(R, tables, k, size, block)
    for k in range(tables.warp_start, tables.nodes.shape[0]):
        add_masking(R, tables, k, size, block, _WARP)
    _copy_threads(R, tables, sets, threads, psi0, w, first, size, block)
    _of_models(R, tables, across_too, size, block)
    divide(R, out, start, size, block)


@njit(**INLINE)
def _has_model(R, tables, model):
    found = False
    for thread in range(tables.threads.shape[0]):
        found |= tables.threads[thread, MODEL] == R(model)
    return found


@njit(**INLINE)
def _copy_threads(R, tables, sets, threads, psi0, w, first, size, block):
    """Copy set, tangent angle, place across and the thread's numbers for a block of points."""
    for x in range(size):
        k = index(first, x)
        which, thread = sets[k], np.uintp(threads[k])
        block[_IS_WARP + x] = R(1) if which == WARP else R(0)
        block[_ACROSS + x] = w[k]
        for column in range(POINT_COLUMNS):
            block[_THREAD + column * BLOCK + x] = tables.threads[thread, column]
        if which != WEFT and which != WARP:
            block[_THREAD + MODEL * BLOCK + x] = R(_NO_MODEL)
    for x in range(size):
        k = index(first, x)
        block[_COS + x], block[_SIN + x] = cos(R, psi0[k]), sin(R, psi0[k])


_row_at = tuple_reader(POINT_COLUMNS, BLOCK)
"""Called with (block, _THREAD + x): the columns of the point's thread, like a row of the table."""


@njit(**INLINE)
def _own(block, x, warp):
    """The entry at x for the point's own set. Both are loaded, to select instead of branching."""
    weft_value, warp_value = block[x], block[x + _WARP]
    return warp_value if warp else weft_value


@njit(**INLINE)
def _of_model(R, model, tables, across_too, size, block):
    """Add the value without `1/Q` to the sums, for the points whose thread has this model."""
    if not _has_model(R, tables, model):
        return
    precision = tables.overlap_precision
    for x in range(size):
        row = _row_at(block, _THREAD + x)
        c, s, warp = block[_COS + x], block[_SIN + x], block[_IS_WARP + x] > R(0)
        iz, oz = block[UP_I + x], block[UP_O + x]
        a_i, b_i = _own(block, AXIS_I + x, warp), _own(block, ACROSS_I + x, warp)
        a_o, b_o = _own(block, AXIS_O + x, warp), _own(block, ACROSS_O + x, warp)
        scale_i, scale_o = _own(block, SCALE_I + x, warp), _own(block, SCALE_O + x, warp)
        u = _own(block, OVERLAP + x, warp)
        p = seen_along(R, c, s, a_i, iz, scale_i, a_o, oz, scale_o, u)
        surface, volume = _bit_of_thread(
            R, model, across_too, row, precision, c, s, block[_ACROSS + x],
            a_i, b_i, iz, a_o, b_o, oz,
        )  # fmt: skip
        share = p if row[MODEL] == R(model) else R(0)
        block[RED + x] += share * (surface + volume * row[ALBEDO_R])
        block[GREEN + x] += share * (surface + volume * row[ALBEDO_G])
        block[BLUE + x] += share * (surface + volume * row[ALBEDO_B])


_of_models = for_each(_of_model, PUBLISHED_MODELS)
