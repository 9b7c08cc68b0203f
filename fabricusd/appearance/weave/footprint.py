"""Level `auto`: how much of the cloth to model, from the size of a pixel on it.

The pixel's extent is measured in threads, weave coordinates: `far` where a repeat is narrower than
two pixels, `weave` where threads resolve, `thread` where a thread is wider than a pixel: `Limits`.
Between them the levels are mixed by chance, with weights that are continuous in the extent; since
the mean of each level over what the next one cannot see is that next one, the mean of a picture
does not jump. Source: `docs/model.md` section 8, which has one repeat a pixel, where `weave` is
moire, and four pixels a thread: the satin's `weave` is off by 1.3 of the mean where a thread is two
pixels wide, `chart.level_errors`.
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
    """Where level `auto` goes from one level to the next.

    repeats : repeats under a pixel where `far` and `weave` are equally likely
    pixels : pixels on a thread where `weave` and `thread` are equally likely
    octaves : half the width of either transition: at 1 it reaches from half to twice the extent
        that it is centred on, at 0 it is a step
    """

    repeats: float = 0.4
    pixels: float = 1.0
    octaves: float = 0.5

    def row(self, fabric: Fabric) -> tuple[float, float, float, float]:
        """What `level_weights` takes for a fabric; limits that are never reached stay finite, so
        that over an infinite extent they are not 0/0."""
        ends, picks = true_repeat(fabric)
        repeats = min(self.repeats, _NEVER)
        thread = 1.0 / max(self.pixels, 1.0 / _NEVER)
        return repeats * ends, repeats * picks, thread, self.octaves


DEFAULT = Limits()
"""Above half a repeat a pixel no picture can show the repeat (`chart.zoom`): what is left of it is
moire, in `weave` 0.05 to 0.4 of the mean, and noise, with 64 samples of satin 0.3. Below a third
`far` misses more than that. Where `weave` and `thread` meet they differ by a tenth to a fifth of
the mean (`chart.level_errors`), but for the satin, by half of it."""


@njit(**INLINE)
def _ramp(R, x, octaves):
    """Smooth step in log2 of `x`, 0.5 at 1 and flat `octaves` away on both sides."""
    x = min(max(x, R(1e-30)), R(1e30))
    t = R(0.5) + real.log(R, x) * R(0.5 / np.log(2.0)) / max(octaves, R(1e-3))
    t = min(max(t, R(0)), R(1))
    return t * t * (R(3) - R(2) * t)


@njit(**INLINE)
def level_weights(R, far_u, far_v, thread, octaves, extent_u, extent_v):
    """(far, weave, thread) probabilities, which sum to 1.

    far_u, far_v, thread, octaves : `Limits.row`; extent_u, extent_v : of the pixel, in threads,
    along U and V. `far` asks for enough in *both* directions: at a grazing view a pixel is long and
    thin, and the threads across its thin side are still seen. `thread` asks both likewise. NaN
    makes all three NaN.
    """
    if not extent_u + extent_v >= R(0):
        nan = R(np.nan)
        return nan, nan, nan
    far = _ramp(R, min(extent_u / far_u, extent_v / far_v), octaves)
    # A pixel without extent sees a thread infinitely wide: 1/0 is infinity here.
    close = (R(1) - far) * _ramp(R, thread / max(extent_u, extent_v), octaves)
    return far, R(1) - far - close, close


@njit(**INLINE)
def pick_level(R, far, weave, number):
    """Level for a uniform `number` in [0, 1), and the number stretched to [0, 1) to use again."""
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
    """(n, 2) extent in threads of a pixel whose steps to the right and down move the weave
    coordinates by `across` and `down`, both (n, 2): the same whichever way the camera is rolled."""
    return np.hypot(np.asarray(across, np.float64), np.asarray(down, np.float64))


def weights(fabric: Fabric, extents: ArrayLike, limits: Limits = DEFAULT) -> NDArray[np.float64]:
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
    out: NDArray[Any] = np.empty((len(asked), 3))
    _weights_all(np.float64, tuple(float(x) for x in limits.row(fabric)), asked, out)
    return out
