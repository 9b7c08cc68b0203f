"""Pile: tufts that stand on a backing which lets nothing through.

A pile's curve gives the angle along each visible run and no length. It is taken by arc length here:
one tuft a run, which starts on the backing and leans over its run from end to end; that fixes how
long it is. A curve that comes down again is an arch; one that does not is cut, and its end closed
flat.

How far to believe it: nothing says how thick a tuft is along its run. FLATNESS is assumed, and the
length of the tuft depends on it, since flatter ones have more of the run to lean over. On velvet,
sections from .1 to .8 as high as wide make pile from .63 to .20 mm, and reflectances that differ by
.4 to .65 of their mean: a law can be judged to a factor of two, and by nothing finer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.bands import seen_length
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.coverage import coverage, sets
from fabricusd.appearance.weave.curve import Pieces, pieces
from fabricusd.appearance.weave.sections import APART
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.geometry.lines import Line, Repeat
from fabricusd.geometry.mesh import Mesh, Rings, faces, outline

Floats = NDArray[np.float64]

FLATNESS = 0.5
"""Height over width of a tuft's section; nothing says how high it is."""

STEPS = 24
"""Sections a piece of the curve."""

FAR_OFF = 2.0
"""Repeats round the repeat over which tufts stand; pile is about as high as its repeat is wide."""

BACKING = 1e-3
"""Depth of the backing below the tufts' feet, in pitches."""


def tuft_repeat(fabric: Fabric, squash: float) -> tuple[Repeat, Mesh]:
    """The tufts of one repeat of `fabric`, and their triangles with the backing's.

    squash : factor on the height of the sections

    Raises FabricError for sections that leave a run nothing to lean over.
    """
    ends, picks = true_repeat(fabric)
    weave = fabric.weave
    grid = np.tile(weave.cells, (ends // weave.ends, picks // weave.picks))
    width = coverage(fabric).width
    pitch = np.array([s.pitch for s in sets(fabric)])
    size = np.array([ends * pitch[WARP], picks * pitch[WEFT]])
    lines: list[Line] = []
    axes: list[Floats] = []
    bends: list[Floats] = []
    for which, count in ((WARP, ends), (WEFT, picks)):
        sequence, crossing = sets(fabric)[which].sequence, pitch[1 - which]
        half = 0.5 * width[which] * pitch[which] * APART
        for number in range(count):
            kind = sequence[number % len(sequence)]
            curve = pieces(fabric.thread_list[kind].curve)
            on_top = grid[number] if which == WARP else ~grid[:, number]
            for start, cells in _runs(on_top):
                length = seen_length(cells, width[1 - which])
                tall = half * FLATNESS * squash
                begin = (start - 0.5 * (1.0 - width[1 - which])) * crossing
                along, height, angle, bend = _lean(curve, length * crossing, tall, fabric.name)
                axes.append(begin + along)
                bends.append(bend)
                lines.append(
                    Line(
                        which=which,
                        kind=kind,
                        number=number,
                        lateral=(number + 0.5) * pitch[which],
                        half_width=half,
                        half_height=tall,
                        height=height,
                        angle=angle,
                    )
                )
    tallest = 2.0 * max((ln.half_height for ln in lines), default=0.0)
    repeat = Repeat(lines=tuple(lines), size=size, tall=tallest, reach=1.0)
    return repeat, _mesh(repeat, axes, bends, BACKING * float(pitch.min()))


def _runs(on_top: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first cell, cells) of every visible run of a thread; a whole repeat if it never ends."""
    if on_top.all():
        return [(0, len(on_top))]
    found = []
    for start in np.flatnonzero(on_top & ~np.roll(on_top, 1)):
        found.append((int(start), int(np.argmin(np.roll(on_top, -int(start))))))
    return found


def _lean(
    curve: Pieces, length: float, tall: float, name: str
) -> tuple[Floats, Floats, Floats, Floats]:
    """Place along the run, height [m], angle [rad], bend [rad/m] of a tuft's sections, (r,)."""
    t = np.linspace(0.0, 1.0, STEPS + 1)
    angle = curve.first[:, None] + (curve.last - curve.first)[:, None] * t
    step = curve.length[:, None] / STEPS
    middle = 0.5 * (angle[:, 1:] + angle[:, :-1])
    run = np.concatenate(([0.0], np.cumsum(np.cos(middle) * step)))
    rise = np.concatenate(([0.0], np.cumsum(-np.sin(middle) * step)))
    first, last = tall * abs(np.sin(angle[0, 0])), tall * abs(np.sin(angle[-1, -1]))
    room = length - first - last
    if room <= 0:
        raise FabricError(
            f"fabric '{name}'",
            f"has tufts {2 * tall * 1e3:.3g} mm thick on runs of {length * 1e3:.3g} mm: they have "
            "no room to lean",
        )
    arc = room / run[-1]
    # Both sections of a border between pieces are kept: the curve may jump there.
    at = np.arange(len(curve.start))[:, None] * STEPS + np.arange(STEPS + 1)
    bend = np.repeat((curve.last - curve.first) / (curve.length * arc), STEPS + 1)
    height = np.maximum(rise[at].ravel() * arc, 0.0)
    return first + run[at].ravel() * arc, height, angle.ravel(), bend


def _mesh(repeat: Repeat, axes: list[Floats], bends: list[Floats], depth: float) -> Mesh:
    """Triangles of all copies of the tufts, both ends closed, and two of the backing at the end."""
    copies = np.full(2, int(FAR_OFF), np.int64)
    points, triangles, parts = [], [], []
    begun = 0
    shifts = [
        np.array([i, j]) * repeat.size
        for i in range(-copies[0], copies[0] + 1)
        for j in range(-copies[1], copies[1] + 1)
    ]
    for number, (line, along, bend) in enumerate(zip(repeat.lines, axes, bends, strict=True)):
        axis = 1 if line.which == WARP else 0
        centre = np.zeros((len(along), 3))
        centre[:, axis], centre[:, 1 - axis], centre[:, 2] = along, line.lateral, line.height
        skin = outline(line, centre, line.angle, np.ones(len(along))).reshape(len(along), -1, 3)
        # Sections of no size close the ends.
        tips = (np.broadcast_to(centre[k], (1, *skin.shape[1:])) for k in (0, -1))
        first_tip, last_tip = tips
        skin = np.concatenate((first_tip, skin, last_tip))
        closed = np.pad(np.arange(len(along)), 1, mode="edge")
        count = len(closed)
        for shift in shifts:
            move = np.append(shift, 0.0)
            points.append((skin + move).reshape(-1, 3))
            triangles.append(faces(count) + begun * skin.shape[1])
            parts.append(
                (
                    centre[closed] + move, line.angle[closed], bend[closed],
                    np.ones(count), np.ones(count),
                    np.full(count, number, np.int32), np.arange(count - 1, dtype=np.int32) + begun,
                )
            )  # fmt: skip
            begun += count
    low, high = -repeat.size * (copies + 2), repeat.size * (copies + 3)
    corners = [(low[0], low[1]), (low[0], high[1]), (high[0], high[1]), (high[0], low[1])]
    base = sum(len(p) for p in points)
    points.append(np.array([(x, y, -depth) for x, y in corners]))
    # It faces down, so that light from above meets it from behind, as it does a tube's inside: it
    # ends there.
    triangles.append(np.array([(0, 1, 2), (0, 2, 3)], np.int32) + base)
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return Mesh(
        points=np.concatenate(points),
        triangles=np.concatenate(triangles),
        rings=Rings(*columns),
        rim=copies * repeat.size,
    )
