"""What a photograph shows at the size of threads: how strong the weave is, and how uneven.

The spectrum near the frequencies of the lattice is the weave, whatever drifts in it; the rest of it
is unevenness and noise of the camera, which the autocorrelation along and across threads parts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fabricusd.measure.flat.lattice import Lattice, lattice_points, waves_of, window_of
from fabricusd.measure.flat.photograph import LUMINANCE, Photograph

Floats = NDArray[np.float64]

REACH = 0.016
"""Distance from a point of the lattice, in cycles per pixel, that is still the weave's: cloth is
never quite regular."""
SEEN = 0.15
"""Share of the cloth below which a pair of places along threads tells nothing of them."""
METHOD = 0.3
"""What the estimate itself may be off by: drifting weave is not wholly taken out, and part of the
unevenness is."""
DARK = 0.004
"""Mean of a channel below which its texture is rounding."""


@dataclass(frozen=True, kw_only=True)
class Texture:
    """contrast : standard deviation of what repeats, over the mean
    waves : (k, 2) cycles per pixel of `color_waves`; slow : contrast of them alone, or of all
    slow_error : what a lens may have changed of the logarithm of the latter, and a model of cloth
    channels : (3,) slow contrast of each channel over that of the luminance, with sign, NaN where
        it is too dark to tell
    """

    contrast: float
    waves: Floats
    slow: float
    slow_error: float
    channels: Floats


@dataclass(frozen=True, kw_only=True)
class Unevenness:
    """Of one set of threads. shade : standard deviation of its light along it, over the mean, with
    its 95 % interval; length : over which it changes [pixels]
    """

    shade: float
    low: float
    high: float
    length: float


LENS = 0.35
"""By how much the variance of a lens's blur differs from that of a pixel's filter [square pixels],
..."""
MODEL_ERROR, MOST_ERROR = 0.1, 0.3
"""... what the logarithm of a fitted cloth's contrast may be off by, and the most of both."""
COARSEST = 2 / 40
"""Cycles per pixel below which change is light and folds."""


FINE = 3.0
"""Pixels a thread below which no wave of the weave is slow: a lens blurs all of them alike."""


def color_waves(lattice: Lattice) -> Floats:
    """(k, 2) cycles per pixel of the waves of a weave that are slower than its threads, one of each
    pair of opposites: what differs from cell to cell. The faster ones also tell the shape of
    threads and the blur of a lens. None where threads are fine."""
    waves = waves_of(lattice.weave)[0]
    found = waves[np.abs(waves).max(axis=1) < 1.0] @ lattice.frequencies.T
    clear = (np.hypot(*found.T) >= COARSEST) & (np.abs(found).max(axis=1) < 0.5)
    return np.asarray(found[clear & (min(lattice.pitch) >= FINE)])


def _middle(photograph: Photograph, reach: float) -> Floats:
    """(3 + 1, n, n) relative texture of the channels and of the luminance, row 0 at negative y.

    reach : pixels over which light is taken to be even
    """
    n = window_of(photograph)
    rows, columns = photograph.shape
    top, left = (rows - n) // 2, (columns - n) // 2
    planes = [photograph.linear[..., c] for c in range(3)] + [photograph.linear @ LUMINANCE]
    found = [
        (p / np.maximum(gaussian_filter(p, reach), 1e-5) - 1.0)[top : top + n, left : left + n]
        for p in planes
    ]
    return np.stack(found)[:, ::-1]


def near_lattice(lattice: Lattice, n: int, reach: float = REACH) -> NDArray[np.bool_]:
    """(n, n) which frequencies of an FFT are the weave's, up to `reach` beside the lattice."""
    points = lattice_points(waves_of(lattice.weave)[0]) @ lattice.frequencies.T
    return _near(points, n, reach)


def _near(points: Floats, n: int, reach: float) -> NDArray[np.bool_]:
    f = np.fft.fftfreq(n)
    u, v = np.meshgrid(f, f)
    points = points[(np.abs(points).max(axis=1) < 0.5 + reach) & (np.abs(points).max(axis=1) > 0)]
    found = np.zeros((n, n), bool)
    for x, y in points:
        found |= (u - x) ** 2 + (v - y) ** 2 < reach**2
    found[np.hypot(u, v) < COARSEST] = False
    return found


def texture_of(photograph: Photograph, lattice: Lattice) -> Texture:
    """How strong the weave is."""
    slow = color_waves(lattice)
    # What light is taken to be must not follow the slowest wave: this leaves it 2 % of it.
    slowest = min(np.hypot(*slow.T), default=1.0)
    planes = _middle(photograph, max(window_of(photograph) / 32, 0.45 / slowest))
    n = planes.shape[-1]
    mask = near_lattice(lattice, n)
    w = np.hanning(n + 1)[:n]
    window = np.outer(w, w)
    scale = 1.0 / (n * n * (window**2).sum())
    waves = np.fft.fft2(planes * window)
    power = np.abs(waves[3]) ** 2 * scale
    # What lies under the peaks is noise as strong as beside them, at the same distance from 0.
    radius = (np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.fftfreq(n))) * n / 4).astype(int)
    outside = np.where(mask, 0.0, power)
    count = np.bincount(radius.ravel(), (~mask).ravel().astype(float))
    floor = np.bincount(radius.ravel(), outside.ravel()) / np.maximum(count, 1.0)
    clear = power - floor[radius]
    mine = _near(np.concatenate((slow, -slow)), n, REACH) if len(slow) else mask
    whole = float((np.abs(waves[3][mine]) ** 2).sum())
    channels = (waves[:3, mine] * np.conj(waves[3, mine])).real.sum(axis=1) / max(whole, 1e-30)
    dark = photograph.linear.mean(axis=(0, 1)) < DARK
    square = np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.fftfreq(n)))[mine] ** 2
    steepness = float((power[mine] * square).sum() / max(power[mine].sum(), 1e-30))
    blurred = 2.0 * np.pi**2 * LENS * steepness
    return Texture(
        contrast=float(np.sqrt(max(clear[mask].sum(), 1e-8))),
        waves=slow,
        slow=float(np.sqrt(max(clear[mine].sum(), 1e-8))),
        slow_error=float(min(np.hypot(MODEL_ERROR, blurred), MOST_ERROR))
        if len(slow)
        else MOST_ERROR,
        channels=np.where(dark, np.nan, channels),
    )


def unevenness_of(photograph: Photograph, lattice: Lattice) -> tuple[Unevenness, Unevenness]:
    """(warp, weft): what is left without the weave, by its autocorrelation along the threads.

    From one thread to the next on, grain of the camera correlates with no neighbour; blotches
    correlate alike in all directions, which the autocorrelation aslant tells.
    """
    planes = _middle(photograph, window_of(photograph) / 8)
    n = planes.shape[-1]
    waves = np.fft.fft2(planes[3])
    # Uneven threads have their power beside the lattice too: where its points are close, less of
    # what drifts is taken out.
    points = lattice_points(waves_of(lattice.weave)[0]) @ lattice.frequencies.T
    lengths = np.linalg.norm(points, axis=1)
    closest = float(lengths[lengths > 1e-6].min())
    waves[near_lattice(lattice, n, min(REACH, closest / 8))] = 0.0
    waves[0, 0] = 0.0
    covariance = np.fft.ifft2(np.abs(waves) ** 2).real / n**2
    nearest = max(int(np.ceil(max(lattice.pitch))), 2)
    lag = np.arange(nearest, max(n // 8, nearest + 4))
    around = 0.5 * (covariance[lag, lag] + covariance[lag, -lag])
    found = []
    cells = lattice.weave.cells.astype(float)
    for along, seen, pitch in (
        (covariance[lag, 0], cells, lattice.pitch[1]),
        (covariance[0, lag], 1.0 - cells.T, lattice.pitch[0]),
    ):
        both = _both_seen(seen, lag / pitch)
        some = both > SEEN
        if not some.any():
            found.append(Unevenness(shade=0.0, low=0.0, high=1.0, length=float(lag[-1])))
            continue
        own = (along - around)[some] / both[some]
        at = max(float(own[0]), 0.0)
        fallen = np.flatnonzero(own < at / np.e)
        length = float(lag[some][fallen[0]]) if fallen.size and at > 0 else float(lag[-1])
        # Bartlett: independent pieces of the picture number as many as its area over the length.
        error = 1.96 * float(covariance[0, 0]) * np.sqrt(2.0 * max(length, 1.0)) / n
        error /= float(both[some][0])
        found.append(
            Unevenness(
                shade=float(np.sqrt(at)), low=(1 - METHOD) * float(np.sqrt(max(at - error, 0.0))),
                high=(1 + METHOD) * float(np.sqrt(at + error)), length=length,
            )
        )  # fmt: skip
    return found[0], found[1]


def _both_seen(seen: Floats, steps: Floats) -> Floats:
    """(n,) share of the cloth where a thread is on top both here and so many cells along it.

    seen : (threads, cells along) 1 where it is on top
    """
    count = seen.shape[1]
    whole = np.array([(seen * np.roll(seen, -k, axis=1)).mean() for k in range(count + 1)])
    return np.asarray(np.interp(steps % count, np.arange(count + 1), whole))


def gap_of(through: Photograph) -> tuple[float, float, float]:
    """(gap, low, high): the share of the cloth through which the lamp itself is seen.

    Only before the lamp is its light seen through gaps: as specks that are far above what is around
    them. They spread over neighbouring pixels, and the lamp's rim is not sharp, so the bounds are
    the share of specks that are saturated, and of all of them twice.
    """
    y = through.luminance
    rows, columns = through.shape
    reach = max(min(rows, columns) // 40, 4)
    around = gaussian_filter(y, reach)
    i, j = np.mgrid[:rows, :columns]
    away = np.hypot(i - rows / 2, j - columns / 2)
    near, ring = away < 2 * reach, (away > 6 * reach) & (away < 10 * reach)
    usual = float((y / np.maximum(around, 1e-6))[ring].std())
    specks = y > around * (1.0 + max(4.0 * usual, 0.5))
    share = float(specks[near].mean())
    bright = float((through.saturated & specks)[near].mean())
    if share < 0.002:
        return 0.0, 0.0, 0.002
    return share, min(bright, share), min(2.0 * share, 1.0)
