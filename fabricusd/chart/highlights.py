"""Highlights of cloth wrapped round a cylinder: where its tangent curve puts them, and where they
appear.

The cylinder stands upright; the viewer looks at it along the z axis from far away, and the light is
far away, too. A place is the angle `p` [rad] to the right of the viewer's side, which is `sin p`
radii across in the picture. A thread that runs round the cylinder and has the tangent angle `psi0`
at `p` has the tangent `(cos(p + psi0), 0, -sin(p + psi0))`. A highlight lies where
`theta_i = -theta_o`, that is, where the tangent is perpendicular to `wi + wo`. Each angle at which
the curve stays for a while makes a highlight of its own; in between, the curve spends too little
length at any angle for a highlight to be seen.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks

from fabricusd.fabric import TangentCurve

Floats = NDArray[np.float64]

PROMINENCE = 0.02
"""How far a highlight must rise above both its sides, relative to the maximum of the profile."""


def dwells(curve: TangentCurve) -> tuple[float, ...]:
    """Tangent angles [rad] at which a curve stays for some length, in ascending order."""
    p, a = np.array(curve.positions), np.array(curve.angles)
    still = (np.diff(p) > 0) & (np.diff(a) == 0)
    return tuple(sorted({float(x) for x in a[:-1][still]}))


def predicted(curve: TangentCurve, to_light: Floats) -> tuple[float, ...]:
    """Places `p` [rad] of the highlights of a thread round the cylinder, from left to right.

    to_light : (3,) unit vector; the viewer looks from (0, 0, 1)
    """
    x, _, z = (float(c) for c in to_light)
    middle = math.atan2(x, z + 1.0)
    places = sorted(middle - psi0 for psi0 in dwells(curve))
    return tuple(p for p in places if abs(p) < 0.5 * math.pi)


def found(profile: Floats, noise: float = 0.0) -> tuple[float, ...]:
    """Places [rad] of the highlights in the radiance (n,) across the width of a cylinder.

    noise : standard deviation of a smoothing filter, in columns
    """
    smooth = gaussian_filter1d(profile, noise) if noise else profile
    peaks, _ = find_peaks(smooth, prominence=PROMINENCE * float(smooth.max()))
    x = (peaks + 0.5) / len(profile) * 2.0 - 1.0
    return tuple(float(p) for p in np.arcsin(x))
