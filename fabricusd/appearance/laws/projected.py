"""Surface law `projected`: each thread by the area of it that the viewer sees.

With `q = 1/max(n_t.N, cos 85 degrees)` the area of thread on a unit of cloth, the weight is `q mu`
and

    L_o = (1 - gap(wo)) sum a q mu f_s cos(theta_i) g / sum a q mu,
    mu = (n + sqrt(n^2 + (h/w)^2 b^2))/2,   n = n_t.wo,   b = the component of wo across the set.

`mu` is what is seen of the upper half of a section of height h and width w, over w; of a flat
thread it is `max(0, n)`.

The gaps close as the view turns from the normal, since threads are as high as their sections:
`gap(w)` is the product over the sets of `1 - 2 sqrt(half_width^2 + half_height^2 t^2)/pitch`, with
t the tangent of the view's angle across the threads of the set. That is exact for straight threads,
and within .02 of the traced tubes on linen. Views from which the cloth would be brighter than a
white sky are divided by its brightness there. Source: ours; it is what explicit threads are nearest
to, docs/geometry.md.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.laws.excess import EXCESS_FIELDS, excess_at, no_excess
from fabricusd.appearance.laws.law import (
    Law,
    all_visible,
    no,
    no_mask,
    no_place,
    no_shares,
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
from fabricusd.appearance.weave.coverage import coverage, sets
from fabricusd.appearance.weave.sections import sections
from fabricusd.fabric import PILE_ANGLE, Fabric
from fabricusd.kernels.real import INLINE

LEAST_COSINE = math.cos(PILE_ANGLE)
"""Least n_t.N that thread counts with: steeper thread would take all of the view."""

LEAST_WIDTH_2 = 1e-12
"""Least squared width [pitches] that a set counts with: one that is nowhere seen has none."""

Projected = tables_class(__name__, "Projected", "wide_2", "tall_2", *LIGHT_FIELDS, *EXCESS_FIELDS)
"""wide_2, tall_2 : (2,) real - squared widths and heights of the threads of each set, in pitches"""


def _shape(fabric: Fabric) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(2,) widths and mean heights of the threads of each set, in pitches."""
    half = sections(fabric).half_height
    tall = np.array(
        [
            2.0 * np.mean([half[j, k] for k in one.sequence]) / one.pitch
            for j, one in enumerate(sets(fabric))
        ]
    )
    return coverage(fabric).width, np.zeros(2) if fabric.opaque else tall


def _make(fabric: Fabric, nodes: Any, means: Any, precision: Any) -> dict[str, Any]:
    wide, tall = _shape(fabric)
    return {
        "wide_2": (wide**2).astype(precision),
        "tall_2": (tall**2).astype(precision),
        **light_fields(means, precision),
        **no_excess(precision),
    }


@njit(**INLINE)
def _shared(R, tables, thread_set, across_o, cos_half):
    """`(h/w)^2 b^2`."""
    wide_2 = max(tables.wide_2[thread_set], R(LEAST_WIDTH_2))
    return tables.tall_2[thread_set] / wide_2 * across_o * across_o


@njit(**INLINE)
def weight(R, tables, c, s, pair):
    """What is seen of the upper half of a section, over the thread's projected width."""
    n = s * pair.along_o + c * pair.up_o
    # Not below 0 by rounding.
    seen = max(n + math.sqrt(n * n + pair.shared), R(0))
    return R(0.5) * seen / max(c, R(LEAST_COSINE))


@njit(**INLINE)
def _openness(R, tables, ox, oy, oz):
    """`gap(wo)`: 0 in cloth without gaps."""
    up_2 = max(oz * oz, R(1e-12))
    weft = tables.wide_2[WEFT] + tables.tall_2[WEFT] * oy * oy / up_2
    warp = tables.wide_2[WARP] + tables.tall_2[WARP] * ox * ox / up_2
    return max(R(0), R(1) - math.sqrt(weft)) * max(R(0), R(1) - math.sqrt(warp))


@njit(**INLINE)
def _total(R, tables, seen, ox, oy, oz):
    most = excess_at(R, tables, ox, oy, oz)
    return seen * most / (R(1) - _openness(R, tables, ox, oy, oz))


def _plain_weight(fabric: Fabric, is_warp: bool, psi0: Any, i: Angles, o: Angles) -> Array:
    wide, tall = (shape[WARP if is_warp else WEFT] for shape in _shape(fabric))
    # Components along the thread's normal and across it.
    n, b = np.cos(o.theta) * np.cos(o.phi), np.cos(o.theta) * np.sin(o.phi)
    seen = (n + np.hypot(n, tall / wide * b)) / 2
    return np.asarray(seen / np.maximum(np.cos(psi0), LEAST_COSINE))


def _plain_mask(fabric: Fabric, i: Angles, o: Angles) -> Array:
    return np.ones(np.broadcast_shapes(np.shape(i.phi), np.shape(o.phi)))


def _plain_total(fabric: Fabric, seen: Array, gap: float, wo: Array) -> Array:
    return np.asarray(seen / (1.0 - plain_openness(fabric, wo)))


def plain_openness(fabric: Fabric, wo: Array) -> Array:
    """`gap(wo)` in plain NumPy; wo : (..., 3)."""
    wide, tall = _shape(fabric)
    w = np.asarray(wo)
    open_ = np.ones(w.shape[:-1])
    for j, across in ((WEFT, w[..., 1]), (WARP, w[..., 0])):
        slope = across / np.maximum(np.abs(w[..., 2]), 1e-6)
        open_ = open_ * np.maximum(0.0, 1.0 - np.hypot(wide[j], tall[j] * slope))
    return np.asarray(open_)


LAW = Law(
    summary="each thread by the area of it that is seen",
    tables=Projected,
    make=_make,
    absolute=True,
    shared=_shared,
    hides=no,
    view_place=no_place,
    visible_shares=all_visible,
    view_shares=no_shares,
    weight=weight,
    mask=no_mask,
    total=_total,
    openness=_openness,
    node_room=node_room,
    light_nodes=light_nodes,
    lit_node=lit_node,
    lit_alone=lit_alone,
    plain_weight=_plain_weight,
    plain_mask=_plain_mask,
    plain_total=_plain_total,
)
