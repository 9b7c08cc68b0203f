"""Reading the horizon table: one place at a time, and a block of places in loops that vectorise.

The azimuth is the diamond angle: from 0 to 4, one per quadrant, linear in `y/(|x| + |y|)` inside
it. Between texels and azimuths the *sine* of the elevation is interpolated, which is what the light
is compared with.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.appearance.coverage import GAP
from fabricusd.appearance.frame import WARP
from fabricusd.appearance.real import INLINE, LEAN
from fabricusd.appearance.weave import FARTHEST, split, wrap


@njit(**INLINE)
def diamond(R, x, y):
    """Azimuth of (x, y) from 0 to 4: one per quadrant, linear in y/(|x| + |y|) inside it."""
    part = x / max(abs(x) + abs(y), R(1e-30))
    return R(1) - part if y >= R(0) else R(3) + part


@njit(**INLINE)
def _cell_of_texels(R, place, count):
    """Lower of the two texels around `place` in [0, 1], and the share of the upper one."""
    x = max(R(0), min(place * R(count) - R(0.5), R(count - 1)))
    k = min(int(x), count - 2)
    return k, x - R(k)


@njit(**INLINE)
def _between(R, table, i, j, slot, row, column, first, second, c):
    """A texel's horizon between two azimuths, c of the way from the first."""
    low = R(table[i, j, slot, row, column, first])
    return low + (R(table[i, j, slot, row, column, second]) - low) * c


@njit(**INLINE)
def split_table(table, u, v):
    """Cell of the table at weave coordinates, float64; where they are not sound, the first one."""
    sound = abs(u) <= FARTHEST and abs(v) <= FARTHEST
    return (
        wrap(np.floor(u) if sound else 0.0, table.shape[0]),
        wrap(np.floor(v) if sound else 0.0, table.shape[1]),
    )


@njit(**INLINE)
def horizon_at(R, cloth, table, u, v, which, x, y):
    """Sine of the horizon's elevation at (u, v) on the thread of set `which` towards (x, y)."""
    i, j, _, _, p, q = split(R, cloth, u, v)
    in_u, in_v = split_table(table, u, v)
    top = int(cloth.grid[i, j])
    along, over = (q, p) if top == WARP else (p, q)
    width = cloth.width[top]
    on_top = which == top
    # Selections, not branches: neither thread nor azimuth can be predicted.
    seen = (over if over < R(0.5) else over - width) / max(R(1) - width, cloth.tiny)
    across = ((over if on_top else along) - R(0.5)) / (width if on_top else cloth.under_width)
    slot = 0 if on_top else table.shape[2] - 1
    along, across = along if on_top else seen, across + R(0.5)
    row, a = _cell_of_texels(R, along, table.shape[3])
    column, b = _cell_of_texels(R, across, table.shape[4])
    azimuths = table.shape[5]
    turn = diamond(R, x, y) * R(0.25 * azimuths)
    first = min(int(turn), azimuths - 1)
    c = turn - R(first)
    second = first + 1 if first + 1 < azimuths else 0
    here = _between(R, table, in_u, in_v, slot, row, column, first, second, c)
    beside = _between(R, table, in_u, in_v, slot, row, column + 1, first, second, c)
    ahead = _between(R, table, in_u, in_v, slot, row + 1, column, first, second, c)
    both = _between(R, table, in_u, in_v, slot, row + 1, column + 1, first, second, c)
    near = here + (beside - here) * b
    far = ahead + (both - ahead) * b
    return (near + (far - near) * a) * R(1.0 / 255.0)


@njit(**INLINE)
def soft_edge(R, above, softness):
    """A smooth step from 0 to 1 over `softness`, in how far the light stands above the horizon."""
    t = max(R(0), min(R(1), above / softness + R(0.5)))
    return t * t * (R(3) - R(2) * t)


@njit(**INLINE)
def above_horizon(R, sine, flat, z):
    """Sine of the angle from the horizon up to light of elevation (flat, z)."""
    return z * math.sqrt(max(R(0), R(1) - sine * sine)) - flat * sine


@njit(**LEAN)
def choose_texels(R, cloth, table, cells, p, q, tops, sets, wi, begin, base, notes):
    """Where in the flat table each of a block of places reads, and the three shares it mixes.

    cells : (6, b) of `split` and `split_table`; tops, sets : (b,) set on top of the cell and set of
    the thread; wi : (3, n), the block's from `begin` on; base : (2, b) int32, of both azimuths;
    notes : (3, b)
    """
    rows, columns, azimuths = table.shape[3], table.shape[4], table.shape[5]
    picks, slots = table.shape[1], table.shape[2]
    weft_width, warp_width = cloth.width[0], cloth.width[1]
    for k in range(p.size):
        # A gap, and what is not a number, reads somewhere; the caller has its answer already.
        sound = p[k] >= R(0) and sets[k] != GAP
        warp = tops[k] == WARP
        along, over = (q[k] if warp else p[k]), (p[k] if warp else q[k])
        width = warp_width if warp else weft_width
        on_top = sets[k] == tops[k]
        seen = (over if over < R(0.5) else over - width) / max(R(1) - width, cloth.tiny)
        across = (over if on_top else along) - R(0.5)
        across = across / max(width if on_top else cloth.under_width, cloth.tiny) + R(0.5)
        row, a = _cell_of_texels(R, (along if on_top else seen) if sound else R(0.5), rows)
        column, b = _cell_of_texels(R, across if sound else R(0.5), columns)
        x, y = wi[0, begin + k], wi[1, begin + k]
        turn = diamond(R, x, y) * R(0.25 * azimuths)
        turn = turn if abs(x) + abs(y) < R(2) else R(0)
        first = min(np.int32(turn), np.int32(azimuths - 1))
        second = first + 1 if first + 1 < azimuths else 0
        slot = 0 if on_top else slots - 1
        texel = (
            ((cells[4, k] * picks + cells[5, k]) * slots + slot) * rows + row
        ) * columns + column
        base[0, k], base[1, k] = texel * azimuths + first, texel * azimuths + second
        notes[0, k], notes[1, k], notes[2, k] = a, b, turn - R(first)


@njit(**LEAN)
def mix_texels(R, texels, columns, azimuths, base, notes, sine):
    """The horizon's sine at a block of places, from the flat table, into sine (b,)."""
    step = np.uintp(columns * azimuths)
    beside = np.uintp(azimuths)
    for k in range(sine.size):
        m, n = np.uintp(base[0, k]), np.uintp(base[1, k])
        a, b, c = notes[0, k], notes[1, k], notes[2, k]
        g00, h00 = R(texels[m]), R(texels[n])
        g01, h01 = R(texels[m + beside]), R(texels[n + beside])
        g10, h10 = R(texels[m + step]), R(texels[n + step])
        g11, h11 = R(texels[m + step + beside]), R(texels[n + step + beside])
        g0, h0 = g00 + (g01 - g00) * b, h00 + (h01 - h00) * b
        g1, h1 = g10 + (g11 - g10) * b, h10 + (h11 - h10) * b
        g, h = g0 + (g1 - g0) * a, h0 + (h1 - h0) * a
        sine[k] = (g + (h - g) * c) * R(1.0 / 255.0)
