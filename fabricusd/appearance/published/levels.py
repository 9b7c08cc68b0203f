"""Evaluate the published law at levels `weave` and `thread`: at a point of one thread.

`L_o(x) = weight f_s mask(x)/Q cos theta_i` with the same `Q` as level `far`, so the mean over the
repeat is the value at level `far`. At level `thread` the two terms are modulated across the width
by factors with a mean of 1, so the mean over the width is the value at level `weave`. The value is
0 unless both directions are above the cloth; a gap reflects nothing. Shadowing multiplies the value
and is applied by the caller. Source: `docs/model.md` section 4, [Bisker2011] eq. 5.1.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.appearance import laws
from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.published.blocks import (
    ACROSS_I,
    ACROSS_O,
    ALONG_I,
    ALONG_O,
    BLUE,
    GREEN,
    NODE_LIT,
    NORMALIZATION,
    NOTHING,
    RED,
    SCALE_I,
    SCALE_O,
    SEEN_0,
    SEEN_1,
    SEEN_2,
    SEEN_4,
    SHARED,
    UP_I,
    UP_O,
    add_weight,
    divide,
    look,
    prepare,
)
from fabricusd.appearance.published.far import normalization
from fabricusd.appearance.published.segment import SetPair, along_set, segment
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

_WARP = NODE_LIT
"""Offset of the thirteen rows of the warp; the weft uses the first thirteen rows of the block."""
_IS_WARP, _COS, _SIN, _ACROSS = (_WARP + k * BLOCK for k in range(13, 17))
_THREAD = _WARP + 17 * BLOCK
"""Offset of the columns of each point's own thread."""
POINT_ROWS = _THREAD // BLOCK + POINT_COLUMNS
_NO_MODEL = -1.0

_FEW_TYPES = 6
"""Up to as many types of thread, it is faster to choose among the numbers of all than to read those
of each point's own."""


@njit(**PART)
def point_value(R, tables, across_too, place, ix, iy, iz, ox, oy, oz):
    """(r, g, b) of the published models at a `Place` on a thread.

    across_too : evaluate level `thread` at `place.w`, not level `weave`
    """
    none = R(0)
    row = tables.threads[place.thread]
    if iz <= none or oz <= none or row[LAW] != R(PUBLISHED):
        return none, none, none
    q = normalization(R, tables, ix, iy, iz, ox, oy, oz)
    if q <= R(NOTHING):
        return none, none, none
    pair = along_set(R, tables, place.thread_set, ix, iy, iz, ox, oy, oz)
    c, s = cos(R, place.psi0), sin(R, place.psi0)
    p = laws.weight(R, tables, c, s, pair)
    surface, volume = _segment_at(R, tables, int(row[MODEL]), across_too, row, c, s, place.w, pair)
    p /= q
    surface *= p
    volume *= p * R(place.shade)
    return (
        surface + volume * row[ALBEDO_R],
        surface + volume * row[ALBEDO_G],
        surface + volume * row[ALBEDO_B],
    )


@njit(**INLINE)
def _segment_at(R, tables, model, across_too, row, c, s, w, pair):
    """`segment`, times the factors across the width if `across_too`."""
    surface, volume = segment(R, tables, model, row, c, s, pair)
    if across_too:
        n_i, n_o = s * pair.along_i + c * pair.up_i, s * pair.along_o + c * pair.up_o
        on_surface, on_volume = across_at(R, row, w, pair.across_i, n_i, pair.across_o, n_o)
        return surface * on_surface, volume * on_volume
    return surface, volume


@njit(**KERNEL)
def point_values(R, tables, across_too, places, wi, wo, out, begin, end):
    """`point_value` at the n `Places` from `begin` to `end` - 1; wi, wo, out : (3, n) real."""
    block = np.empty(POINT_ROWS * BLOCK, wi.dtype)
    for start in range(begin, end, BLOCK):
        size = min(BLOCK, end - start)
        point_block(R, tables, across_too, places, start, wi, wo, out, start, size, block)


@njit(**PART)
def point_block(R, tables, across_too, places, first, wi, wo, out, start, size, block):
    """`size` entries of `point_values`.

    first : index of the first place; start : index of the first pair of directions and result
    block : (POINT_ROWS*BLOCK,) real, overwritten

    A separate loop first copies the numbers of each point's thread into rows of the block, so that
    LLVM vectorises the loop that computes. A set that is neither weft nor warp is a gap.
    """
    for x in range(size):
        block[NORMALIZATION + x] = R(0)
        block[RED + x] = block[GREEN + x] = block[BLUE + x] = R(0)
    look(R, tables, wo, start, size, block)
    prepare(R, tables, WEFT, wi, wo, start, size, block)
    prepare(R, tables, WARP, wi, wo, start, size, block, _WARP)
    for k in range(tables.warp_start):
        add_weight(R, tables, k, size, block)
    for k in range(tables.warp_start, tables.nodes.shape[0]):
        add_weight(R, tables, k, size, block, _WARP)
    _copy_threads(R, tables, places, first, size, block)
    _of_models(R, tables, across_too, size, block)
    divide(R, tables, wo, out, start, size, block)


@njit(**INLINE)
def _has_model(R, tables, model):
    found = False
    for thread in range(tables.threads.shape[0]):
        found |= tables.threads[thread, MODEL] == R(model)
    return found


@njit(**INLINE)
def _copy_threads(R, tables, places, first, size, block):
    """Copy set, tangent angle, place across and the thread's numbers for a block of points."""
    _copy_numbers(R, tables, places, first, size, block)
    for x in range(size):
        k = index(first, x)
        which = places.sets[k]
        block[_IS_WARP + x] = R(1) if which == WARP else R(0)
        block[_ACROSS + x] = places.w[k]
        model = block[_THREAD + MODEL * BLOCK + x]
        found = which in (WEFT, WARP)
        block[_THREAD + MODEL * BLOCK + x] = model if found else R(_NO_MODEL)
    if places.shade.size > 0:
        for x in range(size):
            shade = R(places.shade[index(first, x)])
            for column in range(ALBEDO_R, ALBEDO_B + 1):
                block[_THREAD + column * BLOCK + x] *= shade
    for x in range(size):
        k = index(first, x)
        block[_COS + x], block[_SIN + x] = cos(R, places.psi0[k]), sin(R, places.psi0[k])


@njit(**INLINE)
def _copy_numbers(R, tables, places, first, size, block):
    """Copy the columns of each point's thread. The sums give indices that cannot be negative."""
    types = tables.threads.shape[0]
    if types > _FEW_TYPES:
        for x in range(size):
            own = np.uintp(places.threads[index(first, x)])
            for column in range(POINT_COLUMNS):
                row = _THREAD + column * BLOCK
                block[index(row, x)] = tables.threads[own, np.uintp(column)]
        return
    for column in range(POINT_COLUMNS):
        row, value = _THREAD + column * BLOCK, tables.threads[0, column]
        for x in range(size):
            block[index(row, x)] = value
        for thread in range(1, types):
            value = tables.threads[thread, column]
            for x in range(size):
                mine = places.threads[index(first, x)] == thread
                block[index(row, x)] = value if mine else block[index(row, x)]


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
    for x in range(size):
        row = _row_at(block, _THREAD + x)
        c, s, warp = block[_COS + x], block[_SIN + x], block[_IS_WARP + x] > R(0)
        pair = SetPair(
            _own(block, ALONG_I + x, warp), _own(block, ACROSS_I + x, warp), block[UP_I + x],
            _own(block, SCALE_I + x, warp), _own(block, ALONG_O + x, warp),
            _own(block, ACROSS_O + x, warp), block[UP_O + x], _own(block, SCALE_O + x, warp),
            _own(block, SHARED + x, warp), _own(block, SEEN_0 + x, warp),
            _own(block, SEEN_1 + x, warp), _own(block, SEEN_2 + x, warp),
            _own(block, SEEN_4 + x, warp),
        )  # fmt: skip
        p = laws.weight(R, tables, c, s, pair)
        surface, volume = _segment_at(
            R, tables, model, across_too, row, c, s, block[_ACROSS + x], pair
        )
        share = p if row[MODEL] == R(model) else R(0)
        block[RED + x] += share * (surface + volume * row[ALBEDO_R])
        block[GREEN + x] += share * (surface + volume * row[ALBEDO_G])
        block[BLUE + x] += share * (surface + volume * row[ALBEDO_B])


_of_models = for_each(_of_model, PUBLISHED_MODELS)
