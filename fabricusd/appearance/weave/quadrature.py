"""Nodes over the tangent curves of a fabric, and which rule meets a bound at the least cost.

Two rules. `POINTS` puts Gauss-Legendre points on each linear piece of a curve, at most some number
of surface lobe widths apart: the integrand is smooth but for the masking's corners, and the error
falls five to ten times below that of as many midpoints. `CELLS` puts midpoints whose lobes are
averaged over the node's own stretch of angle by the error function: one such node costs as much as
`ERF_COST` points, and its stretch may be many lobe widths, so it pays where lobes are narrow.
Source: `docs/model.md` section 4; both rules are measured by `bench/far_quadrature.py`.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage
from fabricusd.appearance.weave.curve import Pieces, pieces
from fabricusd.fabric import Fabric, TangentCurve

Floats = NDArray[np.float64]

POINTS, CELLS = "points", "cells"

ERF_COST = 1.8
"""Time of a node with error functions over that of one without, measured on both precisions."""


class Rule(NamedTuple):
    """A quadrature rule.

    form : POINTS or CELLS
    spacing : how far apart nodes are in tangent angle, at most: in widths of the thread's surface
        lobe for POINTS, in radians for CELLS, whose lobes are exact and whose other factors are not
    """

    form: str
    spacing: float


DEFAULT = Rule(POINTS, 1.0)
"""Mean error 0.5 % on the widest lobes (linen), below 0.12 % on the other published fabrics."""

NARROW = Rule(CELLS, math.radians(5.0))
"""What a fabric takes whose lobes are so narrow that it would take more than MOST_NODES points:
mean error below 0.3 %."""

MOST_NODES = 96

CANDIDATES = (
    *(Rule(CELLS, math.radians(x)) for x in (20.0, 10.0, 5.0, 2.5, 1.25, 0.6, 0.3)),
    *(Rule(POINTS, x) for x in (3.0, 2.0, 1.5, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.1, 0.05)),
)
"""Rules that a bound on the error chooses from, see `accuracy`."""

MOST_POINTS = 16
"""Points that one Gauss-Legendre panel has at most; making more takes longer than they save."""

MOST_NODES_EVER = 1024
"""Narrow lobes ask for points without end; no rule with more nodes than this is tried."""

REFERENCES = (Rule(POINTS, 0.03), Rule(CELLS, math.radians(0.1)))
"""Rules that the others are measured against: the points, unless they are too many."""


class CurveNodes(NamedTuple):
    """Nodes of every thread type in every set that covers anything, weft first.

    psi0 : (q,) - tangent angle [rad]
    weight : (q,) - share of the cloth's area; they sum to 1 - gap
    half : (q,) - half the stretch of angle that the node stands for [rad]; 0 for a point
    thread : (q,) int32 - index into `Fabric.threads`
    warp_start : int - nodes before it are weft, from it on warp
    """

    psi0: Floats
    weight: Floats
    half: Floats
    thread: NDArray[np.int32]
    warp_start: int

    @property
    def cost(self) -> float:
        """In evaluations of a thread's two lobes."""
        return len(self.psi0) + (ERF_COST - 1.0) * float(np.count_nonzero(self.half))


def curve_nodes(fabric: Fabric, rule: Rule = DEFAULT) -> CurveNodes:
    """The nodes of `rule` over the fabric's curves. Pieces of one angle take one node."""
    area = coverage(fabric).type_area
    found: list[tuple[Floats, Floats, Floats]] = []
    owner: list[NDArray[np.int32]] = []
    counts = {WEFT: 0, WARP: 0}
    for j in (WEFT, WARP):
        for k, thread in enumerate(fabric.thread_list):
            if area[j, k] > 0:
                psi0, weight, half = _of_curve(thread.curve, thread.gamma_surface, rule)
                found.append((psi0, weight * area[j, k], half))
                owner.append(np.full(len(psi0), k, np.int32))
                counts[j] += len(psi0)
    if not found:
        nothing = np.zeros(0)
        return CurveNodes(nothing, nothing, nothing, np.zeros(0, np.int32), 0)
    psi0, weight, half = (np.concatenate([f[i] for f in found]) for i in range(3))
    return CurveNodes(psi0, weight, half, np.concatenate(owner), counts[WEFT])


def count_nodes(fabric: Fabric, rule: Rule) -> int:
    """How many nodes `curve_nodes` would make, without making them: lobes may be very narrow."""
    area = coverage(fabric).type_area
    return sum(
        int(_counts(pieces(t.curve), t.gamma_surface, rule).sum())
        for j in (WEFT, WARP)
        for k, t in enumerate(fabric.thread_list)
        if area[j, k] > 0
    )


def default_rule(fabric: Fabric, *, cells: bool = True) -> Rule:
    """`DEFAULT`, or `NARROW` where points would be too many.

    cells : whether the threads' lobes have means over cells; without them points lie farther apart
    """
    if cells:
        return DEFAULT if count_nodes(fabric, DEFAULT) <= MOST_NODES else NARROW
    return fewer_points(fabric, DEFAULT.spacing, MOST_NODES)


def fewer_points(fabric: Fabric, spacing: float, most: int) -> Rule:
    """Points `spacing` lobe widths apart, or as much farther as it takes for at most `most`."""
    while count_nodes(fabric, Rule(POINTS, spacing)) > most and spacing < 1e9:
        spacing *= 1.5
    return Rule(POINTS, spacing)


def _counts(p: Pieces, width: float, rule: Rule) -> NDArray[np.int64]:
    step = rule.spacing * width if rule.form == POINTS else rule.spacing
    # A piece of exactly `step` takes one node, whatever rounding says.
    count = np.maximum(np.ceil(np.abs(p.last - p.first) / step - 1e-9), 1)
    if rule.form == POINTS:
        panels = np.ceil(count / MOST_POINTS)
        count = panels * np.ceil(count / panels)
    return np.asarray(count, np.int64)


@lru_cache(maxsize=256)
def _gauss(count: int) -> tuple[Floats, Floats]:
    """Points and weights over [-1, 1], in panels of equally many points, at most MOST_POINTS."""
    panels = math.ceil(count / MOST_POINTS)
    x, w = np.polynomial.legendre.leggauss(count // panels)
    centre = (2 * np.arange(panels) + 1) / panels - 1
    return (centre[:, None] + x / panels).ravel(), np.tile(w / panels, panels)


def _of_curve(curve: TangentCurve, width: float, rule: Rule) -> tuple[Floats, Floats, Floats]:
    p = pieces(curve)
    psi0, weight, half = [], [], []
    for first, last, length, n in zip(
        p.first, p.last, p.length, _counts(p, width, rule), strict=True
    ):
        middle, change = 0.5 * (first + last), 0.5 * (last - first)
        if rule.form == POINTS:
            x, w = _gauss(int(n))
            psi0.append(middle + change * x)
            weight.append(0.5 * length * w)
            half.append(np.zeros(n))
        else:
            psi0.append(middle + change * ((2 * np.arange(n) + 1) / n - 1))
            weight.append(np.full(n, length / n))
            half.append(np.full(n, abs(change) / n))
    return np.concatenate(psi0), np.concatenate(weight), np.concatenate(half)
