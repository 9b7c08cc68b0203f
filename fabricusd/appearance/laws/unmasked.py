"""Surface law `unmasked`: [Bisker2011] eq. 5.1, `f_s g`, each thread by the share of the cloth it
covers.

There is neither mask nor weight. Light that neighbouring threads hold back is lost. Views from
which the cloth would be brighter than a white sky are divided by its brightness there.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from fabricusd.appearance.laws.excess import EXCESS_FIELDS, excess_at, no_excess
from fabricusd.appearance.laws.law import (
    Law,
    all_visible,
    no,
    no_mask,
    no_place,
    no_shares,
    nothing_shared,
    same_gap,
    tables_class,
)
from fabricusd.appearance.laws.lit import (
    LIGHT_FIELDS,
    light_fields,
    light_nodes,
    lit_alone,
    lit_node,
    node_room,
)
from fabricusd.appearance.scattering.plain_lobes import Angles, Array
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import INLINE

Unmasked = tables_class(__name__, "Unmasked", *LIGHT_FIELDS, *EXCESS_FIELDS)


def _make(fabric: Fabric, nodes: Any, means: Any, precision: Any) -> dict[str, Any]:
    return {**light_fields(means, precision), **no_excess(precision)}


@njit(**INLINE)
def _weight(R, tables, c, s, pair):
    return R(1)


@njit(**INLINE)
def _total(R, tables, seen, ox, oy, oz):
    """1, since the shares of threads and gap add up to it; more where the cloth is too bright."""
    return excess_at(R, tables, ox, oy, oz)


def _plain_weight(fabric: Fabric, is_warp: bool, psi0: Any, i: Angles, o: Angles) -> Array:
    return np.ones(np.broadcast_shapes(np.shape(i.psi), np.shape(o.psi)))


def _plain_mask(fabric: Fabric, i: Angles, o: Angles) -> Array:
    return np.ones(np.broadcast_shapes(np.shape(i.phi), np.shape(o.phi)))


def _plain_total(fabric: Fabric, seen: Array, gap: float, wo: Array) -> Array:
    return np.ones(np.shape(seen))


LAW = Law(
    summary="the thesis's equation 5.1, each thread by the area it covers",
    tables=Unmasked,
    make=_make,
    absolute=True,
    shared=nothing_shared,
    hides=no,
    view_place=no_place,
    visible_shares=all_visible,
    view_shares=no_shares,
    weight=_weight,
    mask=no_mask,
    total=_total,
    openness=same_gap,
    node_room=node_room,
    light_nodes=light_nodes,
    lit_node=lit_node,
    lit_alone=lit_alone,
    plain_weight=_plain_weight,
    plain_mask=_plain_mask,
    plain_total=_plain_total,
)
