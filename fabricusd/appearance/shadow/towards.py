"""Horizons at many places in many directions, from which `mean` takes the mean of `g`.

Each method has a kernel of its own, so that a picture compiles that of its method alone.
"""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from fabricusd.appearance.shadow.crests import to_crest
from fabricusd.appearance.shadow.height import Origin, steepest
from fabricusd.appearance.shadow.horizon import LOWEST
from fabricusd.appearance.shadow.horizon_lookup import horizon_at
from fabricusd.appearance.shadow.kinds import HORIZON, PEAK, TRACED, Shadow
from fabricusd.appearance.weave.compiled import CompiledFabric
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.appearance.weave.lookup import crown_on, find, height_on
from fabricusd.kernels.real import KERNEL


def horizons_towards(
    cloth: CompiledFabric, shadow: Shadow, uv: NDArray[Any], directions: NDArray[Any]
) -> NDArray[Any]:
    """(n, c) sines of the horizons' elevations at uv (n, 2) in each of `directions` (c, 2)."""
    out, real = np.zeros((len(uv), len(directions))), cast(Any, np.float64)
    kernels = {PEAK: _horizons_by_peak, HORIZON: _horizons_by_table, TRACED: _horizons_marched}
    kernels[shadow.method](real, cloth, shadow, uv, directions, out)
    return out


@njit(**KERNEL, parallel=True)
def _horizons_by_peak(R, cloth, shadow, uv, directions, out):
    for k in prange(uv.shape[0]):
        u, v = uv[k, 0], uv[k, 1]
        which, thread, s, _, _, length = find(R, cloth, u, v)
        if which == GAP or cloth.pile[thread] != 0:
            continue
        axis = height_on(R, cloth, which, thread, s, length)
        drop = shadow.highest - axis - cloth.half_height[which, thread]
        if drop > R(1e-6) * shadow.highest:
            distance = to_crest(cloth, shadow, u, v, drop / R(1e-3))
            out[k, :] = drop / math.sqrt(drop * drop + distance * distance)


@njit(**KERNEL, parallel=True)
def _horizons_by_table(R, cloth, shadow, uv, directions, out):
    for k in prange(uv.shape[0]):
        u, v = uv[k, 0], uv[k, 1]
        which, thread, _, _, _, _ = find(R, cloth, u, v)
        if which == GAP or cloth.pile[thread] != 0:
            continue
        for c in range(directions.shape[0]):
            x, y = directions[c, 0], directions[c, 1]
            out[k, c] = horizon_at(R, cloth, shadow.table, shadow.kinds, u, v, which, x, y)


@njit(**KERNEL, parallel=True)
def _horizons_marched(R, cloth, shadow, uv, directions, out):
    for k in prange(uv.shape[0]):
        u, v = uv[k, 0], uv[k, 1]
        which, thread, s, w, _, length = find(R, cloth, u, v)
        if which == GAP or cloth.pile[thread] != 0:
            continue
        crown = crown_on(R, cloth, which, thread, w)
        axis = height_on(R, cloth, which, thread, s, length)
        origin = Origin(u, v, which, crown, axis + crown)
        for c in range(directions.shape[0]):
            slope = steepest(
                cloth, shadow.highest, origin, directions[c, 0], directions[c, 1], LOWEST, False
            )
            out[k, c] = slope / math.sqrt(R(1) + slope * slope) if slope > LOWEST else R(0)
