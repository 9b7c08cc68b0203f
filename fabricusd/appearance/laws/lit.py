"""The mean of `g` at the nodes of level `far`, which laws with an absolute shadow multiply by.

Each node has the horizons of GROUPS groups of places by azimuth, see `shadow.mean`. A horizon is
held as its elevation over the width of a shadow's edge. The loops run over the groups of one node,
which lie side by side, so that LLVM vectorises them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.frame import diamond
from fabricusd.kernels.real import INLINE, asin, index

GROUPS = 24
"""Groups of places that scatter alike, see docs/shadowing.md. With 16, `far` takes an eighth less
time, and is 4 % off `weave` on flannel in the light of a sun at 5 degrees; with 24, 1 %."""

LIGHT_FIELDS = ("horizons", "columns", "lit_nodes", "groups", "softness")
"""Fields of the tables of a law that uses `lit`.

horizons : (columns + 1, nodes, GROUPS) real, flat - elevations of horizons, in softnesses
columns : int - azimuths; the last column repeats the first. 0 for light that nothing holds back
lit_nodes, groups : int - nodes; GROUPS
softness : real - width of a shadow's edge [rad]
"""


def light_fields(
    shadow: tuple[NDArray[np.float64], float] | None, precision: Any
) -> dict[str, Any]:
    """LIGHT_FIELDS in `precision`.

    shadow : horizons (columns + 1, nodes, GROUPS) of `shadow.mean.node_groups`, and the softness
        [rad]; None for light that nothing holds back
    """
    if shadow is None:
        nothing = {
            "horizons": np.zeros(1, precision),
            "columns": 0,
            "lit_nodes": 0,
            "groups": GROUPS,
        }
        return {**nothing, "softness": precision(1)}
    horizons, softness = shadow
    return {
        "horizons": np.ascontiguousarray(horizons, dtype=precision).reshape(-1),
        "columns": horizons.shape[0] - 1,
        "lit_nodes": horizons.shape[1],
        "groups": GROUPS,
        "softness": precision(softness),
    }


@njit(**INLINE)
def column_of(R, columns, x, y):
    """(column, weight of the next one) for light from (x, y); columns : without the repeated
    one."""
    turn = diamond(R, x, y) * R(0.25) * R(columns)
    column = max(min(np.int32(turn), np.int32(columns - 1)), np.int32(0))
    return column, turn - R(column)


@njit(**INLINE)
def level_of(R, z, softness):
    """The light's elevation in softnesses, plus a half; z : sine of the elevation."""
    return asin(R, z) / softness + R(0.5)


@njit(**INLINE)
def mean_over(R, horizons, groups, here, beside, c, level):
    """Mean of g over the groups whose horizons begin at `here`, and at `beside` in the next
    column.

    groups : GROUPS, read from memory: LLVM would unroll a loop of known length, not vectorise it
    """
    total = R(0)
    for k in range(groups):
        horizon = horizons[index(here, k)]
        horizon += (horizons[index(beside, k)] - horizon) * c
        t = max(R(0), min(R(1), level - horizon))
        total += t * t * (R(3) - R(2) * t)
    return total * R(1.0 / GROUPS)


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
    level = level_of(R, z, tables.softness)
    here = np.int64(column) * tables.lit_nodes * GROUPS
    step = tables.lit_nodes * GROUPS
    for node in range(tables.lit_nodes):
        begin = here + node * GROUPS
        lit[index(first, node)] = mean_over(
            R, tables.horizons, tables.groups, begin, begin + step, c, level
        )


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
    step = tables.lit_nodes * GROUPS
    begin = np.int64(column) * step + node * GROUPS
    level = level_of(R, z, tables.softness)
    return mean_over(R, tables.horizons, tables.groups, begin, begin + step, c, level)
