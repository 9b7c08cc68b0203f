"""The intermediate results of a block of direction pairs, which the vectorised loops share.

All rows are stored one after the other in a single array. With separate arrays LLVM would have to
check every pair of pointers for overlap before it vectorises a loop, and there would be too many.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.appearance import laws
from fabricusd.appearance.frame import WARP
from fabricusd.appearance.laws.law import VIEW_SHARES
from fabricusd.appearance.published.columns import NODE_COS, NODE_SIN, NODE_WEIGHT
from fabricusd.appearance.published.segment import SetPair, along_set
from fabricusd.kernels.real import BLOCK, INLINE, index

ALONG_I, ACROSS_I, UP_I, SCALE_I = 0, BLOCK, 2 * BLOCK, 3 * BLOCK
ALONG_O, ACROSS_O, UP_O, SCALE_O = 4 * BLOCK, 5 * BLOCK, 6 * BLOCK, 7 * BLOCK
SHARED = 8 * BLOCK
SEEN_0, SEEN_1, SEEN_2, SEEN_4 = 9 * BLOCK, 10 * BLOCK, 11 * BLOCK, 12 * BLOCK
NORMALIZATION, RED, GREEN, BLUE = 13 * BLOCK, 14 * BLOCK, 15 * BLOCK, 16 * BLOCK
"""Offsets of the rows: the fields of `segment.SetPair`, then the sums. Laws that hide nothing leave
the rows SEEN as they are."""

SHARES = 17 * BLOCK
"""Offset of VIEW_SHARES rows that `look` fills: the law's `view_shares` of one view after
the other. They are copied to the rows SEEN of one set."""

NODE_LIT = SHARES + VIEW_SHARES * BLOCK
"""Offset of a row that level `far` alone has: the mean of g at a node."""

ROWS = 18 + VIEW_SHARES

NOTHING = 1e-12
"""The value is 0 where `Q` is at or below this. On velvet this loses a tenth of random pairs."""


@njit(**INLINE)
def node_range(tables, thread_set):
    """(first, last + 1) of the nodes of a set."""
    if thread_set == WARP:
        return tables.warp_start, tables.nodes.shape[0]
    return 0, tables.warp_start


@njit(**INLINE)
def prepare(R, tables, thread_set, wi, wo, start, size, block, at=0):
    """Compute `along_set` for a block of pairs that `look` has seen, into the rows from `at` on."""
    for y in range(size):
        x, k = at + y, index(start, y)
        iz, oz = wi[2, k], wo[2, k]
        pair = along_set(R, tables, thread_set, wi[0, k], wi[1, k], iz, wo[0, k], wo[1, k], oz)
        block[ALONG_I + x], block[ACROSS_I + x] = pair.along_i, pair.across_i
        block[UP_I + x], block[SCALE_I + x] = pair.up_i, pair.scale_i
        block[ALONG_O + x], block[ACROSS_O + x] = pair.along_o, pair.across_o
        block[UP_O + x], block[SCALE_O + x] = pair.up_o, pair.scale_o
        block[SHARED + x] = pair.shared
    if laws.hides(R, tables):
        _see(thread_set, size, block, at)


@njit(**INLINE)
def look(R, tables, wo, start, size, block):
    """Fill the rows SHARES, which `prepare` reads."""
    if not laws.hides(R, tables):
        return
    # Entries of the table are small enough to be whole in float32.
    for x in range(size):
        k = index(start, x)
        entry, c, r = laws.view_place(R, tables, wo[0, k], wo[1, k], wo[2, k])
        block[SEEN_0 + x], block[SEEN_1 + x], block[SEEN_2 + x] = R(entry), c, r
    for x in range(size):
        entry, c, r = np.int32(block[SEEN_0 + x]), block[SEEN_1 + x], block[SEEN_2 + x]
        laws.view_shares(R, tables, entry, c, r, block, SHARES + VIEW_SHARES * x)


@njit(**INLINE)
def _see(thread_set, size, block, at):
    own = SHARES + (VIEW_SHARES // 2 if thread_set == WARP else 0)
    for y in range(size):
        x, view = at + y, own + VIEW_SHARES * y
        block[SEEN_0 + x], block[SEEN_1 + x] = block[view], block[view + 1]
        block[SEEN_2 + x], block[SEEN_4 + x] = block[view + 2], block[view + 3]


@njit(**INLINE)
def pair_at(block, x):
    """The `SetPair` of entry x of a block."""
    return SetPair(
        block[ALONG_I + x], block[ACROSS_I + x], block[UP_I + x], block[SCALE_I + x],
        block[ALONG_O + x], block[ACROSS_O + x], block[UP_O + x], block[SCALE_O + x],
        block[SHARED + x],
        block[SEEN_0 + x], block[SEEN_1 + x], block[SEEN_2 + x], block[SEEN_4 + x],
    )  # fmt: skip


@njit(**INLINE)
def add_weight(R, tables, k, size, block, at=0):
    """Add node k's weight to a block; the rows of the node's set start at offset `at`."""
    c, s, weight = (
        tables.nodes[k, NODE_COS],
        tables.nodes[k, NODE_SIN],
        tables.nodes[k, NODE_WEIGHT],
    )
    for x in range(size):
        block[NORMALIZATION + x] += weight * laws.weight(R, tables, c, s, pair_at(block, at + x))


@njit(**INLINE)
def divide(R, tables, wo, out, start, size, block):
    """Write the sums of a block, divided by the law's total, to out (3, n).

    The value is 0 where either direction is not above the cloth, and where the sum is below 0: see
    `quadrature.shares`.
    """
    for x in range(size):
        k = index(start, x)
        seen = block[NORMALIZATION + x]
        q = laws.total(R, tables, seen, wo[0, k], wo[1, k], wo[2, k])
        dark = min(block[UP_I + x], block[UP_O + x]) <= R(0) or q <= R(NOTHING)
        inverse = R(0) if dark else R(1) / q
        # The sums of dark entries may be NaN, so they are not multiplied by 0.
        block[RED + x] = R(0) if dark or block[RED + x] < R(0) else block[RED + x] * inverse
        block[GREEN + x] = R(0) if dark or block[GREEN + x] < R(0) else block[GREEN + x] * inverse
        block[BLUE + x] = R(0) if dark or block[BLUE + x] < R(0) else block[BLUE + x] * inverse
    for c in range(3):
        for x in range(size):
            out[c, index(start, x)] = block[RED + c * BLOCK + x]
