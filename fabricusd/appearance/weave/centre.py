"""The line along which a thread's section is swept: the curve where it is seen, a cubic where not.

The tangent curve lies once over each run that is seen, from edge to edge of the threads that cross
over it. What is hidden between two runs is the cubic that goes on from one to the other without a
kink, at height 0 at both ends as the curve is.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.bands import seen_length
from fabricusd.appearance.weave.curve import angle_at, height_at
from fabricusd.fabric import TangentCurve

Floats = NDArray[np.float64]

RINGS = 16
"""Sections a cell: the hump of linen is then off by .2 % of its height."""


def centre_line(
    curve: TangentCurve, on_top: NDArray[np.bool_], pitch: float, cross_width: float
) -> tuple[Floats, Floats]:
    """Height [m] and tangent angle [rad], each (n RINGS,), at the middles of RINGS parts of a cell.

    on_top : (n,) - the cells of one repeat along the thread in which it is on top
    pitch : of the threads that cross it [m]; cross_width : their width, share of that pitch

    A thread that is never on top lies straight at height 0.
    """
    n = len(on_top)
    s = (np.arange(n * RINGS) + 0.5) / RINGS
    z, psi = np.zeros(len(s)), np.zeros(len(s))
    if curve.is_straight or not on_top.any():
        return z, psi
    if on_top.all():
        return height_at(curve, s / n) * n * pitch, angle_at(curve, s / n)
    first, last = -math.tan(curve.angles[-1]), -math.tan(curve.angles[0])
    rim = 0.5 * (1.0 - cross_width)
    starts = np.flatnonzero(on_top & ~np.roll(on_top, 1))
    ends = np.flatnonzero(on_top & ~np.roll(on_top, -1))
    # From the start of each run to its last cell, and on to the next start.
    run = np.mod(np.roll(ends, -1) - starts if ends[0] < starts[0] else ends - starts, n) + 1
    hidden = np.mod(np.roll(starts, -1) - starts - 1, n) + 1 - run
    of = np.searchsorted(starts, np.mod(s + rim, n), side="right") - 1
    t = np.mod(s - (starts[of] - rim), n)
    length = np.array([seen_length(x, cross_width) for x in run])[of]
    below = (hidden - 1.0 + cross_width)[of]
    shown = t < length
    q = t[shown] / length[shown]
    psi[shown], z[shown] = angle_at(curve, q), height_at(curve, q) * length[shown] * pitch
    under = ~shown
    q = (t[under] - length[under]) / below[under]
    z[under] = below[under] * pitch * ((q**3 - 2 * q**2 + q) * first + (q**3 - q**2) * last)
    psi[under] = -np.arctan((3 * q**2 - 4 * q + 1) * first + (3 * q**2 - 2 * q) * last)
    return z, psi
