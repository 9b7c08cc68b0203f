"""Look up a block of places of the weave, in loops that LLVM vectorises.

The integers of a block are stored row after row in a single array, and the reals in another. With
separate arrays LLVM would have to check every pair of pointers for overlap, and there would be too
many. Loops that gather from tables are separate from those that compute, because gathers stay
scalar.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.shadow.horizon_lookup import entry_at
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.lookup import (
    angle_on,
    cell_of,
    lower_run,
    place_on,
    upper_run,
    whole_threads,
    wrap,
)
from fabricusd.kernels.real import BLOCK, INLINE, PART, index

CELL_I, CELL_J, END, PICK = 0, BLOCK, 2 * BLOCK, 3 * BLOCK
"""Rows of int32: the cell of the grid, and the places in the sequences of threads."""
TOP, OF_SET, OF_THREAD, FREE = 4 * BLOCK, 5 * BLOCK, 6 * BLOCK, 7 * BLOCK
"""The set on top of the cell; the visible set, or GAP; the visible thread; and 1 in gaps and on
pile, which nothing shadows."""
TABLE_I, TABLE_J = 8 * BLOCK, 9 * BLOCK
"""The entry of the horizon table, as `horizon_lookup.entry_at`."""
FIRST, SECOND = 10 * BLOCK, 11 * BLOCK
"""Filled by `horizon_blocks.choose_texels`."""
_WARP_THREAD, _WEFT_THREAD = 12 * BLOCK, 13 * BLOCK
INT_ROWS = 14

X, Y, S, ANGLE = 0, BLOCK, 2 * BLOCK, 3 * BLOCK
"""Rows of reals: the place in the cell, the position on the thread's run, and the tangent angle
[rad] there."""
SHARES, LIT = 4 * BLOCK, 6 * BLOCK
"""Two rows filled by `horizon_blocks.choose_texels`; the share of light that reaches the place."""
_UPPER_START, _UPPER_CELLS, _LOWER_START, _LOWER_CELLS = (row * BLOCK for row in range(7, 11))
REAL_ROWS = 11


@njit(**PART)
def look_up_block(R, cloth, shadow, uv, begin, size, ints, reals):
    """`weave.find` at `size` places uv (n, 2) float64 from `begin` on, and the entries of the
    horizon table there.

    ints : (INT_ROWS*BLOCK,) int32; reals : (REAL_ROWS*BLOCK,)

    `methods.horizon_block` fills the rows FIRST, SECOND, SHARES and LIT.
    """
    _cells(R, cloth, uv, begin, size, ints, reals)
    _entries(cloth, shadow.table, shadow.kinds, uv, begin, size, ints)
    _gather(R, cloth, size, ints, reals)
    _place(R, cloth, size, ints, reals)
    for k in range(size):
        thread = np.uintp(ints[OF_THREAD + k])
        reals[ANGLE + k] = angle_on(R, cloth, thread, reals[S + k])
        ints[FREE + k] = ints[OF_SET + k] == GAP or cloth.pile[thread] != 0


@njit(**INLINE)
def _cells(R, cloth, uv, begin, size, ints, reals):
    """`weave.split` of a block."""
    for k in range(size):
        p = index(begin, k)
        i, j, x, y = cell_of(R, cloth, uv[p, 0], uv[p, 1])
        ints[CELL_I + k], ints[CELL_J + k] = i, j
        reals[X + k], reals[Y + k] = x, y
    _places_in_sequence(cloth, WARP, uv, begin, size, ints, END, CELL_I)
    _places_in_sequence(cloth, WEFT, uv, begin, size, ints, PICK, CELL_J)


@njit(**INLINE)
def _places_in_sequence(cloth, which, uv, begin, size, ints, row, cell_row):
    """Compute the places in a set's sequence.

    They are copied from the cell of the grid if the sequence has the period of the grid.
    """
    # Read these once: as far as LLVM knows, the loop overwrites them.
    period, cells = cloth.sequence_length[which], cloth.grid.shape[0 if which == WARP else 1]
    if period == 1:
        for k in range(size):
            ints[row + k] = 0
    elif period == cells:
        for k in range(size):
            ints[row + k] = ints[cell_row + k]
    else:
        for k in range(size):
            p = index(begin, k)
            end, pick, _ = whole_threads(uv[p, 0], uv[p, 1])
            ints[row + k] = wrap(end if which == WARP else pick, period)


@njit(**INLINE)
def _entries(cloth, table, kinds, uv, begin, size, ints):
    """Compute the entries of the horizon table: mostly, those of the cells of the grid."""
    same = table.shape[0] == cloth.grid.shape[0] and table.shape[1] == cloth.grid.shape[1]
    if kinds.size == 0 and same:
        for k in range(size):
            ints[TABLE_I + k], ints[TABLE_J + k] = ints[CELL_I + k], ints[CELL_J + k]
    else:
        for k in range(size):
            p = index(begin, k)
            ints[TABLE_I + k], ints[TABLE_J + k] = entry_at(table, kinds, uv[p, 0], uv[p, 1])


@njit(**INLINE)
def _gather(R, cloth, size, ints, reals):
    """Read what the tables hold for each cell, its end and its pick."""
    for k in range(size):
        i, j = np.uintp(ints[CELL_I + k]), np.uintp(ints[CELL_J + k])
        top = int(cloth.grid[i, j])
        ints[TOP + k] = top
        ints[_WARP_THREAD + k] = cloth.sequence[WARP, np.uintp(ints[END + k])]
        ints[_WEFT_THREAD + k] = cloth.sequence[WEFT, np.uintp(ints[PICK + k])]
        over = reals[X + k] if top == WARP else reals[Y + k]
        reals[_UPPER_START + k], reals[_UPPER_CELLS + k] = upper_run(R, cloth, i, j, top)
        start, cells, _ = lower_run(R, cloth, i, j, top, over)
        reals[_LOWER_START + k], reals[_LOWER_CELLS + k] = start, cells


@njit(**INLINE)
def _place(R, cloth, size, ints, reals):
    """Compute the visible thread, and the position on its run."""
    weft_width, warp_width = cloth.width[WEFT], cloth.width[WARP]
    for k in range(size):
        top, x = ints[TOP + k], reals[X + k]
        which, s, _, _ = place_on(
            R, cloth, top, warp_width if top == WARP else weft_width,
            weft_width if top == WARP else warp_width,
            reals[_UPPER_START + k], reals[_UPPER_CELLS + k],
            reals[_LOWER_START + k], reals[_LOWER_CELLS + k], x, reals[Y + k],
        )  # fmt: skip
        warp_thread, weft_thread = ints[_WARP_THREAD + k], ints[_WEFT_THREAD + k]
        thread = warp_thread if which == WARP else weft_thread
        sound = x >= R(0)
        ints[OF_SET + k] = which if sound else WEFT
        ints[OF_THREAD + k] = thread if sound and which != GAP else 0
        reals[S + k] = s if sound else R(np.nan)
