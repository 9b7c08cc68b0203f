"""The mean of `g` at the nodes of level `far`, which laws with an absolute shadow multiply by.

Means are held in a table by the light's azimuth and elevation, see `shadow.mean`, and read between
four entries. Entries of all nodes lie side by side, so that LLVM vectorises the loop over them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.frame import diamond
from fabricusd.kernels.real import INLINE, index

AZIMUTHS, ROWS = 256, 97
"""Azimuths and elevations of the table of the nodes; elevations are even in the root of their sine.
With 128 azimuths, or 64 elevations even in the sine, `far` is off `weave` by .02 to .04 in the
light of a low sun, see docs/decisions/030."""

LIGHT_FIELDS = ("means", "columns", "lit_rows", "lit_nodes")
"""Fields of the tables of a law that uses `lit`.

means : (columns + 1, rows, nodes) real, flat - the mean of g
columns : int - azimuths; the last column repeats the first. 0 for light that nothing holds back
lit_rows, lit_nodes : int - elevations; nodes
"""


def light_fields(means: NDArray[np.float64] | None, precision: Any) -> dict[str, Any]:
    """LIGHT_FIELDS in `precision`.

    means : (columns + 1, rows, nodes) of `shadow.mean.node_means`; None for light that nothing
        holds back
    """
    if means is None:
        return {"means": np.ones(1, precision), "columns": 0, "lit_rows": 0, "lit_nodes": 0}
    columns, rows, nodes = means.shape
    return {
        "means": np.ascontiguousarray(means, dtype=precision).reshape(-1),
        "columns": columns - 1,
        "lit_rows": rows,
        "lit_nodes": nodes,
    }


@njit(**INLINE)
def column_of(R, columns, x, y):
    """(column, weight of the next one) for light from (x, y); columns : without the repeated
    one."""
    turn = diamond(R, x, y) * R(0.25) * R(columns)
    column = max(min(np.int32(turn), np.int32(columns - 1)), np.int32(0))
    return column, turn - R(column)


@njit(**INLINE)
def row_of(R, rows, z):
    """(row, weight of the next one) for light of which z is the sine of the elevation."""
    across = math.sqrt(max(z, R(0))) * R(rows - 1)
    row = max(min(np.int32(across), np.int32(rows - 2)), np.int32(0))
    return row, min(across - R(row), R(1))


@njit(**INLINE)
def mean_at(R, means, here, beside, step, c, r):
    """Mean of g between the entry `here`, that in the next column, and those `step` further on.

    c, r : weights of the next column and row
    """
    low = means[here]
    low += (means[beside] - low) * c
    high = means[index(here, step)]
    high += (means[index(beside, step)] - high) * c
    return low + (high - low) * r


@njit(**INLINE)
def node_room(R, tables, size):
    """Entries that `light_nodes` fills for `size` lights."""
    return size * tables.lit_nodes


@njit(**INLINE)
def light_nodes(R, tables, x, y, z, lit, first):
    """Fill the entries of `lit` from `first` on with the means of g at the nodes, for one light."""
    if tables.columns == 0:
        return
    column, c = column_of(R, tables.columns, x, y)
    row, r = row_of(R, tables.lit_rows, z)
    nodes = tables.lit_nodes
    begin = (np.int64(column) * tables.lit_rows + row) * nodes
    beside = begin + tables.lit_rows * nodes
    for node in range(nodes):
        here, next_to = index(begin, node), index(beside, node)
        lit[index(first, node)] = mean_at(R, tables.means, here, next_to, nodes, c, r)


@njit(**INLINE)
def lit_node(R, tables, lit, first, node):
    """Mean of g at a node, from what `light_nodes` filled in from `first` on."""
    return lit[index(first, node)] if tables.columns > 0 else R(1)


@njit(**INLINE)
def lit_alone(R, tables, node, x, y, z):
    """Mean of g at one node, for light from (x, y, z)."""
    if tables.columns == 0:
        return R(1)
    column, c = column_of(R, tables.columns, x, y)
    row, r = row_of(R, tables.lit_rows, z)
    nodes = tables.lit_nodes
    here = (np.int64(column) * tables.lit_rows + row) * nodes + node
    return mean_at(R, tables.means, here, here + tables.lit_rows * nodes, nodes, c, r)
