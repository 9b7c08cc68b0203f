"""Evaluate the published law at level `far`: the mean over the repeat, as a distant view sees it.

`L_o = 1/Q sum_j a_j < weight f_s mask cos theta_i g >`, `Q` the law's total of
`sum_j a_j <weight>_j`, with means over the tangent curves taken at the nodes of `surface_tables`. A
weight costs at most a dozen operations per node, so `Q` is summed directly: reading it from a table
would take as long and be less exact. The value is 0 unless both directions are above the cloth.
Source: `docs/model.md` section 4; `laws` has one module per law.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.appearance import laws
from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.published.blocks import (
    BLUE,
    GREEN,
    NODE_LIT,
    NORMALIZATION,
    NOTHING,
    RED,
    ROWS,
    add_weight,
    divide,
    look,
    node_range,
    pair_at,
    prepare,
)
from fabricusd.appearance.published.columns import NODE_COS, NODE_HALF, NODE_SIN, NODE_WEIGHT
from fabricusd.appearance.published.segment import (
    along_set,
    mean_segment,
    segment,
)
from fabricusd.appearance.scattering.columns import ALBEDO_B, ALBEDO_G, ALBEDO_R, MODEL
from fabricusd.appearance.scattering.models import PUBLISHED_MODELS
from fabricusd.appearance.scattering.terms import CELL_MODELS
from fabricusd.kernels.choice import specialised
from fabricusd.kernels.real import BLOCK, INLINE, KERNEL, PART, index


@njit(**INLINE)
def normalization(R, tables, ix, iy, iz, ox, oy, oz):
    """The law's total of two directions above the cloth."""
    seen = R(0)
    for thread_set in (WEFT, WARP):
        first, last = node_range(tables, thread_set)
        pair = along_set(R, tables, thread_set, ix, iy, iz, ox, oy, oz)
        for k in range(first, last):
            p = laws.weight(R, tables, tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN], pair)
            seen += tables.nodes[k, NODE_WEIGHT] * p
    return laws.total(R, tables, seen, ox, oy, oz)


@njit(**INLINE)
def node_terms(R, tables, k, pair):
    """`f_s mask cos theta_i` at node k: (surface, volume without `A`)."""
    c, s, half = tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN], tables.nodes[k, NODE_HALF]
    row = tables.threads[tables.node_thread[k]]
    model = int(row[MODEL])
    if half > R(0):
        return mean_segment(R, tables, model, row, half, c, s, pair)
    return segment(R, tables, model, row, c, s, pair)


@njit(**PART)
def far_value(R, tables, ix, iy, iz, ox, oy, oz):
    """(r, g, b) of the published models at level `far` for one pair of directions."""
    none = R(0)
    if iz <= none or oz <= none:
        return none, none, none
    seen = none
    red, green, blue = none, none, none
    for thread_set in (WEFT, WARP):
        first, last = node_range(tables, thread_set)
        pair = along_set(R, tables, thread_set, ix, iy, iz, ox, oy, oz)
        for k in range(first, last):
            p = laws.weight(R, tables, tables.nodes[k, NODE_COS], tables.nodes[k, NODE_SIN], pair)
            p *= tables.nodes[k, NODE_WEIGHT]
            seen += p
            # A node that faces away from either direction adds nothing; NaN is passed on.
            if p == none or tables.published[k] == 0:
                continue
            surface, volume = node_terms(R, tables, k, pair)
            p *= laws.lit_alone(R, tables, k, ix, iy, iz)
            row = tables.threads[tables.node_thread[k]]
            red += p * (surface + volume * row[ALBEDO_R])
            green += p * (surface + volume * row[ALBEDO_G])
            blue += p * (surface + volume * row[ALBEDO_B])
    q = laws.total(R, tables, seen, ox, oy, oz)
    if q <= R(NOTHING):
        return none, none, none
    inverse = R(1) / q
    red = none if red < none else red * inverse
    green = none if green < none else green * inverse
    blue = none if blue < none else blue * inverse
    return red, green, blue


@njit(**KERNEL)
def far_values(R, tables, wi, wo, out, begin, end):
    """`far_value` of the pairs from `begin` to `end` - 1: wi, wo, out are (3, n) real.

    This calls the same functions as the scalar kernel, with the loop over directions innermost so
    that LLVM vectorises it. All partial sums are in a single array, see `blocks`.
    """
    block = np.empty(ROWS * BLOCK, wi.dtype)
    lit = np.empty(laws.node_room(R, tables, BLOCK), wi.dtype)
    for start in range(begin, end, BLOCK):
        size = min(BLOCK, end - start)
        for x in range(size):
            k = index(start, x)
            block[NORMALIZATION + x] = R(0)
            block[RED + x] = block[GREEN + x] = block[BLUE + x] = R(0)
            first = laws.node_room(R, tables, x)
            laws.light_nodes(R, tables, wi[0, k], wi[1, k], wi[2, k], lit, first)
        look(R, tables, wo, start, size, block)
        for thread_set in (WEFT, WARP):
            first, last = node_range(tables, thread_set)
            if first == last:
                continue
            prepare(R, tables, thread_set, wi, wo, start, size, block)
            for k in range(first, last):
                _add_node(R, tables, k, size, lit, block)
        divide(R, tables, wo, out, start, size, block)


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
        p = weight * laws.weight(R, tables, c, s, pair)
        surface, volume = segment(R, tables, model, row, c, s, pair)
        block[NORMALIZATION + x] += p
        p *= block[NODE_LIT + x]
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
        p = weight * laws.weight(R, tables, c, s, pair)
        surface, volume = mean_segment(R, tables, model, row, half, c, s, pair)
        block[NORMALIZATION + x] += p
        p *= block[NODE_LIT + x]
        block[RED + x] += p * (surface + volume * red)
        block[GREEN + x] += p * (surface + volume * green)
        block[BLUE + x] += p * (surface + volume * blue)


_point_of = specialised(_add_point, PUBLISHED_MODELS)
_cell_of = specialised(_add_cell, CELL_MODELS)


@njit(**PART)
def _add_node(R, tables, k, size, lit, block):
    """Add node k's share of `Q` and of the value to a block, by the loop for its kind of node."""
    row = tables.threads[tables.node_thread[k]]
    model = int(row[MODEL])
    # In a loop of its own: from a second array LLVM would not vectorise the loops that follow.
    for x in range(size):
        block[NODE_LIT + x] = laws.lit_node(R, tables, lit, laws.node_room(R, tables, x), k)
    if tables.published[k] == 0:
        add_weight(R, tables, k, size, block)
    elif tables.nodes[k, NODE_HALF] > R(0):
        _cell_of(R, model, tables, k, row, size, block)
    else:
        _point_of(R, model, tables, k, row, size, block)
