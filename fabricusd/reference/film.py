"""The film: accumulates samples per pixel, estimates their variance, and derives the layers.

Every sample belongs to exactly one pixel, so the variance of a pixel's mean is estimated from that
pixel's own samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.errors import FabricError, did_you_mean
from fabricusd.kernels.real import INLINE, LEAN
from fabricusd.reference.rays.wave import (
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
"""Layers and their channels. `albedo` is an estimate of the surface's directional albedo towards
the camera; `shadow` is the share of direct light that arrives. `level` (0 far, 1 weave, 2 thread),
`normal` and `tangent` are means over a pixel's samples; the last two describe the shading frame
after normal mapping. `depth`, `uv` and `thread` come from a single sample, the first of the pixel
that hits a surface. That sample may lie anywhere in the pixel filter, so these layers are neither
anti-aliased nor taken at the pixel's centre. `depth` is planar: metres along the camera's axis, not
along the ray. `thread` is the number that the map `thread_id` of a bake holds, see
`weave.thread_number`; it is -1 at level far and where no thread is seen. `variance` is the variance
of the pixel's mean, see `Film.variance`."""

_ALWAYS = ("beauty", "direct", "indirect", "variance", "samples")
_FIRST = (DEPTH_Z, UV, UV + 1, THREAD_ID)
_LUMINANCE = tuple(np.float32(share) for share in (0.2126, 0.7152, 0.0722))

GROUP = 4
"""Number of samples averaged into one group; the first estimate of the variance is that of the
groups' means. It overstates the variance, because the samples of a pixel are stratified and so are
these means: at 64 samples of the draped cloth it is 3 times the squared error. Groups of a single
sample would give 6 times."""

TILE = 16
"""Side, in pixels, of the square tiles in which halves are compared, see `Film.compare_halves`."""
_FEWEST = TILE * TILE // 4
"""Number of pixels that must be ready before a tile's share is updated."""
_LEAST_SHARE, _LARGEST_SHARE = 1.0 / 64.0, 2.0
_BRIGHTEST = 1e15


def _luminance(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """The luminance of (3, n) channels. A matrix product would start threads of BLAS, which then
    spin for a tenth of a second on processors that workers need."""
    red, green, blue = _LUMINANCE
    return np.asarray(red * rows[0] + green * rows[1] + blue * rows[2])


def require_aovs(names: tuple[str, ...]) -> None:
    """Raise `FabricError` for a layer that does not exist."""
    for name in names:
        if name not in AOVS:
            raise FabricError(
                "aov", f"is '{name}'{did_you_mean(name, AOVS)}; it must be one of {', '.join(AOVS)}"
            )


class FilmPart(NamedTuple):
    """The sums of some pixels: n pixels of a film, which need not be neighbours.

    sums : (rows, n) float32; spread : (3, n) float32; samples, groups : (n,) int32
    """

    sums: NDArray[np.float32]
    spread: NDArray[np.float32]
    samples: NDArray[np.int32]
    groups: NDArray[np.int32]

    def add(self, pixels: NDArray[np.int32], samples: int, rows: NDArray[np.float32]) -> None:
        """Add `samples` paths for each of `pixels`, laid out as in `Wave.film`."""
        group = max(1, min(GROUP, samples // GROUP))
        _add(pixels, samples, group, rows, *self)

    def copy(self) -> FilmPart:
        """The same sums, in memory of their own."""
        sums, spread, samples, groups = self
        return FilmPart(sums.copy(), spread.copy(), samples.copy(), groups.copy())


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
        self._half = np.zeros(pixels, np.float32)
        self._half_samples = np.zeros(pixels, np.int32)
        tiles = (-(-height // TILE), -(-width // TILE))
        self._share = np.ones(tiles, np.float32)

    def add(self, pixels: NDArray[np.int32], samples: int, rows: NDArray[np.float32]) -> None:
        """Add `samples` paths for each of `pixels`, laid out as in `Wave.film`."""
        self.whole.add(pixels, samples, rows)

    @property
    def whole(self) -> FilmPart:
        """All pixels, not copied."""
        return FilmPart(self.sums, self.spread, self.samples, self.groups)

    def take(self, pixels: NDArray[np.int32]) -> FilmPart:
        """A copy of the sums of `pixels`."""
        sums, spread, samples, groups = self.whole
        return FilmPart(sums[:, pixels], spread[:, pixels], samples[pixels], groups[pixels]).copy()

    def put(self, pixels: NDArray[np.int32], part: FilmPart) -> None:
        """Replace the sums of `pixels`."""
        for mine, theirs in zip(self.whole, part, strict=True):
            mine[..., pixels] = theirs

    def beauty(self) -> NDArray[np.float32]:
        """(3, pixels) mean radiance."""
        total = self.sums[DIRECT : DIRECT + 3] + self.sums[INDIRECT : INDIRECT + 3]
        return np.asarray(total / np.maximum(self.samples, 1), np.float32)

    def variance(self) -> NDArray[np.float32]:
        """(3, pixels) estimated variance of each pixel's mean; infinite below two groups.

        The estimate is the variance of the groups' means times the tile's share: the fraction of
        that variance that `compare_halves` measured in the tile. Without the share, the estimate
        would hold for independent samples only.
        """
        freedom = np.maximum(self.groups - 1, 1) * np.maximum(self.samples, 1)
        value = self.spread / freedom.astype(np.float32)
        share = np.repeat(self._share, TILE, axis=0)[: self.height]
        value *= np.repeat(share, TILE, axis=1)[:, : self.width].reshape(-1)
        return np.where(self.groups > 1, value, np.float32(np.inf))

    def compare_halves(self) -> None:
        """Update the tiles' shares by comparing earlier samples with later ones; call after a pass.

        If two halves of a pixel's samples are independent, the square of half the distance between
        their means is an unbiased estimate of the variance of the whole mean. Halves of a Sobol'
        sequence are nearly independent: the estimate is 1.6 times the squared error at 32 samples
        of the draped cloth and 1.1 times at 128. For a single pixel it is too noisy to use. Summed
        over a tile and divided by the groups' estimate there, it is a share for all its pixels.
        """
        for row, top in enumerate(range(0, self.height, TILE)):
            part = slice(top * self.width, min(top + TILE, self.height) * self.width)
            self._share[row] = self._shares(part, self._share[row])
            n, m = self.samples[part], self._half_samples[part]
            grown = (n > 0) & (n >= 2 * m)
            total = _luminance(self._total(part))
            self._half[part] = np.where(grown, total, self._half[part])
            self._half_samples[part] = np.where(grown, n, m)

    def _shares(self, part: slice, before: NDArray[np.float32]) -> NDArray[np.float32]:
        """The shares of one row of tiles; `before` where too few pixels have a second half."""
        counts, halves = self.samples[part], self._half_samples[part]
        ready = (halves > 0) & (3 * halves <= 2 * counts) & (self.groups[part] > 1)
        n = np.maximum(counts, 1).astype(np.float32)
        m = np.where(ready, halves, 0).astype(np.float32)
        mean = _luminance(self._total(part)) / n
        deviation = _luminance(np.sqrt(self.spread[:, part]))
        # The squares of larger values overflow float32.
        ready &= (np.abs(mean) < _BRIGHTEST) & (deviation < _BRIGHTEST)
        mean, deviation = np.where(ready, mean, 0), np.where(ready, deviation, 0)
        apart = np.where(ready, mean - self._half[part] / np.maximum(m, 1), 0)
        seen = apart * apart * m / np.maximum(n - m, 1)
        said = deviation * deviation / (np.maximum(self.groups[part] - 1, 1) * n)
        floor = max(0.01 * float(mean.mean()), 1e-12)
        scale = ready / (mean * mean + np.float32(floor**2))
        columns = np.arange(0, self.width, TILE)
        seen, said, pixels = (
            np.add.reduceat(x.reshape(-1, self.width).sum(axis=0, dtype=np.float64), columns)
            for x in (seen * scale, said * scale, ready)
        )
        share = np.clip(seen / np.maximum(said, 1e-30), _LEAST_SHARE, _LARGEST_SHARE)
        return np.where((pixels >= _FEWEST) & (said > 0), share, before).astype(np.float32)

    def _total(self, part: slice) -> NDArray[np.float32]:
        """(3, n) sums of radiance."""
        return np.asarray(
            self.sums[DIRECT : DIRECT + 3, part] + self.sums[INDIRECT : INDIRECT + 3, part]
        )

    def relative_error(self) -> NDArray[np.float32]:
        """(pixels,) standard error of luminance over luminance, with a floor at 1 % of the mean.

        Each pixel takes the largest error among itself and its eight neighbours, so that one lucky
        pixel does not stop early. The colour channels are correlated, so their standard deviations
        are added rather than their variances.
        """
        luminance = _luminance(self.beauty())
        deviation = _luminance(np.sqrt(self.variance()))
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
        """(height, width, channels) float32 the layer `name`; 0 where nothing was sampled."""
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
        """The requested layers by name; beauty is always among them."""
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
    """Merge a group: (samples, sum, increase of the sum of squared deviations) after merging.

    [Chan1983], which works with means: sums of squares would lose their digits in float32.
    """
    size = end - start
    own = _sum(rows, DIRECT + c, start, end) + _sum(rows, INDIRECT + c, start, end)
    together = np.float32(done + size)
    if done == 0:
        return together, own, np.float32(0)
    apart = own / np.float32(size) - total / np.float32(done)
    share = np.float32(done) * np.float32(size) / together
    return together, total + own, apart * apart * share
