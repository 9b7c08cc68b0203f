"""Level `auto`: how much of the cloth to model, from the size of a pixel on it.

The pixel's extent is measured in threads, weave coordinates: `far` where it covers more than about
a repeat, `weave` where threads resolve, `thread` where a thread is wider than about four pixels.
Between them the levels are mixed by chance, with weights that are continuous in the extent; since
the mean of each level over what the next one cannot see is that next one, the mean of a picture
does not jump. `docs/model.md` section 8.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance import real
from fabricusd.appearance.compiled import true_repeat
from fabricusd.appearance.real import INLINE, KERNEL
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

LEVELS = ("far", "weave", "thread")
FAR, WEAVE, THREAD = range(3)

REPEATS = 1.0
"""Repeats under a pixel where `far` and `weave` are equally likely."""

PIXELS = 4.0
"""Pixels on a thread where `weave` and `thread` are equally likely."""

OCTAVES = 1.0
"""Half the width of either transition: from half to twice the extent it is centred on."""


@njit(**INLINE)
def _ramp(R, x):
    """Smooth step in log2 of `x`, 0.5 at 1 and flat OCTAVES away on both sides; NaN stays."""
    if x <= R(2.0**-OCTAVES):
        return R(0)
    if x >= R(2.0**OCTAVES):
        return R(1)
    t = R(0.5) + real.log(R, x) * R(0.5 / OCTAVES / np.log(2.0))
    return t * t * (R(3) - R(2) * t)


@njit(**INLINE)
def level_weights(R, ends, picks, extent_u, extent_v):
    """(far, weave, thread) probabilities, which sum to 1.

    ends, picks : the true repeat, in threads; extent_u, extent_v : of the pixel, in threads, along
    U and V. `far` asks for a whole repeat in *both* directions: at a grazing view a pixel is long
    and thin, and the threads across its thin side are still seen. `thread` asks both likewise.
    NaN makes all three NaN.
    """
    if not extent_u + extent_v >= R(0):
        nan = R(np.nan)
        return nan, nan, nan
    far = _ramp(R, min(extent_u / ends, extent_v / picks) / R(REPEATS))
    # 1/0 is infinity here: a pixel without extent sees a thread infinitely wide.
    thread = _ramp(R, R(1.0 / PIXELS) / max(extent_u, extent_v))
    # The two never meet while a repeat is at least one thread; see the test.
    return far, R(1) - far - thread, thread


@njit(**INLINE)
def pick_level(R, far, weave, number):
    """Level for a uniform `number` in [0, 1), and the number stretched to [0, 1) to use again."""
    if number < far:
        return FAR, number / far
    if number < far + weave:
        return WEAVE, min((number - far) / weave, R(0.99999994))
    return THREAD, min((number - far - weave) / (R(1) - far - weave), R(0.99999994))


@njit(parallel=True, **KERNEL)
def _weights_all(R, ends, picks, extents, out):
    for k in prange(extents.shape[0]):
        out[k, 0], out[k, 1], out[k, 2] = level_weights(
            R, ends, picks, extents[k, 0], extents[k, 1]
        )


def extent_of(across: ArrayLike, down: ArrayLike) -> NDArray[np.float64]:
    """(n, 2) extent in threads of a pixel whose steps to the right and down move the weave
    coordinates by `across` and `down`, both (n, 2): the same whichever way the camera is rolled."""
    return np.hypot(np.asarray(across, np.float64), np.asarray(down, np.float64))


def weights(fabric: Fabric, extents: ArrayLike) -> NDArray[np.float64]:
    """(n, 3) probabilities of `far`, `weave`, `thread` for pixels of `extents` (n, 2) in threads.

    Infinite extents, at the horizon, are `far`. Raises `FabricError` for negative ones and NaN.
    """
    asked = np.ascontiguousarray(extents, np.float64)
    if asked.ndim != 2 or asked.shape[1] != 2:
        raise FabricError("extents", f"has shape {asked.shape}; it must be (n, 2)")
    bad = ~(asked >= 0).all(axis=1)
    if bad.any():
        k = int(np.argmax(bad))
        raise FabricError(
            "extents",
            f"has {int(bad.sum())} of {len(asked)} rows that are negative or not a number, the "
            f"first at {k}: {asked[k].tolist()}; they must be at least 0",
        )
    ends, picks = true_repeat(fabric)
    out: NDArray[Any] = np.empty((len(asked), 3))
    _weights_all(np.float64, float(ends), float(picks), asked, out)
    return out
