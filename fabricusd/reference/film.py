"""The picture as it grows: sums per pixel, their spread, and the layers that are read off them.

Every sample belongs to one pixel, so what a pixel's mean varies by is read off its own samples.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.real import INLINE, LEAN
from fabricusd.errors import FabricError
from fabricusd.reference.wave import (
    ALBEDO,
    ALPHA,
    AT_LEVEL,
    BEAUTY_ROWS,
    DEPTH_Z,
    DIRECT,
    FILM_ROWS,
    INDIRECT,
    LIT,
    NORMAL,
    TANGENT,
    THREAD_ID,
    UNLIT,
    UV,
)

AOVS: dict[str, tuple[str, ...]] = {
    "beauty": ("R", "G", "B", "A"),
    "direct": ("R", "G", "B"),
    "indirect": ("R", "G", "B"),
    "albedo": ("R", "G", "B"),
    "normal": ("X", "Y", "Z"),
    "depth": ("Z",),
    "uv": ("U", "V"),
    "thread": ("ID",),
    "tangent": ("X", "Y", "Z"),
    "shadow": ("Y",),
    "level": ("Y",),
    "variance": ("R", "G", "B"),
    "samples": ("N",),
}
"""Layers and their channels. `albedo` is the surface's directional albedo towards the camera,
estimated; `shadow` the share of direct light that arrives; `depth`, `uv` and `thread` (-1 for none)
are those of a pixel's first sample that meets a surface, `level` (0 far, 1 weave, 2 thread),
`normal` and `tangent` means; `variance` bounds the variance of the pixel's mean, see `GROUP`."""

_ALWAYS = ("beauty", "direct", "indirect", "variance", "samples")
_FIRST = (DEPTH_Z, UV, UV + 1, THREAD_ID)
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)

GROUP = 4
"""Samples whose mean is one value of the variance's estimate. Samples of a pixel avoid one another,
so their own variance overstates that of their mean: 5.9 times at 64 samples of the draped cloth, in
groups of four 2.9 times. It is never understated, so `noise` is kept, at more cost than need be."""


def require_aovs(names: tuple[str, ...]) -> None:
    """Raise `FabricError` for a layer that does not exist."""
    for name in names:
        if name not in AOVS:
            raise FabricError("aov", f"is '{name}'; it must be one of {', '.join(AOVS)}")


class Film:
    """Sums of a picture of `width` by `height` pixels; `aovs` are the layers asked for."""

    def __init__(self, width: int, height: int, aovs: tuple[str, ...]) -> None:
        require_aovs(aovs)
        self.width, self.height, self.aovs = width, height, aovs
        self.extra = any(name not in _ALWAYS for name in aovs)
        pixels = width * height
        self.sums = np.zeros((FILM_ROWS if self.extra else BEAUTY_ROWS, pixels), np.float32)
        self.spread = np.zeros((3, pixels), np.float32)
        self.samples = np.zeros(pixels, np.int32)
        self.groups = np.zeros(pixels, np.int32)

    def add(self, pixels: NDArray[np.int32], samples: int, rows: NDArray[np.float32]) -> None:
        """Add `samples` paths of each of `pixels`, as `Wave.film` holds them."""
        group = max(1, min(GROUP, samples // GROUP))
        _add(pixels, samples, group, rows, self.sums, self.spread, self.samples, self.groups)

    def beauty(self) -> NDArray[np.float32]:
        """(3, pixels) mean radiance."""
        total = self.sums[DIRECT : DIRECT + 3] + self.sums[INDIRECT : INDIRECT + 3]
        return np.asarray(total / np.maximum(self.samples, 1), np.float32)

    def variance(self) -> NDArray[np.float32]:
        """(3, pixels) variance of each pixel's mean; infinite below two groups."""
        freedom = np.maximum(self.groups - 1, 1) * np.maximum(self.samples, 1)
        value = self.spread / freedom.astype(np.float32)
        return np.where(self.groups > 1, value, np.float32(np.inf))

    def relative_error(self) -> NDArray[np.float32]:
        """(pixels,) standard error of luminance over luminance, with a floor at 1 % of the mean.

        The largest of a pixel and its eight neighbours: one lucky pixel must not stop early. As
        channels vary together, their deviations add up, not their variances.
        """
        luminance = _LUMINANCE @ self.beauty()
        deviation = _LUMINANCE @ np.sqrt(self.variance())
        floor = max(0.01 * float(luminance.mean()), 1e-12)
        error = (deviation / np.maximum(np.abs(luminance), floor)).reshape(self.height, self.width)
        rows = error.copy()
        np.maximum(rows[1:], error[:-1], out=rows[1:])
        np.maximum(rows[:-1], error[1:], out=rows[:-1])
        worst = rows.copy()
        np.maximum(worst[:, 1:], rows[:, :-1], out=worst[:, 1:])
        np.maximum(worst[:, :-1], rows[:, 1:], out=worst[:, :-1])
        return np.asarray(worst.ravel())

    def layer(self, name: str) -> NDArray[np.float32]:
        """One AOV, (height, width, channels) float32; 0 where nothing was sampled."""
        n = np.maximum(self.samples, 1).astype(np.float32)
        met = np.maximum(self.sums[ALPHA], 1e-20)
        if name == "beauty":
            value = np.concatenate([self.beauty(), (self.sums[ALPHA] / n)[None]])
        elif name in ("direct", "indirect"):
            row = DIRECT if name == "direct" else INDIRECT
            value = self.sums[row : row + 3] / n
        elif name == "variance":
            variance = self.variance()
            value = np.where(np.isfinite(variance), variance, 0.0)
        elif name == "samples":
            value = self.samples[None]
        elif name == "shadow":
            value = (self.sums[LIT] / np.maximum(self.sums[UNLIT], 1e-20))[None]
        elif name in ("depth", "uv", "thread"):
            row = {"depth": DEPTH_Z, "uv": UV, "thread": THREAD_ID}[name]
            value = self.sums[row : row + len(AOVS[name])]
            if name == "thread":
                value = np.where(self.sums[ALPHA] > 0, value, -1.0)
        elif name == "level":
            value = (self.sums[AT_LEVEL] / met)[None]
        else:
            row = {"albedo": ALBEDO, "normal": NORMAL, "tangent": TANGENT}[name]
            value = self.sums[row : row + 3] / met
            if name != "albedo":
                value = value / np.maximum(np.linalg.norm(value, axis=0), 1e-20)
        picture = value.T.reshape(self.height, self.width, -1)
        return np.ascontiguousarray(picture, np.float32)

    def layers(self) -> dict[str, NDArray[np.float32]]:
        """All layers that were asked for; beauty is always among them."""
        names = ("beauty", *(name for name in self.aovs if name != "beauty"))
        return {name: self.layer(name) for name in names}


@njit(**LEAN)
def _add(pixels, samples, group, rows, sums, spread, counts, groups):  # type: ignore[no-untyped-def]
    for i in range(pixels.shape[0]):
        pixel = pixels[i]
        start, end = i * samples, (i + 1) * samples
        for c in range(3):
            done = np.float32(counts[pixel])
            total = sums[DIRECT + c, pixel] + sums[INDIRECT + c, pixel]
            for k in range(start, end, group):
                done, total, more = _add_group(rows, c, k, min(k + group, end), done, total)
                spread[c, pixel] += more
        groups[pixel] += (samples + group - 1) // group
        first = -1
        for k in range(start, end):
            if rows[ALPHA, k] > 0:
                first = k
                break
        for row in range(sums.shape[0]):
            if row in _FIRST:
                if first >= 0 and sums[ALPHA, pixel] == 0:
                    sums[row, pixel] = rows[row, first]
                continue
            if row == ALPHA:
                continue
            sums[row, pixel] += _sum(rows, row, start, end)
        sums[ALPHA, pixel] += _sum(rows, ALPHA, start, end)
        counts[pixel] += samples


@njit(**INLINE)
def _sum(rows, row, start, end):  # type: ignore[no-untyped-def]
    values = rows[row][start:end]
    total = np.float32(0)
    for k in range(values.size):
        total += values[k]
    return total


@njit(**INLINE)
def _add_group(rows, c, start, end, done, total):  # type: ignore[no-untyped-def]
    """Samples and their sum with the group's, and what it adds to the sum of squared deviations.

    [Chan1983]: from means, which keep their digits in float32 where sums of squares would not.
    """
    size = end - start
    own = _sum(rows, DIRECT + c, start, end) + _sum(rows, INDIRECT + c, start, end)
    together = np.float32(done + size)
    if done == 0:
        return together, own, np.float32(0)
    apart = own / np.float32(size) - total / np.float32(done)
    share = np.float32(done) * np.float32(size) / together
    return together, total + own, apart * apart * share
