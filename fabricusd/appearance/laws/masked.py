"""Surface law `masked`: M, P and Q of [Sadeghi2013], section 4 of `docs/model.md`.

The weight is `P`, the mask `M`, the divisor `Q = sum a <P> + gap N.wo`. The mask already contains
the mean shadow of neighbouring threads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from fabricusd.appearance.laws.law import (
    Law,
    all_visible,
    always_lit,
    lit_alone,
    no,
    no_nodes,
    no_place,
    no_room,
    no_shares,
    same_gap,
    tables_class,
)
from fabricusd.appearance.scattering.plain_lobes import Angles, Array, wrap
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import INLINE, acos, exp

NARROWEST_MASKING = 1e-6
"""Least masking width [rad]: narrower ones are replaced by it, so that 1/width^2 stays finite."""


Masked = tables_class(__name__, "Masked", "precision")
"""precision : real - 2/masking_width^2 [1/rad^2]"""


def _make(fabric: Fabric, nodes: Any, means: Any, precision: Any) -> dict[str, Any]:
    width = max(fabric.masking_width, NARROWEST_MASKING)
    return {"precision": precision(2.0 / width**2)}


@njit(**INLINE)
def masked(R, x, y, u):
    """`(1-u) x y + u min(x, y)` of two clamped cosines: `M` or `P`."""
    return x * y + u * (min(x, y) - x * y)


@njit(**INLINE)
def _overlap(R, tables, cos_half):
    """`u` = exp(-d^2/(2 width^2)), in [0, 1], for angles that differ by d."""
    half = acos(R, cos_half)
    return exp(R, -tables.precision * half * half)


@njit(**INLINE)
def _shared(R, tables, thread_set, across_o, cos_half):
    """`u` of the longitudes, which a tangent angle shifts equally."""
    return _overlap(R, tables, cos_half)


@njit(**INLINE)
def _weight(R, tables, c, s, pair):
    """`P` at the tangent angle with cosine c and sine s."""
    x = max(s * pair.along_i + c * pair.up_i, R(0)) * pair.scale_i
    y = max(s * pair.along_o + c * pair.up_o, R(0)) * pair.scale_o
    return masked(R, x, y, pair.shared)


@njit(**INLINE)
def _mask(R, tables, cos_phi_i, cos_phi_o, cos_half):
    """`M`."""
    return masked(R, max(cos_phi_i, R(0)), max(cos_phi_o, R(0)), _overlap(R, tables, cos_half))


@njit(**INLINE)
def _total(R, tables, seen, ox, oy, oz):
    """`Q`."""
    return seen + tables.gap * oz


def plain_masked(x: Array, y: Array, width: float) -> Array:
    """The fraction seen and lit: `M` of azimuths phi, `P` of longitudes psi [rad]. Section 4."""
    mx, my = np.maximum(np.cos(x), 0), np.maximum(np.cos(y), 0)
    u = np.exp(-(wrap(x - y) ** 2) / (2 * width**2))
    return (1 - u) * mx * my + u * np.minimum(mx, my)


def _plain_weight(fabric: Fabric, is_warp: bool, psi0: Any, i: Angles, o: Angles) -> Array:
    return plain_masked(i.psi, o.psi, fabric.masking_width)


def _plain_mask(fabric: Fabric, i: Angles, o: Angles) -> Array:
    return plain_masked(i.phi, o.phi, fabric.masking_width)


def _plain_total(fabric: Fabric, seen: Array, gap: float, wo: Array) -> Array:
    return np.asarray(seen + gap * wo[..., 2])


LAW = Law(
    summary="the 2013 paper's masking and reweighting",
    tables=Masked,
    make=_make,
    absolute=False,
    shared=_shared,
    hides=no,
    view_place=no_place,
    visible_shares=all_visible,
    view_shares=no_shares,
    weight=_weight,
    mask=_mask,
    total=_total,
    openness=same_gap,
    node_room=no_room,
    light_nodes=no_nodes,
    lit_node=always_lit,
    lit_alone=lit_alone,
    plain_weight=_plain_weight,
    plain_mask=_plain_mask,
    plain_total=_plain_total,
)
