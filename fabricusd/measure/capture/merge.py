"""Exposures of one view merged into linear radiance per site of the sensor.

Two ways. `counts` sums the linear light of all exposures that are not saturated there, over the sum
of their times: no weight depends on a noisy code, and dark sites keep every exposure. `thesis` is
eq. 3.3 as printed: weighted by a Gaussian of the code, with the dark and the saturated rejected;
where nothing is left the value is 0, so dim threads lose light (9 % at 12 bits, up to 77 % at 8).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

Floats = NDArray[np.float64]

HDR = ("counts", "thesis")
BRIGHTEST = 0.92
"""Share of the largest code from which a site counts as saturated."""
DARKEST = 0.02
"""Share of the largest code above dark below which eq. 3.3 rejects a site."""
HOT = 10.0
"""Deviations of a mean dark frame beyond which a site is hot."""
BLOOM = 5
"""Sites around a saturated one that are rejected along with it: its charge spills over."""


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """What turns codes into light.

    response : (levels + 1,) float32 exposure of each code
    dark : exposure time [s] -> (4,) mean exposure without light, per site of the 2 x 2 filter
    levels : the largest code; hdr : one of HDR
    hot : (k, 2) rows and columns of sites that are bright without light; their neighbours of the
        same colour stand in for them
    """

    response: NDArray[np.float32]
    dark: dict[float, Floats]
    levels: int
    hdr: str = "counts"
    hot: NDArray[np.intp] = field(default_factory=lambda: np.empty((0, 2), np.intp))

    def dark_of(self, seconds: float) -> Floats:
        """(4,) exposure without light, interpolated between the times that were photographed."""
        if seconds in self.dark:
            return self.dark[seconds]
        times = np.array(sorted(self.dark))
        table = np.stack([self.dark[t] for t in times])
        return np.array([np.interp(seconds, times, table[:, site]) for site in range(4)])


@dataclass(frozen=True, kw_only=True)
class Merged:
    """radiance : (h, w) exposure per second; lost : sites saturated in every exposure"""

    radiance: Floats
    lost: int


def merge(frames: dict[float, list[NDArray[Any]]], sensor: Sensor) -> Merged:
    """Merge frames, exposure [s] -> shots of (h, w) codes, h and w even."""
    if sensor.hdr == "thesis":
        return _merge_thesis(frames, sensor)
    times = sorted(frames)
    shape = frames[times[0]][0].shape
    light = np.zeros(shape)
    seconds: Any = 0.0
    lost = 0
    for t in times:
        shots = frames[t]
        brightest = shots[0] if len(shots) == 1 else np.maximum.reduce(shots)
        linear = _linear(shots, sensor, t)
        if float(brightest.max()) < BRIGHTEST * sensor.levels:
            light += linear
            seconds = seconds + t
            continue
        full = brightest >= BRIGHTEST * sensor.levels
        full[tuple(sensor.hot.T)] = False
        if t == times[0]:
            lost = int(np.count_nonzero(full))
            full[:] = False
        elif full.any():
            full = maximum_filter(full, BLOOM)
        light += np.where(full, 0.0, linear)
        seconds = seconds + np.where(full, 0.0, t)
    return Merged(radiance=_repaired(light / seconds, sensor.hot), lost=lost)


def _merge_thesis(frames: dict[float, list[NDArray[Any]]], sensor: Sensor) -> Merged:
    """Eq. 3.3: sum w t I(y)/sum w t^2, and 0 where all exposures are rejected."""
    above: Any = 0.0
    below: Any = 0.0
    lost: Any = True
    for t, shots in sorted(frames.items()):
        code = np.mean(shots, axis=0)
        # The dark code: where the response has the dark exposure.
        black = float(np.searchsorted(sensor.response, float(sensor.dark_of(t).mean())))
        half = 0.5 * sensor.levels
        weight = np.exp(-4.0 * ((code - half) / half) ** 2)
        full = code >= BRIGHTEST * sensor.levels
        weight = weight * ~full * (code > black + DARKEST * sensor.levels)
        lost = lost & full
        above = above + weight * t * _linear(shots, sensor, t)
        below = below + weight * t * t
    seen = below > 0
    radiance = np.where(seen, above / np.where(seen, below, 1.0), 0.0)
    lost = np.asarray(lost)
    lost[tuple(sensor.hot.T)] = False
    return Merged(radiance=_repaired(radiance, sensor.hot), lost=int(np.count_nonzero(lost)))


def hot_sites(dark: NDArray[Any]) -> NDArray[np.intp]:
    """(k, 2) rows and columns of sites that stand out of a mean (h, w) dark frame."""
    middle = float(np.median(dark))
    # Codes are whole numbers: their deviation is never known to be below half of one.
    deviation = max(1.4826 * float(np.median(np.abs(dark - middle))), 0.5)
    return np.argwhere(np.abs(dark - middle) > HOT * deviation)


def _repaired(radiance: Floats, hot: NDArray[np.intp]) -> Floats:
    """`radiance`, its hot sites replaced by the mean of their neighbours of the same colour."""
    h, w = radiance.shape
    spoilt = {(int(y), int(x)) for y, x in hot}
    for y, x in spoilt:
        near = [(y - 2, x), (y + 2, x), (y, x - 2), (y, x + 2)]
        good = [p for p in near if 0 <= p[0] < h and 0 <= p[1] < w and p not in spoilt]
        radiance[y, x] = np.mean([radiance[p] for p in good]) if good else 0.0
    return radiance


def _linear(shots: list[NDArray[Any]], sensor: Sensor, seconds: float) -> Floats:
    """(h, w) mean exposure of the shots, less that of darkness."""
    total = np.zeros(shots[0].shape)
    for codes in shots:
        total += sensor.response[codes]
    total /= len(shots)
    dark = sensor.dark_of(seconds)
    for site in range(4):
        total[site // 2 :: 2, site % 2 :: 2] -= dark[site]
    return total
