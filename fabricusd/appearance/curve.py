"""The tangent curve along one visible run of a thread: angle, height, quadrature.

Everything is per unit of the run's length: a position `s` goes from 0 to 1 over the run, a height
is in run lengths. A segment of zero length is a jump; it has no weight, and the curve is
right-continuous there. Source: [Bisker2011] section 5.2.1; `docs/model.md` section 3.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import erf

from fabricusd.errors import FabricError
from fabricusd.fabric import PILE_ANGLE, TangentCurve

Floats = NDArray[np.float64]

CLOSING_ERROR = 1e-3
"""Share of its own height by which a curve may fail to come back to 0 before it counts as pile.
Curves typed with two decimals miss by less; a thread that really climbs misses by all of it."""


class Pieces(NamedTuple):
    """The linear pieces of a curve, those of zero length left out.

    start, length : (p,) float - of each piece along the run, in run lengths; they tile [0, 1]
    first, last : (p,) float - tangent angle at both ends of the piece [rad]
    height : (p,) float - height at the start of the piece, in run lengths
    """

    start: Floats
    length: Floats
    first: Floats
    last: Floats
    height: Floats


class Nodes(NamedTuple):
    """Quadrature nodes of a curve: position (q,), angle (q,) [rad], weight (q,), which sum to 1."""

    position: Floats
    angle: Floats
    weight: Floats


def pieces(curve: TangentCurve) -> Pieces:
    """The linear pieces of `curve`, with the height at the start of each."""
    x = np.asarray(curve.positions, np.float64)
    a = np.asarray(curve.angles, np.float64)
    x = (x - x[0]) / (x[-1] - x[0])
    keep = np.diff(x) > 0
    start, length = x[:-1][keep], np.diff(x)[keep]
    first, last = a[:-1][keep], a[1:][keep]
    rise = _rise(first, last, length)
    height = np.concatenate(([0.0], np.cumsum(rise)[:-1]))
    return Pieces(start, length, first, last, height)


def _rise(first: Floats, last: Floats, length: Floats) -> Floats:
    """Minus the integral of tan(angle) over pieces whose angle goes from `first` to `last`.

    `d/da log cos a = -tan a`, so it is `length (log cos last - log cos first)/(last - first)`,
    written with log1p so that it stays exact where the angle hardly changes. Angles of 90 degrees
    give an infinite height; `is_pile` asks before anyone uses it.
    """
    change = last - first
    middle = 0.5 * (first + last)
    with np.errstate(divide="ignore", invalid="ignore"):
        # cos last / cos first - 1, by the sum-to-product identity
        ratio = -2.0 * np.sin(middle) * np.sin(0.5 * change) / np.cos(first)
        closed = np.log1p(np.maximum(ratio, -1.0)) / change
    small = np.abs(change) < 1e-9
    return length * np.where(small, -np.tan(middle), closed)


def _piece_at(p: Pieces, s: Floats) -> NDArray[np.intp]:
    return np.clip(np.searchsorted(p.start, s, side="right") - 1, 0, len(p.start) - 1)


def angle_at(curve: TangentCurve, s: ArrayLike) -> Floats:
    """Tangent angle [rad] at positions `s` (...) in run lengths, right-continuous at a jump."""
    p = pieces(curve)
    s = np.asarray(s, np.float64)
    k = _piece_at(p, s)
    return p.first[k] + (p.last[k] - p.first[k]) * ((s - p.start[k]) / p.length[k])


def height_at(curve: TangentCurve, s: ArrayLike) -> Floats:
    """Height at positions `s` (...), in run lengths: minus the integral of tan(angle) from 0 to s.

    Zero for pile, which has no height field. Its derivative is `-tan(angle_at(curve, s))`.
    """
    s = np.asarray(s, np.float64)
    if is_pile(curve):
        return np.zeros_like(s)
    p = pieces(curve)
    k = _piece_at(p, s)
    part = s - p.start[k]
    angle = p.first[k] + (p.last[k] - p.first[k]) * (part / p.length[k])
    return p.height[k] + _rise(p.first[k], angle, part)


def peak(curve: TangentCurve) -> float:
    """The highest height along the run, in run lengths; 0 for pile."""
    return float(height_at(curve, crest(curve)).max())


def crest(curve: TangentCurve) -> Floats:
    """(q, 2) stretches of the run, first and last position, where its height is the greatest.

    A hump has a crest of one point. Pile, like a straight thread, is one crest from end to end.
    """
    if is_pile(curve):
        return np.array([[0.0, 1.0]])
    p = pieces(curve)
    # The height turns where the angle passes 0, inside a piece, or at a piece's border.
    change = np.where(p.last == p.first, 1.0, p.last - p.first)
    turn = p.start + p.length * np.clip(-p.first / change, 0.0, 1.0)
    level = (p.first == 0.0) & (p.last == 0.0)
    stretches = np.concatenate(
        (
            np.stack((turn, turn), axis=1),
            np.stack((p.start, np.where(level, p.start + p.length, p.start)), axis=1),
            [[1.0, 1.0]],
        )
    )
    height = height_at(curve, stretches[:, 0])
    highest = height >= height.max() - 1e-9
    return np.unique(stretches[highest], axis=0)


def is_pile(curve: TangentCurve) -> bool:
    """Whether the curve stands up from the cloth: steeper than 85 degrees, or not closing at 0."""
    if curve.steepest > PILE_ANGLE:
        return True
    p = pieces(curve)
    rise = _rise(p.first, p.last, p.length)
    return bool(abs(rise.sum()) > CLOSING_ERROR * np.abs(rise).sum())


def nodes(curve: TangentCurve, spacing: float, *, error: float | None = None) -> Nodes:
    """Midpoint nodes of the curve, at most `spacing` [rad] apart in angle on each linear piece.

    spacing : the thread's surface lobe width `gs`; the mean over the curve of a lobe that wide is
        then within about 0.2 % on the published fabrics
    error : where given, the nodes are refined until `lobe_error(curve, nodes, spacing)` is at most
        this

    A piece of one angle takes one node. The weights are the pieces' lengths, and sum to 1.
    """
    if not spacing > 0:
        raise FabricError("spacing", f"is {spacing}; it must be above 0")
    if error is not None and not error > 0:
        raise FabricError("error", f"is {error}; it must be above 0")
    step = spacing
    found = _midpoints(curve, step)
    while error is not None and (miss := lobe_error(curve, found, spacing)) > error:
        # The midpoint rule is of second order; 0.7 keeps the step from shrinking by inches.
        step *= min(0.7, math.sqrt(error / miss))
        found = _midpoints(curve, step)
    return found


def _midpoints(curve: TangentCurve, step: float) -> Nodes:
    p = pieces(curve)
    # A piece of exactly `step` takes one node, whatever rounding says.
    count = np.maximum(1, np.ceil(np.abs(p.last - p.first) / step - 1e-9)).astype(np.int64)
    k = np.repeat(np.arange(len(count)), count)
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    share = (within + 0.5) / count[k]
    return Nodes(
        p.start[k] + p.length[k] * share,
        p.first[k] + (p.last[k] - p.first[k]) * share,
        p.length[k] / count[k],
    )


def lobe_error(curve: TangentCurve, q: Nodes, width: float) -> float:
    """Worst error of the nodes on a Gaussian lobe of standard deviation `width` [rad].

    The mean of the lobe over the curve has a closed form in erf; the answer is the greatest
    difference over all centres of the lobe, relative to the greatest mean.
    """
    p = pieces(curve)
    reach = float(np.abs([p.first, p.last]).max()) + 3.0 * width
    centre = np.arange(-reach, reach + 0.25 * width, 0.25 * width)[:, None]
    scale = 1.0 / (math.sqrt(2.0) * width)
    change = np.where(np.abs(p.last - p.first) < 1e-9, 1.0, p.last - p.first)
    area = math.sqrt(math.pi / 2.0) * width
    swept = area * (erf((p.last - centre) * scale) - erf((p.first - centre) * scale)) / change
    flat = np.exp(-(((p.first - centre) * scale) ** 2))
    exact = np.where(np.abs(p.last - p.first) < 1e-9, flat, swept) @ p.length
    found = np.exp(-(((q.angle - centre) * scale) ** 2)) @ q.weight
    return float(np.abs(found - exact).max() / exact.max())
