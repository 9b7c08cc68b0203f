"""Tubes as triangles, repeated as far as a ray is likely to go, and what lies behind each one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.centre import RINGS
from fabricusd.errors import FabricError
from fabricusd.geometry.lines import Line, Repeat

Floats = NDArray[np.float64]

SIDES = 24
"""Faces round a section: their middles lie .9 % inside the ellipse. EXIT clears the corners."""

REACH = 4.0
"""Heights of the cloth to each side of the repeat over which triangles are laid out. A ray that
goes on is put back into the repeat; of rays at 45 degrees none has to be."""

MOST_TRIANGLES = 6_000_000
"""Triangles beyond which a cloth is refused: Embree then takes about 1 GB."""


class Rings(NamedTuple):
    """What kernels read of the tubes. A line's copies have rings of their own.

    centre : (r, 3) float - middle of each section [m]
    angle, bend : (r,) float - tangent angle [rad] and its change along the thread [rad/m]
    wider, shade : (r,) float - width of the section over that of its line, factor of the albedo
    line : (r,) int32 - the section's line
    first : (q,) int32 - the section at which each row of SIDES quadrilaterals begins
    """

    centre: Floats
    angle: Floats
    bend: Floats
    wider: Floats
    shade: Floats
    line: NDArray[np.int32]
    first: NDArray[np.int32]


@dataclass(frozen=True, kw_only=True, eq=False)
class Mesh:
    """points : (n, 3) float [m]; triangles : (m, 3) int32, two a quadrilateral, seen from outside
    counterclockwise; rim : (2,) float - how far they reach beyond the repeat, each way along U and
    V [m]."""

    points: Floats
    triangles: NDArray[np.int32]
    rings: Rings
    rim: Floats


def sweep(repeat: Repeat, thick: float) -> Mesh:
    """The tubes of `repeat`, which is `thick` high [m]."""
    copies = np.maximum(1, np.ceil(REACH * thick / repeat.size))
    # Of a repeat that is wide for its height, a rim is enough.
    rim = np.where(2 * REACH * thick < repeat.size, REACH * thick, copies * repeat.size)
    laid = [
        (number, line, shift)
        for number, line in enumerate(repeat.lines)
        for shift in _shifts(line, repeat, rim)
    ]
    quads = sum(SIDES * len(_places(line, repeat, rim)) for _, line, _ in laid)
    if 2 * quads > MOST_TRIANGLES:
        raise FabricError(
            "weave", f"takes {2 * quads} triangles as tubes; geometry takes {MOST_TRIANGLES}"
        )
    parts: list[tuple[Any, ...]] = []
    points, triangles = [], []
    begun = 0
    for number, line, shift in laid:
        sections = _sections(line, repeat, rim, shift)
        centre, angle, _, wider, _ = sections
        points.append(outline(line, centre, angle, wider))
        count = len(angle)
        triangles.append(faces(count) + begun * SIDES)
        first = np.arange(count - 1, dtype=np.int32) + begun
        parts.append((*sections, np.full(count, number, np.int32), first))
        begun += count
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return Mesh(
        points=np.concatenate(points),
        triangles=np.concatenate(triangles),
        rings=Rings(*columns),
        rim=rim,
    )


def _shifts(line: Line, repeat: Repeat, rim: Floats) -> range:
    """Copies of a line to either side of it, in repeats, that lie between the rims."""
    axis = 1 - _along(line)
    size = float(repeat.size[axis])
    low = math.ceil((-rim[axis] - line.lateral) / size)
    return range(low, math.floor((size + rim[axis] - line.lateral) / size) + 1)


def _places(line: Line, repeat: Repeat, rim: Floats) -> NDArray[np.int64]:
    """Numbers of a line's sections from rim to rim, those of the repeat from 0 on."""
    axis, cells = _along(line), len(line.angle)
    reach = math.ceil(float(rim[axis] / repeat.size[axis]) * cells - 1e-6)
    return np.arange(-reach, cells + reach + 1)


def _along(line: Line) -> int:
    """The axis that a line runs along: 0 for U, 1 for V."""
    return 1 if line.which == WARP else 0


def _sections(
    line: Line, repeat: Repeat, rim: Floats, shift: int
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Centre (r, 3), angle, bend, width and shade (r,) of one copy of a line, from end to end of
    the patch."""
    axis = _along(line)
    length, cells = float(repeat.size[axis]), len(line.angle)
    k = _places(line, repeat, rim)
    s = (k + 0.5) * length / cells
    angle = line.angle[k % cells]
    # Both neighbours across the border of the repeat, so that copies bend alike.
    change = np.roll(line.angle, -1) - np.roll(line.angle, 1)
    bend = (change * cells / (2 * length) * np.cos(line.angle))[k % cells]
    centre = np.zeros((len(k), 3))
    centre[:, axis] = s
    centre[:, 1 - axis] = line.lateral + shift * repeat.size[1 - axis]
    centre[:, 2] = line.height[k % cells]
    if line.aside is not None:
        centre[:, 1 - axis] += line.aside[k % cells]
    even = np.ones(len(k))
    wider = even if line.wider is None else line.wider[k % cells]
    shade = even if line.shade is None else line.shade[k % cells]
    return centre, angle, bend, wider, shade


def outline(line: Line, centre: Floats, angle: Floats, wider: Floats) -> Floats:
    """(r SIDES, 3) corners of the sections."""
    around = 2 * math.pi * np.arange(SIDES) / SIDES
    across = np.zeros(3)
    across[:2] = (-1.0, 0.0) if line.which == WARP else (0.0, 1.0)
    normal = np.zeros((len(angle), 3))
    normal[:, _along(line)], normal[:, 2] = np.sin(angle), np.cos(angle)
    corners = (
        centre[:, None]
        + line.half_width * wider[:, None, None] * np.cos(around)[:, None] * across
        + line.half_height * np.sin(around)[:, None] * normal[:, None]
    )
    return np.asarray(corners.reshape(-1, 3))


def faces(sections: int) -> NDArray[np.int32]:
    """(2 (sections - 1) SIDES, 3) triangles of one tube."""
    ring, side = np.meshgrid(np.arange(sections - 1), np.arange(SIDES), indexing="ij")
    here, beside = ring * SIDES + side, ring * SIDES + (side + 1) % SIDES
    low = np.stack((here, beside + SIDES, here + SIDES), axis=-1)
    high = np.stack((here, beside, beside + SIDES), axis=-1)
    return np.stack((low, high), axis=2).reshape(-1, 3).astype(np.int32)


__all__ = ["REACH", "RINGS", "SIDES", "WEFT", "Mesh", "Rings", "sweep"]
