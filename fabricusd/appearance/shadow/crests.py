"""The highest points of the height field, for the method `peak`."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.appearance.frame import WARP, WEFT
from fabricusd.appearance.weave.lookup import lower_run, upper_run, wrap
from fabricusd.kernels.real import PART

SEARCH = 64
"""Radius [cells] in which `peak` searches for the highest point. Beyond it, the horizon of every
published fabric is below a quarter of a degree."""


@njit(**PART)
def to_crest(cloth, shadow, u, v, most):
    """Distance on the cloth [m] to the nearest of the highest points, or `most` if it is
    farther."""
    end, pick = np.floor(u), np.floor(v)
    pitch_u, pitch_v = float(cloth.pitch[WARP]), float(cloth.pitch[WEFT])
    best = most
    for ring in range(SEARCH):
        if (ring - 1) * min(pitch_u, pitch_v) > best:
            break
        for di in range(-ring, ring + 1):
            step = 1 if abs(di) == ring else max(1, 2 * ring)
            for dj in range(-ring, ring + 1, step):
                best = _crest_in_cell(cloth, shadow, u, v, end + di, pick + dj, best)
    return best


@njit(**PART)
def _crest_in_cell(cloth, shadow, u, v, end, pick, best):
    """The smaller of `best` and the distance [m] to the highest points of one cell."""
    i, j = wrap(end, cloth.grid.shape[0]), wrap(pick, cloth.grid.shape[1])
    top = int(cloth.grid[i, j])
    edge = 0.5 - 0.5 * float(cloth.width[top])
    for part in range(3 if cloth.runs.shape[2] > 1 else 1):
        # The thread on top, then the thread underneath before and behind it.
        which = top if part == 0 else 1 - top
        if which == WARP:
            thread = int(cloth.sequence[WARP, wrap(end, cloth.sequence_length[WARP])])
        else:
            thread = int(cloth.sequence[WEFT, wrap(pick, cloth.sequence_length[WEFT])])
        low, high = 0.0, 1.0
        if part == 0:
            start, cells = upper_run(np.float64, cloth, i, j, top)
            rises = 1.0
        else:
            start, cells, rises = lower_run(np.float64, cloth, i, j, top, part - 1.0)
            low, high = (0.0, edge) if part == 1 else (1.0 - edge, 1.0)
        visible = float(cloth.width[which]) if high > low else 0.0
        run = rises * cells * float(cloth.pitch[1 - which])
        half = float(cloth.half_height[which, thread])
        height = run * float(shadow.crest_height[thread]) + half + float(cloth.lift[which])
        if visible <= 0.0 or cloth.pile[thread] != 0 or height < 0.999999 * shadow.highest:
            continue
        across = 0.5 * visible
        for q in range(shadow.crest_first.shape[1]):
            a = max(low, float(shadow.crest_first[thread, q]) * cells - start)
            b = min(high, float(shadow.crest_last[thread, q]) * cells - start)
            if a > b:
                continue
            if which == WARP:
                du = max(0.0, abs(u - end - 0.5) - across)
                dv = max(0.0, a - (v - pick), (v - pick) - b)
            else:
                du = max(0.0, a - (u - end), (u - end) - b)
                dv = max(0.0, abs(v - pick - 0.5) - across)
            best = min(
                best,
                math.hypot(du * float(cloth.pitch[WARP]), dv * float(cloth.pitch[WEFT])),
            )
    return best
