"""The threads of one repeat as ellipses on centre lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.centre import centre_line
from fabricusd.appearance.weave.coverage import coverage, sets, true_repeat
from fabricusd.appearance.weave.sections import APART, fitted_sections
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

Floats = NDArray[np.float64]

MOST_CELLS = 1 << 12
"""Cells of the repeat beyond which a cloth is refused: its tubes would take gigabytes."""


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
    fitted = fitted_sections(fabric)
    lines: list[Line] = []
    for which, count in ((WARP, ends), (WEFT, picks)):
        sequence = sets(fabric)[which].sequence
        if not width[which] > 0:
            continue
        for k in range(count):
            kind = sequence[k % len(sequence)]
            on_top = grid[k] if which == WARP else ~grid[:, k]
            height, angle = centre_line(
                fabric.thread_list[kind].curve, on_top, pitch[1 - which], width[1 - which]
            )
            half = float(fitted.half_height[which, kind])
            lines.append(
                Line(
                    which=which,
                    kind=kind,
                    number=k,
                    lateral=(k + 0.5) * pitch[which],
                    half_width=0.5 * width[which] * pitch[which] * APART,
                    half_height=min(half, 0.5 * squash * fitted.tall),
                    height=height + (fitted.lift if which == WEFT else 0.0),
                    angle=angle,
                )
            )
    size = np.array([ends * pitch[WARP], picks * pitch[WEFT]])
    return Repeat(lines=tuple(lines), size=size, tall=squash * fitted.tall, reach=fitted.reach)
