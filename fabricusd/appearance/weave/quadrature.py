"""Place quadrature nodes on the tangent curves of a fabric, and choose the rule that places them.

There are two forms of rule. `POINTS` puts Gauss-Legendre points on each linear piece of a curve, at
most a given number of surface lobe widths apart. The integrand is smooth except at the corners of
the masking, and the error is five to ten times smaller than with the same number of midpoints.
`CELLS` puts midpoints whose lobes are averaged over the node's range of angles by the error
function. Such a node costs as much as `ERF_COST` points, but its range may be many lobe widths, so
it pays off for narrow lobes. Source: `docs/model.md` section 4.
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
"""Cost of a node with error functions relative to one without, measured in both precisions."""


class Rule(NamedTuple):
    """A quadrature rule.

    form : POINTS or CELLS
    spacing : largest distance between nodes in tangent angle: in widths of the thread's surface
        lobe for POINTS; in radians for CELLS, whose lobes are integrated exactly, unlike the other
        factors
    """

    form: str
    spacing: float


DEFAULT = Rule(POINTS, 1.0)
"""Its mean error is below 0.2 % on the published fabrics, see docs/charts.md."""

WIDEST = math.radians(6.0)
"""Points are at most `spacing` times this apart [rad]: the weights of thread turn away from viewer
and light within few lobe widths where lobes are wide."""

NARROW = Rule(CELLS, math.radians(5.0))
"""The rule for fabrics with lobes so narrow that DEFAULT takes more than MOST_NODES points. Its
mean error is below 0.3 %."""

MOST_NODES = 96

CANDIDATES = (
    *(Rule(CELLS, math.radians(x)) for x in (20.0, 10.0, 5.0, 2.5, 1.25, 0.6, 0.3)),
    *(Rule(POINTS, x) for x in (3.0, 2.0, 1.5, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.1, 0.05)),
)
"""Rules that `accuracy.choose_rule` chooses from."""

MOST_POINTS = 16
"""Largest number of points in a Gauss-Legendre panel: computing more takes longer than they
save."""

MOST_NODES_EVER = 1024
"""Rules with more nodes than this are not tried: very narrow lobes would need points without
end."""

REFERENCES = (Rule(POINTS, 0.03), Rule(CELLS, math.radians(0.1)))
"""Rules against which the others are measured: the points, unless there are too many of them."""


class CurveNodes(NamedTuple):
    """The nodes of every thread type in every set where it covers anything, weft first.

    psi0 : (q,) - tangent angle [rad]
    weight : (q,) - share of the cloth's area; the weights sum to 1 - gap
    half : (q,) - half the range of angles that the node represents [rad]; 0 for a point
    thread : (q,) int32 - index into `Fabric.threads`
    warp_start : int - nodes before this index are weft, the others warp
    panel : (q,) int32 - number of the panel that a Gauss-Legendre point is of, ascending
    """

    psi0: Floats
    weight: Floats
    half: Floats
    thread: NDArray[np.int32]
    warp_start: int
    panel: NDArray[np.int32]

    @property
    def cost(self) -> float:
        """Cost in evaluations of a thread's two lobes."""
        return len(self.psi0) + (ERF_COST - 1.0) * float(np.count_nonzero(self.half))


def curve_nodes(fabric: Fabric, rule: Rule = DEFAULT) -> CurveNodes:
    """The nodes of `rule` on the fabric's curves. A piece of constant angle takes one node."""
    area = coverage(fabric).type_area
    found: list[tuple[Floats, ...]] = []
    owner: list[NDArray[np.int32]] = []
    counts = {WEFT: 0, WARP: 0}
    for j in (WEFT, WARP):
        for k, thread in enumerate(fabric.thread_list):
            if area[j, k] > 0:
                psi0, weight, half, panel = _of_curve(thread.curve, thread.gamma_surface, rule)
                found.append((psi0, weight * area[j, k], half, panel))
                owner.append(np.full(len(psi0), k, np.int32))
                counts[j] += len(psi0)
    if not found:
        nothing = np.zeros(0)
        none = np.zeros(0, np.int32)
        return CurveNodes(nothing, nothing, nothing, none, 0, none)
    psi0, weight, half, panel = (np.concatenate([f[i] for f in found]) for i in range(4))
    ends = np.concatenate(([0], np.cumsum([f[3][-1] + 1 for f in found])))[:-1]
    panel += np.repeat(ends, [len(f[3]) for f in found])
    owned = np.concatenate(owner)
    return CurveNodes(psi0, weight, half, owned, counts[WEFT], panel.astype(np.int32))


def shares(nodes: CurveNodes, mine: NDArray[np.int64], cuts: Floats) -> Floats:
    """(m, k) how much of each of k stretches of a curve each of its m nodes stands for, the sum
    over stretches being 1.

    mine : (m,) the nodes of one type in one set; cuts : (k + 1,) ends of stretches from 0 to 1

    What scatters is a polynomial over a panel of Gauss-Legendre points; with a factor that is not,
    such as a shadow, point i takes the factor's integral with the Lagrange polynomial of the point:
    product integration [Davis1984]. Where lobes are narrow the sum over points may fall below 0, by
    less than a hundredth of a lobe, where it should be nearly 0. A cell takes its own range.
    """
    weight = nodes.weight[mine] / nodes.weight[mine].sum()
    ends = np.concatenate(((0.0,), np.cumsum(weight)))
    found = np.zeros((len(mine), len(cuts) - 1))
    panel = nodes.panel[mine]
    for number in np.unique(panel):
        here = np.flatnonzero(panel == number)
        low, high = ends[here[0]], ends[here[-1] + 1]
        a, b = np.maximum(cuts[:-1], low), np.minimum(cuts[1:], high)
        on = np.flatnonzero(b - a > 1e-12)
        x = np.polynomial.legendre.leggauss(len(here))[0]
        t, v = np.polynomial.legendre.leggauss(MOST_POINTS // 2)
        # Places of the stretches' own points, from -1 to 1 over the panel.
        at = 0.5 * (a[on] + b[on])[:, None] + 0.5 * (b - a)[on][:, None] * t
        at = 2.0 * (at - low) / (high - low) - 1.0
        basis = np.ones((len(here), *at.shape))
        for i in range(len(here)):
            for j in range(len(here)):
                if j != i:
                    basis[i] *= (at - x[j]) / (x[i] - x[j])
        part = (basis * v).sum(axis=2) * 0.5 * (b - a)[on] / weight[here][:, None]
        found[np.ix_(here, on)] = part
    return found


def count_nodes(fabric: Fabric, rule: Rule) -> int:
    """The number of nodes that `curve_nodes` would make; narrow lobes may need too many to make."""
    area = coverage(fabric).type_area
    return sum(
        int(_counts(pieces(t.curve), t.gamma_surface, rule).sum())
        for j in (WEFT, WARP)
        for k, t in enumerate(fabric.thread_list)
        if area[j, k] > 0
    )


def default_rule(fabric: Fabric, *, cells: bool = True) -> Rule:
    """`DEFAULT`, or `NARROW` if there would be too many points.

    cells : whether the threads' lobes have means over cells; if not, points are spaced farther
        apart
    """
    if cells:
        return DEFAULT if count_nodes(fabric, DEFAULT) <= MOST_NODES else NARROW
    return fewer_points(fabric, DEFAULT.spacing, MOST_NODES)


def fewer_points(fabric: Fabric, spacing: float, most: int) -> Rule:
    """Points `spacing` lobe widths apart, or farther apart so that there are at most `most`."""
    while count_nodes(fabric, Rule(POINTS, spacing)) > most and spacing < 1e9:
        spacing *= 1.5
    return Rule(POINTS, spacing)


def _counts(p: Pieces, width: float, rule: Rule) -> NDArray[np.int64]:
    step = rule.spacing * (min(width, WIDEST) if rule.form == POINTS else 1.0)
    # The tolerance gives a piece of exactly `step` one node, in spite of rounding.
    count = np.maximum(np.ceil(np.abs(p.last - p.first) / step - 1e-9), 1)
    if rule.form == POINTS:
        panels = np.ceil(count / MOST_POINTS)
        count = panels * np.ceil(count / panels)
    return np.asarray(count, np.int64)


@lru_cache(maxsize=256)
def _gauss(count: int) -> tuple[Floats, Floats]:
    """Points and weights on [-1, 1], in panels of equally many points, at most MOST_POINTS each."""
    panels = math.ceil(count / MOST_POINTS)
    x, w = np.polynomial.legendre.leggauss(count // panels)
    centre = (2 * np.arange(panels) + 1) / panels - 1
    return (centre[:, None] + x / panels).ravel(), np.tile(w / panels, panels)


def _of_curve(curve: TangentCurve, width: float, rule: Rule) -> tuple[Floats, ...]:
    p = pieces(curve)
    psi0, weight, half, panel = [], [], [], []
    panels = 0
    for first, last, length, n in zip(
        p.first, p.last, p.length, _counts(p, width, rule), strict=True
    ):
        middle, change = 0.5 * (first + last), 0.5 * (last - first)
        if rule.form == POINTS:
            x, w = _gauss(int(n))
            psi0.append(middle + change * x)
            weight.append(0.5 * length * w)
            half.append(np.zeros(n))
            each = math.ceil(n / MOST_POINTS)
            panel.append(panels + np.repeat(np.arange(each), n // each))
            panels += each
        else:
            psi0.append(middle + change * ((2 * np.arange(n) + 1) / n - 1))
            weight.append(np.full(n, length / n))
            half.append(np.full(n, abs(change) / n))
            panel.append(panels + np.arange(n))
            panels += n
    return tuple(np.concatenate(one) for one in (psi0, weight, half, panel))
