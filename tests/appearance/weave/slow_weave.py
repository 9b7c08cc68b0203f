"""The weave lookup in plain Python, for the tests: it walks along the threads it meets."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.coverage import GAP, coverage
from fabricusd.appearance.weave.curve import angle_at
from fabricusd.fabric import Fabric


class Found(NamedTuple):
    set: int
    thread: int
    position: float
    across: float
    angle: float
    edge: float
    """How near the point is to where another thread, or another piece of curve, begins."""


def slow_lookup(fabric: Fabric, u: float, v: float) -> Found:
    share = coverage(fabric)
    cells = fabric.weave.cells
    end, pick = math.floor(u), math.floor(v)
    x, y = u - end, v - pick

    def warp_on_top(i: int, j: int) -> bool:
        return bool(cells[i % cells.shape[0], j % cells.shape[1]])

    def run(along_warp: bool) -> tuple[int, int]:
        """Cells before this one in its run, and the run's length; a whole repeat if endless."""
        i, j = (0, 1) if along_warp else (1, 0)
        repeat = cells.shape[1] if along_warp else cells.shape[0]
        value = warp_on_top(end, pick)

        def same(steps: int) -> bool:
            return warp_on_top(end + i * steps, pick + j * steps) == value

        before = after = 0
        while before < repeat and same(-before - 1):
            before += 1
        while after < repeat and same(after + 1):
            after += 1
        if before >= repeat:
            return (pick if along_warp else end) % repeat, repeat
        return before, before + 1 + after

    top = WARP if warp_on_top(end, pick) else WEFT
    over, along = (x, y) if top == WARP else (y, x)
    half = share.width[top] / 2
    edges = [abs(abs(over - 0.5) - half), x, 1 - x, y, 1 - y]
    if half > 0 and abs(over - 0.5) < half:
        hit, w, seen, visible = top, (over - 0.5) / half, along, 1.0
    elif share.under == 1 - top and abs(along - 0.5) < share.under_width / 2:
        hit, w = 1 - top, (along - 0.5) / (share.under_width / 2)
        visible = 1 - 2 * half
        seen = (over if over < 0.5 else over - 2 * half) / visible
        edges.append(abs(abs(along - 0.5) - share.under_width / 2))
    else:
        edges.append(abs(abs(along - 0.5) - share.under_width / 2))
        return Found(GAP, 0, 0.0, 0.0, 0.0, min(edges))
    before, length = run(hit == WARP)
    s = (before + seen) / length
    sequence = (fabric.warp if hit == WARP else fabric.weft).sequence
    kind = sequence[(end if hit == WARP else pick) % len(sequence)]
    curve = fabric.thread_list[kind].curve
    jumps = (np.array(curve.positions) - curve.positions[0]) / (
        curve.positions[-1] - curve.positions[0]
    )
    edges.append(float(np.abs(jumps - s).min()))
    return Found(hit, kind, s, -w if hit == WARP else w, float(angle_at(curve, s)), min(edges))
