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
    length: float
    """Length of the visible run in cells; 0 on the strips of a hidden run, which rise nowhere."""
    edge: float
    """How near the point is to where another thread, or another piece of curve, begins."""


def slow_lookup(fabric: Fabric, u: float, v: float) -> Found:
    width = coverage(fabric).width
    cells = fabric.weave.cells
    end, pick = math.floor(u), math.floor(v)
    x, y = u - end, v - pick
    in_warp, in_weft = abs(x - 0.5) < width[WARP] / 2, abs(y - 0.5) < width[WEFT] / 2
    edges = [abs(abs(x - 0.5) - width[WARP] / 2), abs(abs(y - 0.5) - width[WEFT] / 2)]
    edges += [x, 1 - x, y, 1 - y]
    if not (in_warp or in_weft):
        return Found(GAP, 0, 0.0, 0.0, 0.0, 0.0, min(edges))

    def warp_on_top(i: int, j: int) -> bool:
        return bool(cells[i % cells.shape[0], j % cells.shape[1]])

    warp = warp_on_top(end, pick) if in_warp and in_weft else in_warp
    hit = WARP if warp else WEFT
    along, offset = (v, x) if warp else (u, y)
    w = (offset - 0.5) / (width[hit] / 2)
    s, length = _place_on_thread(
        [warp_on_top(end, k) if warp else not warp_on_top(k, pick) for k in _repeat(fabric, warp)],
        float(width[1 - hit]), along,
    )  # fmt: skip
    sequence = (fabric.warp if warp else fabric.weft).sequence
    kind = sequence[(end if warp else pick) % len(sequence)]
    curve = fabric.thread_list[kind].curve
    jumps = (np.array(curve.positions) - curve.positions[0]) / (
        curve.positions[-1] - curve.positions[0]
    )
    edges.append(float(np.abs(jumps - s).min()))
    return Found(hit, kind, s, -w if warp else w, float(angle_at(curve, s)), length, min(edges))


def _repeat(fabric: Fabric, warp: bool) -> range:
    return range(fabric.weave.cells.shape[1 if warp else 0])


def _place_on_thread(on_top: list[bool], crossing: float, along: float) -> tuple[float, float]:
    """(s, length in cells) of the run at `along`; crossing thread k covers k + 1/2 +- crossing/2.

    What is seen of a thread is cut up by the threads that lie over it; the pieces that hold a cell
    where it is on top are runs. All other pieces of a hidden run are put together to one.
    """
    n = len(on_top)
    if all(on_top):
        return along % n / n, float(n)
    hiding = [k for k in range(-2 * n, 4 * n) if not on_top[k % n]]
    along = along % n + n
    before = max(k for k in hiding if k + 0.5 + crossing / 2 <= along + 1e-12)
    after = min(k for k in hiding if k + 0.5 - crossing / 2 >= along - 1e-12)
    if after > before + 1:
        low, high = before + 0.5 + crossing / 2, after + 0.5 - crossing / 2
        return (along - low) / (high - low), high - low
    strip = 1 - crossing
    inside = along - (before + 0.5 + crossing / 2)
    if not any(on_top):
        # The repeat starts in the middle of a strip: its first half lies before thread 0.
        covered = sum(min(max(along % n - (k + 0.5 - crossing / 2), 0), crossing) for k in range(n))
        return (along % n - covered) / (n * strip), 0.0
    first = before
    while not on_top[(first - 1) % n]:
        first -= 1
    last = before
    while not on_top[(last + 1) % n]:
        last += 1
    return ((before - first) * strip + inside) / ((last - first) * strip), 0.0
