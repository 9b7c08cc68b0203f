"""Look up lobe shares in tables by view, and draw uniform directions."""

from __future__ import annotations

import math

from numba import njit

from fabricusd.appearance.sampling.share_fit import AZIMUTHS, ELEVATIONS
from fabricusd.kernels.real import INLINE, atan2, cos, sin


@njit(**INLINE)
def view_corner(R, ox, oy, oz):
    """Place of a view on the grid of shares: (row, two columns, and the fractions between them)."""
    flat = math.sqrt(ox * ox + oy * oy)
    e = atan2(R, flat, max(oz, R(0))) * R((ELEVATIONS - 1) / (0.5 * math.pi))
    row = min(int(e), ELEVATIONS - 2)
    a = atan2(R, oy, ox) * R(AZIMUTHS / (2 * math.pi))
    a = a if a >= R(0) else a + R(AZIMUTHS)
    column = min(int(a), AZIMUTHS - 1)
    return row, column, (column + 1) % AZIMUTHS, e - R(row), a - R(column)


@njit(**INLINE)
def share_at(R, shares, corner, k):
    """Share of lobe k at a view, interpolated bilinearly."""
    row, column, following, e, a = corner
    low = shares[row, column, k] + a * (shares[row, following, k] - shares[row, column, k])
    row += 1
    high = shares[row, column, k] + a * (shares[row, following, k] - shares[row, column, k])
    return low + e * (high - low)


@njit(**INLINE)
def uniform_direction(R, u1, u2):
    """A direction (x, y, z), uniform over the upper hemisphere."""
    flat = math.sqrt(max(R(0), (R(1) - u1) * (R(1) + u1)))
    phi = R(2 * math.pi) * u2
    return flat * cos(R, phi), flat * sin(R, phi), u1
