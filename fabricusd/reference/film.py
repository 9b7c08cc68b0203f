"""The picture as it grows: sums per pixel, their squares, and the layers that are read off them.

Every sample belongs to one pixel, so the variance of a pixel's mean is its own samples' variance
over their number.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.real import LEAN
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
`normal` and `tangent` means; `variance` is the variance of the pixel's mean."""

_ALWAYS = ("beauty", "direct", "indirect", "variance", "samples")
_FIRST = (DEPTH_Z, UV, UV + 1, THREAD_ID)
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


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
        self.beauty = np.zeros((3, pixels))
        self.squares = np.zeros((3, pixels))
        self.samples = np.zeros(pixels, np.int32)

    def add(self, pixels: NDArray[np.int32], samples: int, rows: NDArray[np.float32]) -> None:
        """Add `samples` paths of each of `pixels`, as `Wave.film` holds them."""
        _add(pixels, samples, rows, self.sums, self.beauty, self.squares, self.samples)

    def variance(self) -> NDArray[np.float64]:
        """(3, pixels) variance of each pixel's mean; infinite below two samples."""
        n = self.samples
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = np.maximum(self.squares - self.beauty**2 / n, 0.0) / (n - 1.0)
            return np.where(n > 1, spread / n, np.inf)

    def relative_error(self) -> NDArray[np.float64]:
        """(pixels,) standard error of luminance over luminance, with a floor at 1 % of the mean.

        The largest of a pixel and its eight neighbours: one lucky pixel must not stop early.
        """
        n = np.maximum(self.samples, 1)
        luminance = _LUMINANCE @ (self.beauty / n)
        deviation = np.sqrt(np.einsum("c,cp->p", _LUMINANCE**2, self.variance()))
        floor = max(0.01 * float(luminance.mean()), 1e-12)
        error = (deviation / np.maximum(np.abs(luminance), floor)).reshape(self.height, self.width)
        padded = np.pad(error, 1, mode="edge")
        around = [
            padded[j : j + self.height, i : i + self.width] for j in range(3) for i in range(3)
        ]
        return np.asarray(np.max(around, axis=0).ravel())

    def layer(self, name: str) -> NDArray[np.float32]:
        """One AOV, (height, width, channels) float32; 0 where nothing was sampled."""
        n = np.maximum(self.samples, 1)
        met = np.maximum(self.sums[ALPHA], 1e-20)
        if name == "beauty":
            value = np.concatenate([self.beauty / n, (self.sums[ALPHA] / n)[None]])
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
def _add(pixels, samples, rows, sums, beauty, squares, counts):  # type: ignore[no-untyped-def]
    for i in range(pixels.shape[0]):
        pixel = pixels[i]
        for k in range(i * samples, (i + 1) * samples):
            for c in range(3):
                value = float(rows[DIRECT + c, k]) + float(rows[INDIRECT + c, k])
                beauty[c, pixel] += value
                squares[c, pixel] += value * value
        first = -1
        for k in range(i * samples, (i + 1) * samples):
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
            total = np.float32(0)
            for k in range(i * samples, (i + 1) * samples):
                total += rows[row, k]
            sums[row, pixel] += total
        for k in range(i * samples, (i + 1) * samples):
            sums[ALPHA, pixel] += rows[ALPHA, k]
        counts[pixel] += samples
