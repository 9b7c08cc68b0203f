"""The kinds of cells of a large repeat: cells with the same threads around them share a horizon.

A horizon is set by the threads near by. So the table of a figured cloth of hundreds of ends and
picks holds one entry for each *neighbourhood*, the weave within some radius of a cell, and not one
for each cell. The radius is the largest whose neighbourhoods the table has room for.
bench/model/bench_large_repeat.py measures what that costs in accuracy.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.weave.compiled import CompiledFabric
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import KERNEL
from fabricusd.steps import parts

MOST_KINDS = 3072
"""Cells times slots of a table: each takes one to ten milliseconds to compute. A closed repeat of
55 x 55 cells has an entry for each of its cells."""

MOST_RADIUS = 8
"""Radius [cells] beyond which nothing is gained: horizons are then off by less than .01 degree."""

_MIX = 0x9E3779B97F4A7C15
"""Odd constant that spreads a run's place and length over 64 bits."""


class Neighbourhoods(NamedTuple):
    """The kinds of cells of a repeat.

    kinds : (I, J) int32 - kind of each cell, numbered as they are met in rows
    first : (n, 2) int64 - a cell of each kind
    radius : int - to which cells of a kind have the same weave around them [cells]
    """

    kinds: NDArray[np.int32]
    first: NDArray[np.int64]
    radius: int


def neighbourhoods(
    fabric: Fabric, cloth: CompiledFabric, repeat: tuple[int, int], most: int = MOST_KINDS
) -> Neighbourhoods:
    """The kinds of the cells of `repeat`, `most` of them at most.

    repeat : of the threads' shapes; most : raised to the number of codes of a cell, two for each
    pair of threads' shapes, which cannot share horizons

    Cells of a kind lie at the same place of a run of the same
    length, however small the radius is; where even these are too many, runs that are longer than
    the radius are not told apart.
    """
    shapes = [(t.curve, t.thickness) for t in fabric.thread_list]
    shape = np.array([shapes.index(s) for s in shapes], np.int64)
    count = len(shapes)
    warp = np.resize(shape[list(fabric.warp.sequence)], repeat[0])
    weft = np.resize(shape[list(fabric.weft.sequence)], repeat[1])
    # Of each code of a cell at each place around, a number that is drawn at random [Zobrist 1970].
    side = 2 * MOST_RADIUS + 1
    drawn = np.random.default_rng(0).integers(
        1 << 63, size=(side, side, 2 * count * count), dtype=np.uint64
    )
    marks = np.zeros(repeat, np.uint64)
    kinds = np.empty(repeat, np.int32)
    first = np.empty((max(most, 2 * count * count), 2), np.int64)
    found = None
    for radius in parts(f"neighbourhoods of '{fabric.name}'", range(MOST_RADIUS + 1)):
        ring = np.array(
            [
                (a, b)
                for a, b in itertools.product(range(-radius, radius + 1), repeat=2)
                if radius - 0.5 <= np.hypot(a, b) < radius + 0.5
            ]
        )
        _mark(cloth.grid, warp, weft, count, ring, drawn, marks)
        if radius == 0:
            plain = marks.copy()
            _mark_runs(cloth.runs, marks)
        number = _count(marks, kinds, first)
        if number < 0 and radius == 0:
            marks = plain
            number = _count(marks, kinds, first)
        if number < 0:
            break
        found = Neighbourhoods(kinds.copy(), first[:number].copy(), radius)
    assert found is not None
    return found


@njit(parallel=True, **KERNEL)
def _mark(grid, warp, weft, count, ring, drawn, marks):
    """Mix the codes of the cells of `ring` around each cell into its mark."""
    middle = drawn.shape[0] // 2
    m, n = marks.shape
    for i in prange(m):
        for k in range(len(ring)):
            a, b = ring[k, 0], ring[k, 1]
            end = (i + a) % m
            row = end % grid.shape[0]
            for j in range(n):
                pick = (j + b) % n
                code = grid[row, pick % grid.shape[1]] + 2 * (warp[end] * count + weft[pick])
                marks[i, j] ^= drawn[middle + a, middle + b, code]


@njit(parallel=True, **KERNEL)
def _mark_runs(runs, marks):
    """Mix place and length of the run on top, and of the one underneath, into each cell's mark."""
    for i in prange(marks.shape[0]):
        for j in range(marks.shape[1]):
            for slot in range(runs.shape[2]):
                for k in range(2):
                    value = np.uint64(runs[i % runs.shape[0], j % runs.shape[1], slot, k])
                    mark = marks[i, j] ^ (value + np.uint64(2 * slot + k + 1) << np.uint64(33))
                    mark *= np.uint64(_MIX)
                    marks[i, j] = mark ^ (mark >> np.uint64(29))


@njit(**KERNEL)
def _count(marks, kinds, first):
    """Number the marks into `kinds` and `first`: how many there are, or -1 if `first` is full."""
    slots = 4 * len(first)
    keys = np.zeros(slots, np.uint64)
    numbers = np.full(slots, -1, np.int32)
    count = 0
    for i in range(marks.shape[0]):
        for j in range(marks.shape[1]):
            mark = marks[i, j]
            at = (mark >> np.uint64(20)) % np.uint64(slots)
            while numbers[at] >= 0 and keys[at] != mark:
                at = (at + np.uint64(1)) % np.uint64(slots)
            if numbers[at] < 0:
                if count == len(first):
                    return -1
                keys[at], numbers[at] = mark, count
                first[count, 0], first[count, 1] = i, j
                count += 1
            kinds[i, j] = numbers[at]
    return count
