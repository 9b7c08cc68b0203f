"""Read the horizon table at one place; `horizon_blocks` reads it at a block of places.

The azimuth is the diamond angle: it goes from 0 to 4, 1 per quadrant, and is linear in
`y/(|x| + |y|)` inside a quadrant. The *sine* of the elevation, with which the light is compared, is
interpolated between texels and azimuths.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.appearance.frame import WARP, diamond
from fabricusd.appearance.weave.lookup import FARTHEST, split, wrap
from fabricusd.kernels.real import INLINE


@njit(**INLINE)
def rows_of_texels(R, on_top, along, over, width, count, tiny):
    """Lower of the two rows of texels around a place along a thread, and the weight of the upper.

    along, over : place in the cell along the thread on top and across it
    width : of the thread on top. The thread underneath shows a strip on either side of it, and each
        strip has half the rows: nothing is interpolated across the thread between them.
    """
    behind = over > R(0.5)
    strip = max(R(0.5) * (R(1) - width), tiny)
    place = along if on_top else (over - (R(1) - strip) if behind else over) / strip
    # Selections, not branches: this is part of a loop that LLVM vectorises.
    half = count // 2
    rows = count if on_top else half
    x = max(R(0), min(place * R(rows) - R(0.5), R(rows - 1)))
    k = min(int(x), max(rows - 2, 0))
    return k + (half if behind and not on_top else 0), x - R(k)


@njit(**INLINE)
def _between(R, table, i, j, slot, row, first, second, c):
    """A texel's horizon, interpolated from the azimuth `first` to `second` by c in [0, 1]."""
    low = R(table[i, j, slot, row, first])
    return low + (R(table[i, j, slot, row, second]) - low) * c


@njit(**INLINE)
def entry_at(table, kinds, u, v):
    """Entry of the table at weave coordinates (float64); that of the first cell if they are not
    finite or lie beyond FARTHEST."""
    sound = abs(u) <= FARTHEST and abs(v) <= FARTHEST
    end, pick = np.floor(u) if sound else 0.0, np.floor(v) if sound else 0.0
    if kinds.size == 0:
        return wrap(end, table.shape[0]), wrap(pick, table.shape[1])
    return 0, int(kinds[wrap(end, kinds.shape[0]), wrap(pick, kinds.shape[1])])


@njit(**INLINE)
def horizon_at(R, cloth, table, kinds, u, v, which, x, y):
    """Sine of the horizon's elevation towards (x, y), seen from (u, v) on the thread of `which`:
    the mean across the thread."""
    i, j, _, _, p, q = split(R, cloth, u, v)
    in_u, in_v = entry_at(table, kinds, u, v)
    top = int(cloth.grid[i, j])
    along, over = (q, p) if top == WARP else (p, q)
    width = cloth.width[top]
    on_top = which == top
    slot = 0 if on_top else table.shape[2] - 1
    row, a = rows_of_texels(R, on_top, along, over, width, table.shape[3], cloth.tiny)
    azimuths = table.shape[4]
    turn = diamond(R, x, y) * R(0.25 * azimuths)
    first = min(int(turn), azimuths - 1)
    c = turn - R(first)
    second = first + 1 if first + 1 < azimuths else 0
    near = _between(R, table, in_u, in_v, slot, row, first, second, c)
    far = _between(R, table, in_u, in_v, slot, row + 1, first, second, c)
    return (near + (far - near) * a) * R(1.0 / 255.0)


@njit(**INLINE)
def soft_edge(R, above, softness):
    """A smooth step from 0 to 1 of width `softness`, in the light's elevation above the horizon."""
    t = max(R(0), min(R(1), above / softness + R(0.5)))
    return t * t * (R(3) - R(2) * t)


@njit(**INLINE)
def above_horizon(R, sine, flat, z):
    """Sine of the angle from the horizon up to light with the elevation atan2(z, flat)."""
    return z * math.sqrt(max(R(0), R(1) - sine * sine)) - flat * sine
