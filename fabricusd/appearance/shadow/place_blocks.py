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
    cell_of,
    hidden_run,
    piece_of,
    place_on,
    seen_run,
    whole_threads,
    wrap,
    wrapped,
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
_NEXT_I, _NEXT_J = 14 * BLOCK, 15 * BLOCK
"""The cell into which the thread underneath goes on."""
PIECE = 16 * BLOCK
"""The linear piece of the visible thread's curve, as an index of the flat tables of pieces."""
INT_ROWS = 17

_FEW_PIECES = 32
"""Up to as many pieces of all types, it is faster to compare all places with each than to read the
pieces of each place's own type."""

X, Y, S, ANGLE = 0, BLOCK, 2 * BLOCK, 3 * BLOCK
"""Rows of reals: the place in the cell, the position on the thread's run, and the tangent angle
[rad] there."""
SHARES, LIT = 4 * BLOCK, 6 * BLOCK
"""Two rows filled by `horizon_blocks.choose_texels`; the share of light that reaches the place."""
_UPPER_PLACE, _UPPER_COUNT, _LOWER_PLACE, _LOWER_COUNT, _BEYOND = (
    row * BLOCK for row in range(7, 12)
)
"""What `CompiledFabric.runs` holds for the cell, and the cells of the run beside it."""
PAST, TURN, MEAN = _UPPER_PLACE, _UPPER_COUNT, _LOWER_PLACE
"""The position past the start of the piece, what `horizon_blocks.choose_texels` fills, and what
`methods.mean_block` does, in rows that the lookup no longer needs."""
ACROSS, LENGTH = 12 * BLOCK, 13 * BLOCK
"""The position across the thread, and the length of its visible run [m]."""
REAL_ROWS = 14


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
    pieces_block(R, cloth, size, ints, reals)
    angles, slopes = cloth.curve_angle.reshape(-1), cloth.curve_slope.reshape(-1)
    for k in range(size):
        piece = np.uintp(ints[PIECE + k])
        reals[ANGLE + k] = angles[piece] + reals[PAST + k] * slopes[piece]


@njit(**PART)
def pieces_block(R, cloth, size, ints, reals):
    """Fill the rows PIECE, PAST and FREE from OF_SET, OF_THREAD and S."""
    types, pieces = np.int32(cloth.curve_start.shape[0]), np.int32(cloth.curve_start.shape[1])
    if types * pieces > _FEW_PIECES:
        starts = cloth.curve_start.reshape(-1)
        for k in range(size):
            own, s = np.uintp(ints[OF_THREAD + k]), reals[S + k]
            met = np.uintp(piece_of(R, cloth, own, s)) + own * np.uintp(pieces)
            ints[PIECE + k], reals[PAST + k] = met, s - starts[met]
    else:
        for k in range(size):
            ints[PIECE + k] = ints[OF_THREAD + k] * pieces
            reals[PAST + k] = reals[S + k]
        for thread in range(types):
            for piece in range(1, pieces):
                start = cloth.curve_start[thread, piece]
                # Starts beyond 1 pad the table.
                if start <= R(1):
                    _count_piece(R, thread, start, size, ints, reals)
    for k in range(size):
        ints[FREE + k] = ints[OF_SET + k] == GAP
    for thread in range(types):
        if cloth.pile[thread] != 0:
            for k in range(size):
                ints[FREE + k] |= ints[OF_THREAD + k] == thread


@njit(**INLINE)
def _count_piece(R, thread, start, size, ints, reals):
    """Move the places of a type from `start` on to the piece that starts there."""
    for k in range(size):
        s = reals[S + k]
        beyond = (ints[OF_THREAD + k] == thread) & (s >= start)
        ints[PIECE + k] += beyond
        reals[PAST + k] = s - start if beyond else reals[PAST + k]


@njit(**INLINE)
def _cells(R, cloth, uv, begin, size, ints, reals):
    """`weave.split` of a block."""
    # With a known stride, LLVM vectorises the loop.
    if uv.shape[1] == 2:
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
    slot = cloth.runs.shape[2] - 1
    ends, picks = np.int32(cloth.grid.shape[0]), np.int32(cloth.grid.shape[1])
    for k in range(size):
        i, j = np.uintp(ints[CELL_I + k]), np.uintp(ints[CELL_J + k])
        ints[TOP + k] = cloth.grid[i, j]
        ints[_WARP_THREAD + k] = cloth.sequence[WARP, np.uintp(ints[END + k])]
        ints[_WEFT_THREAD + k] = cloth.sequence[WEFT, np.uintp(ints[PICK + k])]
    # In a loop of its own, LLVM vectorises this; between the gathers it would branch.
    for k in range(size):
        warp = ints[TOP + k] == WARP
        over = reals[X + k] if warp else reals[Y + k]
        step = np.int32(1) if over > R(0.5) else np.int32(-1)
        across = step if warp else np.int32(0)
        ints[_NEXT_I + k] = wrapped(ints[CELL_I + k] + across, ends)
        ints[_NEXT_J + k] = wrapped(ints[CELL_J + k] + step - across, picks)
    for k in range(size):
        i, j = np.uintp(ints[CELL_I + k]), np.uintp(ints[CELL_J + k])
        reals[_UPPER_PLACE + k] = cloth.runs[i, j, 0, 0]
        reals[_UPPER_COUNT + k] = cloth.runs[i, j, 0, 1]
        reals[_LOWER_PLACE + k] = cloth.runs[i, j, slot, 0]
        reals[_LOWER_COUNT + k] = cloth.runs[i, j, slot, 1]
        i, j = np.uintp(ints[_NEXT_I + k]), np.uintp(ints[_NEXT_J + k])
        reals[_BEYOND + k] = cloth.runs[i, j, 0, 1]


@njit(**INLINE)
def _place(R, cloth, size, ints, reals):
    """Compute the visible thread, and the position on its run."""
    weft_width, warp_width = cloth.width[WEFT], cloth.width[WARP]
    weft_pitch, warp_pitch, nan = cloth.pitch[WEFT], cloth.pitch[WARP], R(np.nan)
    weft_rim, warp_rim, tiny = cloth.rim[WEFT], cloth.rim[WARP], cloth.tiny
    ends, picks = cloth.grid.shape
    for k in range(size):
        top, x, y = ints[TOP + k], reals[X + k], reals[Y + k]
        warp = top == WARP
        upper_start, upper_cells = seen_run(
            R, warp_rim if warp else weft_rim, picks if warp else ends,
            reals[_UPPER_PLACE + k], reals[_UPPER_COUNT + k],
        )  # fmt: skip
        lower_start, lower_cells, rises = hidden_run(
            R, weft_rim if warp else warp_rim, tiny, ends if warp else picks,
            (x if warp else y) > R(0.5),
            reals[_LOWER_PLACE + k], reals[_LOWER_COUNT + k], reals[_BEYOND + k],
        )  # fmt: skip
        which, s, w, cells = place_on(
            R, cloth, top, warp_width if warp else weft_width, weft_width if warp else warp_width,
            upper_start, upper_cells, lower_start, lower_cells, x, y,
        )  # fmt: skip
        warp_thread, weft_thread = ints[_WARP_THREAD + k], ints[_WEFT_THREAD + k]
        thread = warp_thread if which == WARP else weft_thread
        sound = x >= R(0)
        ints[OF_SET + k] = which if sound else WEFT
        ints[OF_THREAD + k] = thread if sound and which != GAP else 0
        reals[S + k], reals[ACROSS + k] = s if sound else nan, w if sound else nan
        crossing = weft_pitch if which == WARP else warp_pitch
        cells *= R(1) if which == top else rises
        reals[LENGTH + k] = cells * crossing if sound else nan
