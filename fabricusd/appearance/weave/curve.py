"""Evaluate the tangent curve along a visible run of a thread: its angle and its height.

All lengths are relative to the length of the run: a position `s` goes from 0 to 1 over the run, and
heights are in run lengths. A segment of zero length is a jump; it has no weight, and the curve is
right-continuous there. Source: [Bisker2011] section 5.2.1; `docs/model.md` section 3.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fabricusd.fabric import PILE_ANGLE, TangentCurve

Floats = NDArray[np.float64]

CLOSING_ERROR = 1e-3
"""Largest closing error of a curve that is not pile, as a fraction of the sum of its rises and
falls. Curves typed with two decimals stay below it; a thread that really climbs fails to close by
its whole height."""


class Pieces(NamedTuple):
    """The linear pieces of a curve, without those of zero length.

    start, length : (p,) float - start and length of each piece, in run lengths; they tile [0, 1]
    first, last : (p,) float - tangent angle at both ends of the piece [rad]
    height : (p,) float - height at the start of the piece, in run lengths; 0 if the curve is too
        steep to have a height
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

    Since `d/da log cos a = -tan a`, it is `length (log cos last - log cos first)/(last - first)`,
    written with log1p to stay exact where the angle hardly changes. The angles must be below 90
    degrees; callers leave out pile.
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

    The derivative of the height is `-tan(angle_at(curve, s))`. Pile has no height field; its height
    is 0.
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
    """The greatest height along the run, in run lengths; 0 for pile."""
    return float(height_at(curve, crest(curve)).max())


def crest(curve: TangentCurve) -> Floats:
    """(q, 2) first and last positions of the intervals of the run where its height is greatest.

    The crest of a hump is a single point. Pile, like a straight thread, is one crest from end to
    end.
    """
    if is_pile(curve):
        return np.array([[0.0, 1.0]])
    p = pieces(curve)
    # The height has an extremum where the angle passes 0: inside a piece or at the border of one.
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
    """Whether the curve stands up from the cloth: it is steeper than 85 degrees or does not close
    at height 0."""
    if curve.steepest > PILE_ANGLE:
        return True
    p = pieces(curve)
    rise = _rise(p.first, p.last, p.length)
    return bool(abs(rise.sum()) > CLOSING_ERROR * np.abs(rise).sum())
