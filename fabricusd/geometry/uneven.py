"""A patch of true threads, as uneven as levels `weave` and `thread` see them.

Sections keep their height and lie where the bands do, as wide as they are: threads that cross leave
one another as much room as even ones. Crests of runs stay where they are, and plies do not show.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.centre import RINGS
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.appearance.weave.coverage import coverage, sets
from fabricusd.appearance.weave.yarn.compiled import compile_yarn
from fabricusd.appearance.weave.yarn.lay import edges, laid
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.geometry.lines import Line, Repeat


def uneven_lines(fabric: Fabric, repeat: Repeat, threads: tuple[int, int]) -> Repeat:
    """The lines of `repeat` laid side by side into a patch of at least `threads` ends and picks.

    Raises FabricError for a patch without threads.
    """
    if min(threads) < 1:
        raise FabricError("threads", f"is {threads}; it must be at least 1 by 1")
    once = true_repeat(fabric)
    times = [math.ceil(count / period) for count, period in zip(threads, once, strict=True)]
    yarn = compile_yarn(fabric, precision=np.float64)
    width = coverage(fabric).width
    pitch = [s.pitch for s in sets(fabric)]
    lines: list[Line] = []
    for line in repeat.lines:
        axis = 0 if line.which == WARP else 1
        along = times[1 - axis]
        count = len(line.angle) * along
        metres = (np.arange(count) + 0.5) / RINGS * pitch[1 - line.which]
        for time in range(times[axis]):
            number = line.number + time * once[axis]
            left, right, shade = edges(yarn, line.which, np.full(count, number), metres).T
            middle = 0.5 * (left + right)
            # A thread rises where the threads that it crosses lie, not where they would be if even.
            uv = np.empty((count, 2))
            uv[:, axis], uv[:, 1 - axis] = number + middle, (np.arange(count) + 0.5) / RINGS
            place = laid(yarn, uv).uv[:, 1 - axis]
            known, period = (np.arange(len(line.angle)) + 0.5) / RINGS, once[1 - axis]
            lines.append(
                replace(
                    line,
                    number=number,
                    lateral=(number + 0.5) * pitch[line.which],
                    height=np.interp(place, known, line.height, period=period),
                    angle=np.interp(place, known, line.angle, period=period),
                    wider=(right - left) / width[line.which],
                    aside=(middle - 0.5) * pitch[line.which],
                    shade=shade,
                )
            )
    size = np.array([pitch[WARP] * once[0] * times[0], pitch[WEFT] * once[1] * times[1]])
    return Repeat(lines=tuple(lines), size=size, tall=repeat.tall, reach=repeat.reach)
