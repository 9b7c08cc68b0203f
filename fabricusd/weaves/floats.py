"""Floats: runs of crossings in which a thread stays on one side of the cloth.

A float on the face is a run with the thread on top, a float on the back one with it beneath. Runs
go on across the border of the repeat.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.bool_]

LOOM_FLOAT = 16
"""Longest float that cloth is woven with, in threads: wider satins than 16 are not in use. A longer
float catches on everything and lets the threads slide."""

PASSES = 8
"""Most passes over the cloth that `bound_floats` makes: a tie in one set lengthens a float of the
other, which the next pass may have to tie."""


class Floats(NamedTuple):
    """Longest float of each set on each side, in threads; None where a thread has no crossing."""

    warp_face: int | None
    warp_back: int | None
    weft_face: int | None
    weft_back: int | None

    @property
    def longest(self) -> int | None:
        """The longest of all, None if one has no end."""
        lengths = [length for length in self if length is not None]
        return max(lengths) if len(lengths) == len(self) else None


def floats(cells: Cells) -> Floats:
    """The longest floats of the weave `cells` (m, n)."""
    return Floats(
        _longest_run(cells, True),
        _longest_run(cells, False),
        _longest_run(cells.T, False),
        _longest_run(cells.T, True),
    )


def longest_float(cells: Cells, axis: int) -> int | None:
    """Longest run of warp on top along axis 1, or of weft along axis 0; None where endless."""
    return _longest_run(cells, True) if axis == 1 else _longest_run(cells.T, False)


def _longest_run(grid: Cells, value: bool) -> int | None:
    """Longest run of `value` along axis 1, None where a row has nothing else."""
    longest = 0
    # A stripe of rows at a time: the run starts and ends of a whole jacquard would take a gigabyte.
    for first in range(0, len(grid), 128):
        stripe = grid[first : first + 128] == value
        if stripe.all(axis=1).any():
            return None
        twice = np.zeros((stripe.shape[0], 2 * stripe.shape[1] + 1), np.bool_)
        twice[:, 1:] = np.tile(stripe, (1, 2))
        breaks = np.flatnonzero(~twice)
        longest = max(longest, int(np.diff(np.append(breaks, twice.size)).max()) - 1)
    return longest


def long_float_words(cells: Cells, longest: int = LOOM_FLOAT) -> str:
    """What is wrong with the floats of a weave on a loom, "" if nothing is."""
    found = floats(cells)
    words = []
    for label, noun, lengths in (("warp", "picks", found[:2]), ("weft", "ends", found[2:])):
        known = [length for length in lengths if length is not None]
        if len(known) < len(lengths):
            words.append(f"the {label} past all {noun}")
        elif max(known) > longest:
            words.append(f"the {label} past {max(known)} {noun}")
    return " and ".join(words)


def bound_floats(cells: Cells, longest: int) -> tuple[Cells, int]:
    """(cells in which floats longer than `longest` are tied, number of crossings that changed).

    Ties go where they lengthen the floats of the other set least, and move from thread to thread,
    so that they do not line up. A crossing is changed at most once; `floats` of the result says
    what is left where that does not suffice.
    """
    result = cells.copy()
    locked = np.zeros(cells.shape, np.bool_)
    before = -1
    for _ in range(PASSES):
        if int(locked.sum()) == before:
            break
        before = int(locked.sum())
        for grid, fixed in ((result, locked), (result.T, locked.T)):
            for value in (True, False):
                _tie(grid, fixed, value, longest)
    return result, int(locked.sum())


def _tie(grid: Cells, locked: Cells, value: bool, longest: int) -> None:
    """Break every run of `value` along axis 1 that is longer than `longest`, in place."""
    count = grid.shape[1]
    for thread, start, length in _long_runs(grid == value, longest):
        # A thread without any crossing gets one; the next pass breaks the run that is left.
        ties = length // (longest + 1) if length < count else 1
        piece = (length - ties) / (ties + 1)
        reach = min(max(int(longest - piece) // 2, 1), 3)
        for number in range(1, ties + 1):
            middle = start + round(number * (piece + 1)) - 1
            places = [p for p in _nearby(middle, reach, thread) if start <= p < start + length]
            free = [p % count for p in places if not locked[thread, p % count]]
            if free:
                at = min(free, key=lambda k: _merged(grid, thread, k, value))
                grid[thread, at] = not value
                locked[thread, at] = True


def _nearby(middle: int, reach: int, thread: int) -> list[int]:
    """Places around `middle`; which of them comes first changes from thread to thread."""
    offsets = sorted(range(-reach, reach + 1), key=abs)
    turn = (2 * thread) % len(offsets)
    return [middle + offset for offset in offsets[turn:] + offsets[:turn]]


def _merged(grid: Cells, thread: int, at: int, value: bool) -> int:
    """Length of the other set's float that a tie at (thread, at) makes."""
    across = grid[:, at]
    total, length = 1, len(across)
    for step in (1, -1):
        k = thread + step
        while total < length and across[k % length] != value:
            total += 1
            k += step
    return total


def _long_runs(on: Cells, longest: int) -> list[tuple[int, int, int]]:
    """(thread, start, length) of each run of True along axis 1 that is longer than `longest`."""
    runs: list[tuple[int, int, int]] = []
    count = on.shape[1]
    suspects = np.flatnonzero(on.sum(axis=1) > longest)
    for thread in suspects.tolist():
        breaks = np.flatnonzero(~on[thread])
        if not len(breaks):
            # An endless float is a run that begins anywhere; begin it elsewhere on each thread.
            if count > longest:
                runs.append((thread, (3 * thread) % count, count))
            continue
        lengths = np.diff(np.append(breaks, breaks[0] + count)) - 1
        for k in np.flatnonzero(lengths > longest).tolist():
            runs.append((thread, int(breaks[k]) + 1, int(lengths[k])))
    return runs


def describe_floats(found: Floats) -> str:
    """`warp over up to 7 picks, weft over up to 7 ends`, on the side where each is longer."""
    words = []
    for label, crossed, lengths in (("warp", "pick", found[:2]), ("weft", "end", found[2:])):
        known = [length for length in lengths if length is not None]
        if len(known) < len(lengths):
            words.append(f"{label} without end")
        else:
            words.append(
                f"{label} over up to {max(known)} {crossed}{'' if max(known) == 1 else 's'}"
            )
    return ", ".join(words)
