"""Choose the level of detail (`auto`) from the footprint of a pixel on the cloth.

The extent of the pixel is measured in threads, in weave coordinates. `far` is chosen where a repeat
is narrower than two pixels, `weave` where threads are resolved, and `thread` where a thread is
wider than a pixel; see `Limits`. In between, the level is chosen at random, with probabilities that
are continuous in the extent. The mean of each level over the detail that the next coarser one
cannot see is that coarser level, so the mean of a picture does not jump.

Source: `docs/model.md` section 8, which puts the transitions at one repeat per pixel, where `weave`
is moire, and at four pixels per thread. This module uses other limits: where a thread is two pixels
wide, `weave` on the satin is off by 1.3 of the mean (`chart.level_errors`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance.levels import FAR, THREAD, WEAVE
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.kernels import real
from fabricusd.kernels.real import INLINE, KERNEL

_NEVER = 1e30


class Limits(NamedTuple):
    """The extents at which level `auto` changes from one level to the next.

    repeats : number of repeats per pixel at which `far` and `weave` are equally likely
    pixels : number of pixels per thread at which `weave` and `thread` are equally likely
    octaves : half the width of either transition: with 1 it reaches from half to twice the extent
        of its centre, with 0 it is a step
    """

    repeats: float = 0.4
    pixels: float = 1.0
    octaves: float = 0.5

    def row(self, fabric: Fabric) -> tuple[float, float, float, float]:
        """(far_u, far_v, thread, octaves), the arguments of `level_weights` for a fabric.

        Limits that are never reached stay finite, so that an infinite extent does not give 0/0.
        """
        ends, picks = true_repeat(fabric)
        repeats = min(self.repeats, _NEVER)
        thread = 1.0 / max(self.pixels, 1.0 / _NEVER)
        return repeats * ends, repeats * picks, thread, self.octaves


DEFAULT = Limits()
"""Above half a repeat per pixel, no picture can resolve the repeat (`chart.zoom`). What `weave`
shows there is moire, 0.05 to 0.4 of the mean, and noise, 0.3 with 64 samples of satin. Below a
third of a repeat, the error of `far` is larger than that. At their transition, `weave` and `thread`
differ by a tenth to a fifth of the mean (`chart.level_errors`), and on the satin by half of it."""


@njit(**INLINE)
def _ramp(R, x, octaves):
    """Smooth step from 0 to 1 in log2 of `x`: 0.5 at x = 1, constant `octaves` away on both
    sides."""
    x = min(max(x, R(1e-30)), R(1e30))
    t = R(0.5) + real.log(R, x) * R(0.5 / np.log(2.0)) / max(octaves, R(1e-3))
    t = min(max(t, R(0)), R(1))
    return t * t * (R(3) - R(2) * t)


@njit(**INLINE)
def level_weights(R, far_u, far_v, thread, octaves, extent_u, extent_v):
    """(far, weave, thread) probabilities, which sum to 1.

    far_u, far_v, thread, octaves : `Limits.row`
    extent_u, extent_v : extent of the pixel along U and V, in threads

    `far` requires enough repeats in *both* directions: at a grazing view a pixel is long and thin,
    and the threads across its thin side are still visible. `thread` requires both directions as
    well. A NaN makes all three NaN.
    """
    if not extent_u + extent_v >= R(0):
        nan = R(np.nan)
        return nan, nan, nan
    far = _ramp(R, min(extent_u / far_u, extent_v / far_v), octaves)
    # In a pixel without extent a thread is infinitely wide: 1/0 is infinity here.
    close = (R(1) - far) * _ramp(R, thread / max(extent_u, extent_v), octaves)
    return far, R(1) - far - close, close


@njit(**INLINE)
def pick_level(R, far, weave, number):
    """The level for a uniform `number` in [0, 1), and the number rescaled to [0, 1) for reuse."""
    if number < far:
        return FAR, number / far
    if number < far + weave:
        return WEAVE, min((number - far) / weave, R(0.99999994))
    return THREAD, min((number - far - weave) / (R(1) - far - weave), R(0.99999994))


@njit(parallel=True, **KERNEL)
def _weights_all(R, row, extents, out):
    far_u, far_v, thread, octaves = row
    for k in prange(extents.shape[0]):
        out[k, 0], out[k, 1], out[k, 2] = level_weights(
            R, far_u, far_v, thread, octaves, extents[k, 0], extents[k, 1]
        )


def extent_of(across: ArrayLike, down: ArrayLike) -> NDArray[np.float64]:
    """(n, 2) extents of pixels in threads, which do not depend on the roll of the camera.

    across, down : (n, 2) change of the weave coordinates over one pixel to the right and one down
    """
    return np.hypot(np.asarray(across, np.float64), np.asarray(down, np.float64))


def weights(fabric: Fabric, extents: ArrayLike, limits: Limits = DEFAULT) -> NDArray[np.float64]:
    """(n, 3) probabilities of `far`, `weave`, `thread` for pixels of `extents` (n, 2) in threads.

    Infinite extents, at the horizon, give `far`. Raises `FabricError` for negative extents and NaN.
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
    out: NDArray[Any] = np.empty((len(asked), 3))
    _weights_all(np.float64, tuple(float(x) for x in limits.row(fabric)), asked, out)
    return out
