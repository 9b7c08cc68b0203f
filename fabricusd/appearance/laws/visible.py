"""Surface law `visible`: `projected`, less what neighbouring threads hide from the viewer.

The weight of `projected` is multiplied by the share of the places with a tangent angle that the
viewer sees. Places are hidden from a viewer as they are from a light, so the share is the mean of
`g` for light from wo over those places. For each set it is kept, by view, as

    v = v0 + v1 s + v2 s^2 + v4 s^4,   s the sine of the tangent angle,

which is smooth along a thread, so that means over the curve stay exact. On explicit threads more
terms gain nothing (`python bench/model/hidden_from_view.py`). Places that are both lit and seen are
taken to be independent: a dependence that grows as light and viewer come together changes nothing
there. Without a shadow all places are seen.

Light passes the cloth by the gap(w) that the fabric states, which is that of its tubes
(`fabricusd.sides`): satin, which has no gap from above, is open from aside beside the dips of its
warps. Where a fabric states none, gap(w) is that of `projected`. Source: ours, docs/decisions/017.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.conserving.by_side import by_side
from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.laws import projected
from fabricusd.appearance.laws.excess import COLUMNS as AROUND
from fabricusd.appearance.laws.excess import EXCESS_FIELDS, by_view, view
from fabricusd.appearance.laws.excess import ROWS as RINGS
from fabricusd.appearance.laws.law import tables_class, yes
from fabricusd.appearance.laws.lit import AZIMUTHS, LIGHT_FIELDS, ROWS, column_of, row_of
from fabricusd.appearance.scattering.plain_lobes import Array
from fabricusd.appearance.weave.quadrature import CurveNodes
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import INLINE, index

Floats = NDArray[np.float64]

COLUMNS, HEIGHTS = 64, 33
"""Azimuths and elevations of the table of shares: what is seen changes more slowly than what is
lit, since it only weighs."""

TERMS = 4
"""Coefficients of a share: those of 1, s, s^2 and s^4."""

LEAST = 0.01
"""Least share that thread counts with, for views from which the polynomial is below."""

SEEN_FIELDS = ("gaps", "shares", "share_columns", "share_numbers")
"""gaps : (ROWS, COLUMNS + 1) real, flat - gap(w), as a table of `excess.by_view`
shares : (share_columns + 1, HEIGHTS, 2 sets, TERMS) real, flat
share_columns : int - COLUMNS, or 1 without a shadow
share_numbers : int - 2 * TERMS, as a number that the compiler does not know. Were it known, the
    loop over it would be unrolled, and a view would take four times as long"""

Visible = tables_class(
    __name__, "Visible", "wide_2", "tall_2", *LIGHT_FIELDS, *EXCESS_FIELDS, *SEEN_FIELDS
)


def _make(fabric: Fabric, nodes: CurveNodes, means: Any, precision: Any) -> dict[str, Any]:
    if means is None:
        shares = np.zeros((2, HEIGHTS, 2, TERMS))
        shares[..., 0] = 1.0
    else:
        shares = _shares(nodes, means)
    views = np.array([[view(row, column) for column in range(AROUND + 1)] for row in range(RINGS)])
    gaps = _openness_of(fabric, views).reshape(-1)
    return {
        **projected.LAW.make(fabric, nodes, means, precision),
        "gaps": np.ascontiguousarray(gaps, dtype=precision),
        "excess": np.ascontiguousarray(1.0 / (1.0 - gaps), dtype=precision),
        "shares": np.ascontiguousarray(shares.reshape(-1), dtype=precision),
        "share_columns": len(shares) - 1,
        "share_numbers": 2 * TERMS,
    }


def _openness_of(fabric: Fabric, w: Floats) -> Floats:
    """(...) gap(w) of unit vectors w (..., 3); below 1 by LEAST at least."""
    gap = projected.plain_openness(fabric, w)
    if fabric.sides.gap and not fabric.opaque:
        theta, phi = np.arccos(np.clip(w[..., 2], -1.0, 1.0)), np.arctan2(w[..., 1], w[..., 0])
        gap = by_side(fabric, theta, phi).gap
    return np.minimum(gap, 1.0 - LEAST)


def _shares(nodes: CurveNodes, means: Floats) -> Floats:
    """(COLUMNS + 1, HEIGHTS, 2, TERMS) `shares` from the means of g at the nodes, nearest by area.

    means : (AZIMUTHS + 1, ROWS, nodes)
    """
    few = np.clip(means[:: AZIMUTHS // COLUMNS, :: (ROWS - 1) // (HEIGHTS - 1)], 0.0, 1.0)
    found = np.zeros((*few.shape[:2], 2, TERMS))
    for which, mine in (
        (WEFT, slice(0, nodes.warp_start)), (WARP, slice(nodes.warp_start, None))
    ):  # fmt: skip
        s, area = np.sin(nodes.psi0[mine]), np.sqrt(nodes.weight[mine])
        if not len(s):
            continue
        terms = np.stack((np.ones_like(s), s, s**2, s**4), axis=1) * area[:, None]
        # Curves of few angles leave some terms open: those are the smallest that fit.
        found[:, :, which] = few[..., mine] @ (np.linalg.pinv(terms, rcond=1e-6) * area).T
    return found


@njit(**INLINE)
def _view_place(R, tables, ox, oy, oz):
    """(entry of the table, weights of the next column and row) for a view."""
    column, c = column_of(R, tables.share_columns, ox, oy)
    row, r = row_of(R, HEIGHTS, oz)
    return (column * np.int32(HEIGHTS) + row) * np.int32(2 * TERMS), c, r


@njit(**INLINE)
def _visible_shares(R, tables, thread_set, entry, c, r):
    """(v0, v1, v2, v4) of a set for a view."""
    here = np.int32(entry) + np.int32(thread_set * TERMS)
    beside = here + np.int32(2 * TERMS * HEIGHTS)
    return (
        _between(R, tables.shares, here, beside, c, r),
        _between(R, tables.shares, here + 1, beside + 1, c, r),
        _between(R, tables.shares, here + 2, beside + 2, c, r),
        _between(R, tables.shares, here + 3, beside + 3, c, r),
    )


@njit(**INLINE)
def _between(R, shares, here, beside, c, r):
    """A coefficient between the entry `here`, that in the next column, and those of the next
    row."""
    step = 2 * TERMS
    low = shares[index(here, 0)]
    low += (shares[index(beside, 0)] - low) * c
    high = shares[index(here, step)]
    high += (shares[index(beside, step)] - high) * c
    return low + (high - low) * r


@njit(**INLINE)
def _view_shares(R, tables, entry, c, r, out, first):
    """Fill `out` with the coefficients of both sets for a view; the loop is vectorised."""
    shares, step = tables.shares, np.int32(2 * TERMS)
    here, beside = np.int32(entry), np.int32(entry) + step * np.int32(HEIGHTS)
    c_r, c_1 = c * r, c - c * r
    one_r = r - c_r
    one_1 = R(1) - c_1 - r
    for k in range(tables.share_numbers):
        out[index(first, k)] = (
            one_1 * shares[index(here, k)]
            + c_1 * shares[index(beside, k)]
            + one_r * shares[index(here + step, k)]
            + c_r * shares[index(beside + step, k)]
        )


@njit(**INLINE)
def _openness(R, tables, ox, oy, oz):
    return by_view(R, tables.gaps, ox, oy, oz)


@njit(**INLINE)
def _total(R, tables, seen, ox, oy, oz):
    return seen * by_view(R, tables.excess, ox, oy, oz)


def _plain_total(fabric: Fabric, seen: Array, gap: float, wo: Array) -> Array:
    return np.asarray(seen / (1.0 - _openness_of(fabric, np.asarray(wo))))


@njit(**INLINE)
def _weight(R, tables, c, s, pair):
    square = s * s
    share = pair.seen_0 + s * pair.seen_1 + square * (pair.seen_2 + square * pair.seen_4)
    return projected.weight(R, tables, c, s, pair) * max(share, R(LEAST))


LAW = replace(
    projected.LAW,
    summary="as `projected`, less what neighbours hide from the viewer, and with the gap that the "
    "fabric states: nearest to traced threads",
    tables=Visible,
    make=_make,
    hides=yes,
    view_place=_view_place,
    visible_shares=_visible_shares,
    view_shares=_view_shares,
    weight=_weight,
    total=_total,
    openness=_openness,
    plain_total=_plain_total,
)
