"""The sections of the threads: ellipses as wide as the bands and as high as the cloth leaves room.

A section is as high as that of a round thread, or as much less as leaves threads that cross each
other room everywhere; one greatest height holds for the whole cloth. The warp's axes keep the
heights of their curves, and the weft is moved up or down as a whole to where it touches the warp
from neither side more than from the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.centre import RINGS, centre_line
from fabricusd.appearance.weave.coverage import coverage, sets, true_repeat
from fabricusd.appearance.weave.curve import is_pile
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.steps import parts

Floats = NDArray[np.float64]

APART = 0.999
"""Share of its band that a section takes, so that neighbours that touch do not share faces."""

FLATTEST = 0.02
"""Height of a section over its width below which a cloth is refused: threads that flat are sheets,
and cross through one another wherever the curve says so."""

SQUEEZED = 0.8
"""Share of the half widths over which threads are kept apart where a thread passes between two that
touch: their edges give way there, as yarn does, and tubes overlap."""

ACROSS = 17
"""Points across a crossing, each way, at which its two threads are kept apart."""

SETTLED = 6
"""Iterations for the place of the centre line whose side lies over a point."""

HALVINGS = 20
"""Of the interval in which the greatest height is looked for: it is then known to a millionth."""

MOST_CROSSINGS = 256
"""Crossings at which threads are kept apart, chosen at random where a figured cloth has more
different ones: each takes some milliseconds."""

MOST_CELLS = 1 << 20
"""Cells of the repeat beyond which crossings are chosen without asking which are alike."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sections:
    """How high the threads are, and where the weft lies.

    half_height : (2, k) float - half axis of the section of each type in each set [m]
    lift : float - height of the weft's axes above where their curves have them [m]
    tall : float - greatest height of a section [m]
    reach : float - share of the half widths over which threads that cross are apart: 1, or SQUEEZED
        where a thread passes between two that touch, and the three are squeezed at their edges
    """

    half_height: Floats
    lift: float
    tall: float
    reach: float


@lru_cache(maxsize=64)
def sections(fabric: Fabric) -> Sections:
    """The sections of `fabric`. Pile, and cloth whose threads cannot cross at any height, has
    round ones where its curves put them."""
    if not any(is_pile(t.curve) for t in fabric.thread_list):
        try:
            return fitted_sections(fabric)
        except FabricError:
            pass
    half = _round(fabric)
    return Sections(half_height=half, lift=0.0, tall=2.0 * float(half.max()), reach=0.0)


@lru_cache(maxsize=64)
def fitted_sections(fabric: Fabric) -> Sections:
    """The sections that leave all threads room. Raises FabricError where none do."""
    half = _round(fabric)
    used = [half[j, k] for j in (WEFT, WARP) for k in sets(fabric)[j].sequence if half[j, k] > 0]
    if not used:
        return Sections(half_height=half, lift=0.0, tall=0.0, reach=1.0)
    crossings = _crossings(fabric)
    flattest = FLATTEST * 2.0 * min(used)
    for reach in (1.0, SQUEEZED):
        if _fits(crossings, half, flattest, reach):
            break
    else:
        raise FabricError(
            f"fabric '{fabric.name}'",
            "has threads that pass through one another however flat they are: its curves rise and "
            "dip where its weave and coverage put other threads; geometry takes curves that leave "
            "the threads which cross them room",
        )
    low, high = flattest, 2.0 * max(used)
    if _fits(crossings, half, high, reach):
        low = high
    for _ in parts(f"thickness of the threads of '{fabric.name}'", range(HALVINGS)):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _fits(crossings, half, middle, reach) else (low, middle)
    bounds = [x for x in _room(crossings, half, low, reach) if np.isfinite(x)]
    return Sections(
        half_height=np.minimum(half, 0.5 * low),
        lift=float(np.mean(bounds)) if bounds else 0.0,
        tall=low,
        reach=reach,
    )


def _round(fabric: Fabric) -> Floats:
    """(2, k) half the height [m] of round threads: the band's width, or the thickness if less."""
    share = coverage(fabric)
    pitch = np.array([s.pitch for s in sets(fabric)])
    stated = np.array([t.thickness for t in fabric.thread_list])
    wide = (share.width * pitch)[:, None]
    return np.asarray(0.5 * np.where(stated > 0, np.minimum(stated, wide), wide))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Crossing:
    """One of each kind of crossing.

    warp_over : bool; kind : (2,) - types of the two threads, WEFT first
    span : (2,) float - half the width of each thread [cells of the other]
    pitch : (2,) float - of each set [m]
    lines : per set (n,) places along the thread from the crossing [cells], and of the centre line
        there the heights [m] and angles
    """

    warp_over: bool
    kind: tuple[int, int]
    span: Floats
    pitch: Floats
    lines: tuple[tuple[Floats, Floats, Floats], tuple[Floats, Floats, Floats]]

    def surface(self, which: int, half: Floats, tall: float, reach: float) -> Floats:
        """(ACROSS along, ACROSS across) height of the side that faces the other thread [m].

        A side lies at s + h n of the centre line, where n leans along the thread: the place that
        lies over a given point is found by fixed-point iteration, which converges where tubes do
        not bend more sharply than they are thick.
        """
        place = np.linspace(-reach, reach, ACROSS)
        crossing = float(self.pitch[1 - which])
        s = (place * self.span[1 - which])[:, None]
        side = -1.0 if self.warp_over == (which == WARP) else 1.0
        h = side * min(float(half[which, self.kind[which]]), 0.5 * tall) * np.sqrt(1.0 - place**2)
        ring, height, angle = self.lines[which]
        at = s
        for _ in range(SETTLED):
            at = s - h / crossing * np.sin(np.interp(at, ring, angle))
        psi = np.interp(at, ring, angle)
        return np.asarray(np.interp(at, ring, height) + h * np.cos(psi))


def _room(
    crossings: list[_Crossing], half: Floats, tall: float, reach: float
) -> tuple[float, float]:
    """The offsets of the weft that leave threads apart [m]: at least, at most."""
    least, most = -np.inf, np.inf
    for one in crossings:
        apart = one.surface(WARP, half, tall, reach) - one.surface(WEFT, half, tall, reach).T
        if one.warp_over:
            most = min(most, float(apart.min()))
        else:
            least = max(least, float(apart.max()))
    return least, most


def _fits(crossings: list[_Crossing], half: Floats, tall: float, reach: float) -> bool:
    """Whether sections `tall` high at most [m] leave all threads apart at some offset."""
    least, most = _room(crossings, half, tall, reach)
    return least <= most


def _crossings(fabric: Fabric) -> list[_Crossing]:
    """One crossing of each kind, MOST_CROSSINGS at most."""
    ends, picks = true_repeat(fabric)
    weave, width = fabric.weave, coverage(fabric).width
    pitch = np.array([s.pitch for s in sets(fabric)])
    # A side is looked for as far from the crossing as it is wide, and as a side leans.
    tallest = float(_round(fabric).max())
    around = [int(np.ceil(1.0 + tallest / pitch[1 - which])) for which in (WEFT, WARP)]

    def line(which: int, number: int) -> tuple[Floats, Floats]:
        sequence = sets(fabric)[which].sequence
        thread = fabric.thread_list[sequence[number % len(sequence)]]
        if which == WARP:
            on_top = np.resize(weave.cells[number % weave.ends], picks)
        else:
            on_top = np.resize(~weave.cells[:, number % weave.picks], ends)
        return centre_line(thread.curve, on_top, pitch[1 - which], width[1 - which])

    places = _different(fabric, ends, picks)
    windows: dict[tuple[int, int], tuple[Floats, Floats, Floats]] = {}
    # A line of a figured cloth has thousands of cells: one at a time is held whole.
    for which, numbers, along in ((WARP, *places.T), (WEFT, *places.T[::-1])):
        name = f"lines of the threads of '{fabric.name}'"
        for number in parts(name, np.unique(numbers).tolist()):
            whole = line(which, number)
            for at in np.flatnonzero(numbers == number):
                windows[which, int(at)] = _window(whole, int(along[at]), around[which])
    return [
        _Crossing(
            warp_over=bool(weave.cells[end % weave.ends, pick % weave.picks]),
            kind=(
                fabric.weft.sequence[pick % len(fabric.weft.sequence)],
                fabric.warp.sequence[end % len(fabric.warp.sequence)],
            ),
            span=0.5 * APART * width,
            pitch=pitch,
            lines=(windows[WEFT, at], windows[WARP, at]),
        )
        for at, (end, pick) in enumerate(places)
    ]


def _window(line: tuple[Floats, Floats], cell: int, around: int) -> tuple[Floats, Floats, Floats]:
    """The rings within `around` cells of one: their places from its centre [cells], their heights
    and angles."""
    rings = np.arange(-around * RINGS, (around + 1) * RINGS)
    height, angle = (x.take(cell * RINGS + rings, mode="wrap") for x in line)
    return (rings + 0.5) / RINGS - 0.5, height, angle


def _different(fabric: Fabric, ends: int, picks: int) -> NDArray[np.int64]:
    """(n, 2) ends and picks of crossings that differ in a thread's type or its place in a run."""
    if ends * picks > MOST_CELLS:
        cells = np.random.default_rng(0).integers((ends, picks), size=(MOST_CROSSINGS, 2))
        return np.asarray(cells, np.int64)
    grid = np.tile(fabric.weave.cells, (ends // fabric.weave.ends, picks // fabric.weave.picks))
    shapes = [(t.curve, t.thickness) for t in fabric.thread_list]
    shape = np.array([shapes.index(s) for s in shapes])
    warp = shape[np.resize(fabric.warp.sequence, ends)]
    weft = shape[np.resize(fabric.weft.sequence, picks)]
    columns = [grid, np.broadcast_to(warp[:, None], grid.shape), np.broadcast_to(weft, grid.shape)]
    for axis in (1, 0):
        columns += _places_in_runs(grid if axis == 1 else grid.T)
        columns[-2:] = [c if axis == 1 else c.T for c in columns[-2:]]
    keys = np.stack([np.asarray(c, np.int64).ravel() for c in columns], axis=1)
    _, first = np.unique(keys, axis=0, return_index=True)
    if len(first) > MOST_CROSSINGS:
        first = np.random.default_rng(0).choice(first, MOST_CROSSINGS, replace=False)
    return np.stack(np.unravel_index(first, grid.shape), axis=1)


def _places_in_runs(grid: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """(m, n) place in its run and length of the run of each cell, along the rows, which wrap; a
    run without end has places 0 and length 0."""
    m, n = grid.shape
    starts = grid != np.roll(grid, 1, axis=1)
    place, length = np.zeros((2, m, n), np.int64)
    index = np.arange(n)
    for row in np.flatnonzero(starts.any(axis=1)):
        first = np.flatnonzero(starts[row])
        run = np.searchsorted(first, index, side="right") - 1
        place[row] = np.mod(index - first[run], n)
        length[row] = np.mod(np.roll(first, -1) - first, n)[run]
        length[row][length[row] == 0] = n
    return [place, length]
