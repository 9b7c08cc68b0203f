"""Compile how uneven a fabric's threads are into arrays, which the kernels of `lay` read."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.scattering.model import CONSERVING
from fabricusd.appearance.scattering.models import model_of
from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage, sets
from fabricusd.appearance.weave.yarn.noise import PEAK, VARIANCE, variance
from fabricusd.fabric import Fabric, Thread

Reals = NDArray[Any]

CUT = 8e-3
"""Length of the pieces whose mass CVm compares [m]: the capacitor of an evenness tester."""

WIDTH_OF_MASS = 0.5
"""Variation of the width over that of the mass: yarn is round and equally dense."""

LEAST = 0.15
"""Share of its width that no thread falls below."""

SPREAD = 0.5
"""Heights of slubs lie within this of their mean, relative to it."""

STRAY = 1.0
"""How far threads lie off their places where there is room, in pitches, over the variation of their
width."""

CRESTS, FARTHEST_CREST = 10.0, 0.8
"""How far the crests of runs move at most, times 4, over the variation of the mass; and its limit:
at 1, a crest would reach the end of its run."""

BUMP = 8.0 / 15.0
"""Mean of a slub's (1 - x^2)^2 over its length."""

(
    RATE, WIDTH, COUNT, SHADE, SLUB, SLUB_RATE, SLUB_HALF, SLUB_MEAN, STRANDS, WINDING, CREST,
    COLUMNS,
) = range(12)  # fmt: skip
"""Columns of `Yarn.rows`.
RATE : 1/(length of the lattice) [1/m]
WIDTH, COUNT : relative change of the width per unit of noise along the thread, and between threads
SHADE : relative change of the albedo per unit of noise
SLUB : change of the width in the middle of a mean slub
SLUB_RATE, SLUB_HALF, SLUB_MEAN : slubs per metre, half their length over their distance, mean of
    the slubs along the thread
CREST : how far the crest of a run moves at most, times 4 [runs]
STRANDS, WINDING : strands seen across the thread, strands that pass per metre times 2; 0 if single
"""

(OF_WIDTH, OWN, SHARED, MOST, ASTRAY, SET_COLUMNS) = range(6)
"""Columns of `Yarn.sets`.
OF_WIDTH : `CompiledFabric.width`
OWN : share of a thread's unevenness by which its edges part
SHARED : by how much the border between two threads moves for a unit of difference [cells]
MOST : how far a border can move [cells]
ASTRAY : how far a thread lies off its place for a unit of unevenness [cells]
"""


class Yarn(NamedTuple):
    """Arrays of one fabric's threads; `real` is the precision that it is compiled for.

    rows : (2, k, COLUMNS) real - by set and thread type
    sets : (2, SET_COLUMNS) real
    sequence : (2, n) int32; sequence_length : (2,) int64 - as in `CompiledFabric`; of the back of
        a cloth they are in the order in which the front counts
    cell : (2,) float64 - what threads of a set pass from one crossing to the next [m]
    seed : (2,) uint32 - of each set
    alike : (2,) uint8 - whether all threads of a set are of one type
    slubs : (2,) uint8 - whether any thread of a set has slubs
    plies : int - whether any thread shows its plies
    """

    rows: Reals
    sets: Reals
    sequence: NDArray[np.int32]
    sequence_length: NDArray[np.int64]
    cell: NDArray[np.float64]
    seed: NDArray[np.uint32]
    alike: NDArray[np.uint8]
    slubs: NDArray[np.uint8]
    plies: int


def compile_yarn(
    fabric: Fabric,
    *,
    precision: type[np.floating[Any]] = np.float32,
    back_of: Fabric | None = None,
) -> Yarn:
    """Arrays of the threads of `fabric` in `precision`.

    back_of : the front, if `fabric` is the back of a cloth. Threads are then counted and placed as
        on the front: the picks run against the back's own order.
    """
    width = coverage(fabric).width
    lengths = np.array([len(s.sequence) for s in sets(fabric)])
    sequence = np.zeros((2, lengths.max()), np.int32)
    for which, thread_set in enumerate(sets(fabric)):
        order = thread_set.sequence
        turned = back_of is not None and which == WEFT
        sequence[which, : len(order)] = order[::-1] if turned else order
    pitch = np.array([s.pitch for s in sets(fabric)])
    rows = np.zeros((2, len(fabric.threads), COLUMNS))
    table = np.zeros((2, SET_COLUMNS))
    for which in (WEFT, WARP):
        used = sorted(set(sets(fabric)[which].sequence))
        for kind in used:
            rows[which, kind] = _row(fabric, fabric.thread_list[kind])
        table[which] = _of_set(float(width[which]), rows[which, used])
    return Yarn(
        rows=rows.astype(precision),
        sets=table.astype(precision),
        sequence=sequence,
        sequence_length=lengths,
        cell=pitch[::-1].copy(),
        seed=_seeds((back_of or fabric).unevenness_seed),
        alike=np.array([len(set(s.sequence)) == 1 for s in sets(fabric)], np.uint8),
        slubs=np.asarray((rows[..., SLUB] > 0).any(axis=1), np.uint8),
        plies=int(any(t.shows_plies for t in fabric.thread_list)),
    )


def _seeds(seed: int) -> NDArray[np.uint32]:
    """(2,) of each set, from that of the fabric."""
    return np.asarray(np.random.SeedSequence(seed).generate_state(2), np.uint32)


def _row(fabric: Fabric, t: Thread) -> NDArray[np.float64]:
    row = np.zeros(COLUMNS)
    row[RATE] = 1.0 / t.unevenness_length if t.unevenness_length > 0 else 0.0
    if t.unevenness_cv > 0:
        row[WIDTH] = WIDTH_OF_MASS * t.unevenness_cv / math.sqrt(variance(CUT * row[RATE]))
    row[COUNT] = WIDTH_OF_MASS * t.unevenness_count * math.sqrt(3.0)
    # Half of the shade's variance lies along the thread, half between threads.
    deviation = t.unevenness_shade / math.sqrt(2.0)
    row[SHADE] = min(
        deviation, _most_shade(fabric, t) / (PEAK / math.sqrt(VARIANCE) + math.sqrt(3))
    )
    if t.slub_amount > 0:
        row[SLUB], row[SLUB_RATE] = t.slub_amount, 1.0 / t.slub_spacing
        row[SLUB_HALF] = 0.5 * t.slub_length / t.slub_spacing
        row[SLUB_MEAN] = t.slub_amount * BUMP * t.slub_length / t.slub_spacing
    row[CREST] = min(FARTHEST_CREST, CRESTS * math.hypot(t.unevenness_cv, t.unevenness_count))
    if t.shows_plies:
        row[STRANDS] = (t.plies + 1) // 2
        row[WINDING] = 2.0 * t.plies * t.twist
    return row


def _most_shade(fabric: Fabric, t: Thread) -> float:
    """How far the albedo may stray from its mean, relative to it: it stays above 0, and below 1
    where it is an albedo."""
    top = max(t.albedo)
    if model_of(fabric, t).law != CONSERVING or top == 0:
        return 1.0
    return min(1.0, max(0.0, 1.0 / top - 1.0))


def _of_set(width: float, rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """The columns of `Yarn.sets` for threads of a set that are `width` of their pitch wide.

    Edges part by the share p of the unevenness for which there is room in the gap. For the rest, a
    border between two threads moves by a times the difference of their unevenness. The variance of
    the width is then p^2 + 4 p a + 6 a^2 times that of the unevenness, and a makes it 1.
    """
    out = np.zeros(SET_COLUMNS)
    out[OF_WIDTH] = width
    if width == 0.0:
        return out
    along, slub = rows[:, WIDTH] * PEAK + rows[:, COUNT], rows[:, SLUB] * (1 + SPREAD)
    thicker = float((along + slub - rows[:, SLUB_MEAN]).max())
    thinner = float((along + rows[:, SLUB_MEAN]).max())
    if thicker <= 0.0:
        out[OWN] = 1.0
        return out
    p = min(1.0, 0.98 * (1.0 / width - 1.0) / thicker, (1.0 - 2.0 * LEAST) / thinner)
    a = (math.sqrt(16 * p * p + 24 * (1 - p * p)) - 4 * p) / 12
    out[OWN] = p
    out[SHARED] = a * width
    out[MOST] = 0.5 * width * (1.0 - LEAST - p * thinner)
    if along.max() > 0:
        out[ASTRAY] = min(STRAY, 0.5 * (1.0 - width * (1.0 + p * thicker)) / float(along.max()))
    return out
