"""Evaluate the published law at level `far`: the mean over the repeat, as a distant view sees it.

`L_o = 1/Q sum_j a_j < f_s M P cos theta_i >`, `Q = sum_j a_j <P>_j + gap (N.wo)`, with means over
the tangent curves taken at the nodes of `surface_tables`. `P` costs a dozen operations per node, so
`Q` is summed directly: reading it from a table would take as long and be less exact. The value is 0
unless both directions are above the cloth. Source: `docs/model.md` section 4, [Sadeghi2013].
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.published.blocks import (
    BLUE,
    GREEN,
    NORMALIZATION,
    NOTHING,
    RED,
    ROWS,
    add_masking,
    divide,
    node_range,
    pair_at,
    prepare,
)
from fabricusd.appearance.published.segment import (
    along_set,
    mean_segment,
    seen_along,
    segment,
)
from fabricusd.appearance.published.tables import NODE_COS, NODE_HALF, NODE_SIN, NODE_WEIGHT
from fabricusd.appearance.scattering.columns import ALBEDO_B, ALBEDO_G, ALBEDO_R, MODEL
from fabricusd.appearance.scattering.models import PUBLISHED_MODELS
from fabricusd.appearance.scattering.terms import CELL_MODELS
from fabricusd.kernels.choice import specialised
from fabricusd.kernels.real import BLOCK, INLINE, KERNEL, PART, index


@njit(**INLINE)
def normalization(R, tables, ix, iy, iz, ox, oy, oz):
    """`Q(wi, wo)` of two directions above the cloth."""
    q = tables.gap * oz
    for thread_set in (WEFT, WARP):
        first, last = node_range(tables, thread_set)
        pair = along_set(R, thread_set, tables.overlap_precision, ix, iy, iz, ox, oy, oz)
        for k in range(first, last):
            p = seen_along(R, tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN], pair)
            q += tables.nodes[k, NODE_WEIGHT] * p
    return q


@njit(**INLINE)
def node_terms(R, tables, k, pair):
    """`f_s M cos theta_i` at node k: (surface, volume without `A`)."""
    c, s, half = tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN], tables.nodes[k, NODE_HALF]
    row = tables.threads[tables.node_thread[k]]
    model = int(row[MODEL])
    if half > R(0):
        return mean_segment(R, model, row, half, tables.overlap_precision, c, s, pair)
    return segment(R, model, row, tables.overlap_precision, c, s, pair)


@njit(**PART)
def far_value(R, tables, ix, iy, iz, ox, oy, oz):
    """(r, g, b) of the published models at level `far` for one pair of directions."""
    none = R(0)
    if iz <= none or oz <= none:
        return none, none, none
    q = tables.gap * oz
    red, green, blue = none, none, none
    for thread_set in (WEFT, WARP):
        first, last = node_range(tables, thread_set)
        pair = along_set(R, thread_set, tables.overlap_precision, ix, iy, iz, ox, oy, oz)
        for k in range(first, last):
            p = seen_along(R, tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN], pair)
            p *= tables.nodes[k, NODE_WEIGHT]
            q += p
            # A node that faces away from either direction adds nothing; NaN is passed on.
            if p == none or tables.published[k] == 0:
                continue
            surface, volume = node_terms(R, tables, k, pair)
            row = tables.threads[tables.node_thread[k]]
            red += p * (surface + volume * row[ALBEDO_R])
            green += p * (surface + volume * row[ALBEDO_G])
            blue += p * (surface + volume * row[ALBEDO_B])
    if q <= R(NOTHING):
        return none, none, none
    inverse = R(1) / q
    return red * inverse, green * inverse, blue * inverse


@njit(**KERNEL)
def far_values(R, tables, wi, wo, out, begin, end):
    """`far_value` of the pairs from `begin` to `end` - 1: wi, wo, out are (3, n) real.

    This calls the same functions as the scalar kernel, with the loop over directions innermost so
    that LLVM vectorises it. All partial sums are in a single array, see `blocks`.
    """
    block = np.empty(ROWS * BLOCK, wi.dtype)
    for start in range(begin, end, BLOCK):
        size = min(BLOCK, end - start)
        for x in range(size):
            block[NORMALIZATION + x] = tables.gap * wo[2, index(start, x)]
            block[RED + x] = block[GREEN + x] = block[BLUE + x] = R(0)
        for thread_set in (WEFT, WARP):
            first, last = node_range(tables, thread_set)
            if first == last:
                continue
            prepare(R, thread_set, tables.overlap_precision, wi, wo, start, size, block)
            for k in range(first, last):
                _add_node(R, tables, k, size, block)
        divide(R, out, start, size, block)


@njit(**INLINE)
def _add_point(R, model, tables, k, row, size, block):
    c, s, weight = (
        tables.nodes[k, NODE_COS],
        tables.nodes[k, NODE_SIN],
        tables.nodes[k, NODE_WEIGHT],
    )
    red, green, blue = row[ALBEDO_R], row[ALBEDO_G], row[ALBEDO_B]
    for x in range(size):
        pair = pair_at(block, x)
        p = weight * seen_along(R, c, s, pair)
        surface, volume = segment(R, model, row, tables.overlap_precision, c, s, pair)
        block[NORMALIZATION + x] += p
        block[RED + x] += p * (surface + volume * red)
        block[GREEN + x] += p * (surface + volume * green)
        block[BLUE + x] += p * (surface + volume * blue)


@njit(**INLINE)
def _add_cell(R, model, tables, k, row, size, block):
    c, s, weight = (
        tables.nodes[k, NODE_COS],
        tables.nodes[k, NODE_SIN],
        tables.nodes[k, NODE_WEIGHT],
    )
    half = tables.nodes[k, NODE_HALF]
    red, green, blue = row[ALBEDO_R], row[ALBEDO_G], row[ALBEDO_B]
    for x in range(size):
        pair = pair_at(block, x)
        p = weight * seen_along(R, c, s, pair)
        surface, volume = mean_segment(R, model, row, half, tables.overlap_precision, c, s, pair)
        block[NORMALIZATION + x] += p
        block[RED + x] += p * (surface + volume * red)
        block[GREEN + x] += p * (surface + volume * green)
        block[BLUE + x] += p * (surface + volume * blue)


_point_of = specialised(_add_point, PUBLISHED_MODELS)
_cell_of = specialised(_add_cell, CELL_MODELS)


@njit(**PART)
def _add_node(R, tables, k, size, block):
    """Add node k's share of `Q` and of the value to a block, by the loop for its kind of node."""
    row = tables.threads[tables.node_thread[k]]
    model = int(row[MODEL])
    if tables.published[k] == 0:
        add_masking(R, tables, k, size, block)
    elif tables.nodes[k, NODE_HALF] > R(0):
        _cell_of(R, model, tables, k, row, size, block)
    else:
        _point_of(R, model, tables, k, row, size, block)
