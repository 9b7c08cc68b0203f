"""The tangent curve along one visible run of a thread: angle and height.

Everything is per unit of the run's length: a position `s` goes from 0 to 1 over the run, a height
is in run lengths. A segment of zero length is a jump; it has no weight, and the curve is
right-continuous there. Source: [Bisker2011] section 5.2.1; `docs/model.md` section 3.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fabricusd.fabric import PILE_ANGLE, TangentCurve

Floats = NDArray[np.float64]

CLOSING_ERROR = 1e-3
"""Share of its own height by which a curve may fail to come back to 0 before it counts as pile.
Curves typed with two decimals miss by less; a thread that really climbs misses by all of it."""


class Pieces(NamedTuple):
    """The linear pieces of a curve, those of zero length left out.

    start, length : (p,) float - of each piece along the run, in run lengths; they tile [0, 1]
    first, last : (p,) float - tangent angle at both ends of the piece [rad]
    height : (p,) float - height at the start of the piece, in run lengths; 0 for a curve that is
        too steep to have one
    """

    start: Floats
    length: Floats
    first: Floats
    last: Floats
    height: Floats


def pieces(curve: TangentCurve) -> Pieces:
    """The linear pieces of `curve`, with the height at the start of each."""
    x = np.asarray(curve.positions, np.float64)
    a = np.asarray(curve.angles, np.float64)
    x = (x - x[0]) / (x[-1] - x[0])
    keep = np.diff(x) > 0
    start, length = x[:-1][keep], np.diff(x)[keep]
    first, last = a[:-1][keep], a[1:][keep]
    height = np.zeros(len(start))
    if curve.steepest <= PILE_ANGLE:
        height[1:] = np.cumsum(_rise(first, last, length))[:-1]
    return Pieces(start, length, first, last, height)


def _rise(first: Floats, last: Floats, length: Floats) -> Floats:
    """Minus the integral of tan(angle) over pieces whose angle goes from `first` to `last`.

    `d/da log cos a = -tan a`, so it is `length (log cos last - log cos first)/(last - first)`,
    written with log1p so that it stays exact where the angle hardly changes. Only for angles of
    less than 90 degrees; the callers leave pile out.
    """
    change = last - first
    middle = 0.5 * (first + last)
    small = np.abs(change) < 1e-9
    # cos last / cos first - 1, by the sum-to-product identity
    ratio = -2.0 * np.sin(middle) * np.sin(0.5 * change) / np.cos(first)
    return length * np.where(small, -np.tan(middle), np.log1p(ratio) / np.where(small, 1.0, change))


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
