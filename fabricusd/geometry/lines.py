"""The threads of one repeat as ellipses on centre lines, and how high the ellipses can be.

Sections are as wide as the bands. Their height is that of a round thread, or as much less as leaves
threads that cross each other room everywhere; one greatest height holds for the whole cloth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.coverage import coverage, sets
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.geometry.centre import RINGS, centre_line

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

MOST_CELLS = 1 << 12
"""Cells of the repeat beyond which a cloth is refused: to fit the sections would take minutes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """One thread of the repeat. Lengths in metres.

    which : WEFT or WARP; kind : int - index of its type in `Fabric.threads`
    number : int - of the thread in its set, from 0, in the repeat
    lateral : float - where it lies across its set
    half_width, half_height : float - half axes of its section
    height, angle : (n RINGS,) float - of its centre line [m], its tangent angle [rad], in the
        middles of RINGS parts of a cell
    wider, aside, shade : (n RINGS,) float or None - of an uneven thread there: its width over that
        of the even one, how far its middle lies off `lateral` [m], the factor of its albedo
    """

    which: int
    kind: int
    number: int
    lateral: float
    half_width: float
    half_height: float
    height: Floats
    angle: Floats
    wider: Floats | None = None
    aside: Floats | None = None
    shade: Floats | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Repeat:
    """The threads of one repeat of the cloth.

    size : (2,) float - extent along U and V [m]; tall : float - greatest height of a section [m]
    reach : float - share of the half widths over which threads that cross are apart: 1, or SQUEEZED
        where a thread passes between two that touch, and the three are squeezed at their edges
    """

    lines: tuple[Line, ...]
    size: Floats
    tall: float
    reach: float


def repeat_lines(fabric: Fabric, squash: float = 1.0) -> Repeat:
    """The threads of the repeat of `fabric`.

    squash : the sections' greatest height over the one that just fits

    Raises FabricError for cloth whose threads cannot cross at any height, and for repeats of more
    than MOST_CELLS cells.
    """
    ends, picks = true_repeat(fabric)
    if ends * picks > MOST_CELLS:
        raise FabricError(
            "weave", f"repeats after {ends} by {picks} threads; geometry takes {MOST_CELLS} cells"
        )
    weave = fabric.weave
    grid = np.tile(weave.cells, (ends // weave.ends, picks // weave.picks))
    width = coverage(fabric).width
    pitch = np.array([s.pitch for s in sets(fabric)])
    found: dict[int, list[Line]] = {WEFT: [], WARP: []}
    for which, count in ((WARP, ends), (WEFT, picks)):
        sequence = sets(fabric)[which].sequence
        for k in range(count):
            kind = sequence[k % len(sequence)]
            thread = fabric.thread_list[kind]
            on_top = grid[k] if which == WARP else ~grid[:, k]
            height, angle = centre_line(thread.curve, on_top, pitch[1 - which], width[1 - which])
            wide = width[which] * pitch[which]
            tall = min(wide, thread.thickness) if thread.thickness > 0 else wide
            found[which].append(
                Line(
                    which=which,
                    kind=kind,
                    number=k,
                    lateral=(k + 0.5) * pitch[which],
                    half_width=0.5 * wide * APART,
                    half_height=0.5 * tall,
                    height=height,
                    angle=angle,
                )
            )
    tall, offset, reach = _fit(fabric, found, grid, pitch)
    tall *= squash
    lines = tuple(
        Line(
            **{
                **vars(line),
                "half_height": min(line.half_height, 0.5 * tall),
                "height": line.height + (offset if line.which == WEFT else 0.0),
            }
        )
        for which in (WARP, WEFT)
        for line in found[which]
        if line.half_width > 0
    )
    size = np.array([ends * pitch[WARP], picks * pitch[WEFT]])
    return Repeat(lines=lines, size=size, tall=tall, reach=reach)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Crossings:
    """Every crossing of the repeat, ACROSS points each way.

    grid : (m, n) bool - whether warp is on top
    found : the lines of both sets, as they lie before the weft is moved
    place : (k,) float - points across a thread that is crossed, in half widths
    span : (2,) float - half width of each set's threads, in cells
    pitch : (2,) float - of each set [m]
    """

    grid: NDArray[np.bool_]
    found: dict[int, list[Line]]
    place: Floats
    span: Floats
    pitch: Floats

    def room(self, tall: float) -> tuple[float, float]:
        """The offsets of the weft that leave threads apart [m]: at least, at most."""
        warp = self._surface(WARP, tall)
        weft = np.swapaxes(self._surface(WEFT, tall), 0, 1).swapaxes(2, 3)
        apart = warp - weft
        most = float(apart[self.grid].min()) if self.grid.any() else np.inf
        least = float(apart[~self.grid].max()) if not self.grid.all() else -np.inf
        return least, most

    def fits(self, tall: float) -> bool:
        """Whether sections `tall` high at most [m] leave all threads apart at some offset."""
        least, most = self.room(tall)
        return least <= most

    def _surface(self, which: int, tall: float) -> Floats:
        """(threads, crossed, k along, k across) height of the side that faces the other set [m].

        A side lies at s + h n of the centre line, where n leans along the thread: the place that
        lies over a given point is found by fixed-point iteration, which converges where tubes do
        not bend more sharply than they are thick.
        """
        lines, other = self.found[which], self.found[1 - which]
        count, crossing = len(other), float(self.pitch[1 - which])
        ring = (np.arange(count * RINGS) + 0.5) / RINGS
        along = (np.arange(count) + 0.5)[:, None] + self.place * self.span[1 - which]
        out = np.empty((len(lines), count, ACROSS, ACROSS))
        round_ = np.sqrt(1.0 - self.place**2)
        for k, line in enumerate(lines):
            on_top = self.grid[k] if which == WARP else ~self.grid[:, k]
            side = np.where(on_top, -1.0, 1.0)[:, None, None] * round_
            h = min(line.half_height, 0.5 * tall) * side
            s = along[..., None]
            at = s
            for _ in range(SETTLED):
                psi = np.interp(at, ring, line.angle, period=count)
                at = s - h / crossing * np.sin(psi)
            psi = np.interp(at, ring, line.angle, period=count)
            out[k] = np.interp(at, ring, line.height, period=count) + h * np.cos(psi)
        return out


def _crossings(
    found: dict[int, list[Line]], grid: NDArray[np.bool_], pitch: Floats, reach: float
) -> _Crossings:
    """The crossings of the lines of both sets, out to `reach` of the half widths."""
    return _Crossings(
        grid=grid,
        found=found,
        place=np.linspace(-reach, reach, ACROSS),
        span=np.array([found[j][0].half_width for j in (WEFT, WARP)]) / pitch,
        pitch=pitch,
    )


def _fit(
    fabric: Fabric, found: dict[int, list[Line]], grid: NDArray[np.bool_], pitch: Floats
) -> tuple[float, float, float]:
    """Greatest height of the sections [m], how far the weft lies above the warp's height [m], and
    the share of the half widths over which threads are apart."""
    halves = [line.half_height for which in (WARP, WEFT) for line in found[which]]
    flattest = FLATTEST * 2.0 * min(halves)
    for reach in (1.0, SQUEEZED):
        crossings = _crossings(found, grid, pitch, reach)
        if crossings.fits(flattest):
            break
    else:
        raise FabricError(
            f"fabric '{fabric.name}'",
            "has threads that pass through one another however flat they are: its curves rise and "
            "dip where its weave and coverage put other threads; geometry takes curves that leave "
            "the threads which cross them room",
        )
    low, high = flattest, 2.0 * max(halves)
    if crossings.fits(high):
        low = high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if crossings.fits(middle) else (low, middle)
    bounds = [x for x in crossings.room(low) if np.isfinite(x)]
    return low, float(np.mean(bounds)) if bounds else 0.0, reach
