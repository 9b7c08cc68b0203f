"""Read the horizon table at a block of places, in loops that LLVM vectorises.

The rows of a block are those of `place_blocks`; the interpolation is that of
`horizon_lookup.horizon_at`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.appearance.frame import WARP, WEFT, diamond
from fabricusd.appearance.shadow.horizon_lookup import rows_of_texels
from fabricusd.appearance.shadow.place_blocks import (
    FIRST,
    LIT,
    OF_SET,
    SECOND,
    SHARES,
    TABLE_I,
    TABLE_J,
    TOP,
    TURN,
    X,
    Y,
)
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.kernels.real import BLOCK, PART, index


@njit(**PART)
def choose_texels(R, cloth, table, wi, begin, size, ints, reals):
    """Compute the indices into the flat table and the two weights for a block of places.

    wi : (3, n), of which the block uses the columns from `begin` on

    The indices for both azimuths go to the rows FIRST and SECOND, the weights to SHARES, and the
    azimuth itself to TURN.
    """
    rows, azimuths = table.shape[3], table.shape[4]
    picks, slots = table.shape[1], table.shape[2]
    weft_width, warp_width = cloth.width[WEFT], cloth.width[WARP]
    for k in range(size):
        p, q, top, which = reals[X + k], reals[Y + k], ints[TOP + k], ints[OF_SET + k]
        # In a gap or for NaN the texel is arbitrary: the caller does not use the result.
        sound = p >= R(0) and which != GAP
        warp = top == WARP
        along, over = (q, p) if warp else (p, q)
        width = warp_width if warp else weft_width
        on_top = which == top
        row, a = rows_of_texels(
            R, on_top, along if sound else R(0.5), over if sound else R(0.25), width, rows,
            cloth.tiny,
        )  # fmt: skip
        m = index(begin, k)
        x, y = wi[0, m], wi[1, m]
        turn = diamond(R, x, y) * R(0.25 * azimuths)
        turn = turn if abs(x) + abs(y) < R(2) else R(0)
        first = min(np.int32(turn), np.int32(azimuths - 1))
        second = first + 1 if first + 1 < azimuths else 0
        slot = 0 if on_top else slots - 1
        texel = ((ints[TABLE_I + k] * picks + ints[TABLE_J + k]) * slots + slot) * rows + row
        ints[FIRST + k], ints[SECOND + k] = texel * azimuths + first, texel * azimuths + second
        reals[SHARES + k], reals[SHARES + BLOCK + k] = a, turn - R(first)
        reals[TURN + k] = turn


@njit(**PART)
def mix_texels(R, texels, size, ints, reals):
    """Interpolate the horizon's sine at a block of places in the flat table, into the row LIT."""
    for k in range(size):
        ints[FIRST + k] = texels[np.uintp(ints[FIRST + k])]
        ints[SECOND + k] = texels[np.uintp(ints[SECOND + k])]
    for k in range(size):
        near, beside = ints[FIRST + k], ints[SECOND + k]
        a, c = reals[SHARES + k], reals[SHARES + BLOCK + k]
        g0, h0 = R(near & 255), R(beside & 255)
        g1, h1 = R(near >> 8), R(beside >> 8)
        g, h = g0 + (g1 - g0) * a, h0 + (h1 - h0) * a
        reals[LIT + k] = (g + (h - g) * c) * R(1.0 / 255.0)
