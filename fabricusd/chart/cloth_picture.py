"""Pictures of flat cloth in which pixels and threads have a common period.

Every frequency of the cloth then falls into one bin of the picture's Fourier transform, so that
moiré can be told from detail.

The picture is SIZE pixels a side and covers `a, b` repeats: its x axis goes `a` repeats along U and
`b` along V, its y axis `-b` and `a`. A pixel is then `hypot(a, b)/SIZE` repeats wide, turned by
`atan2(b, a)`, and the picture tiles without a seam.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.surface import evaluate
from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

Floats = NDArray[np.float64]

SIZE = 64
"""Pixels per side."""

FINE = 768
"""Samples along a repeat for the spectrum of the cloth itself."""

TURN = math.radians(12.0)
"""Approximate roll of the camera against the weave [rad]."""


@dataclass(frozen=True, kw_only=True)
class View:
    """A fabric, seen and lit from fixed directions, and the width of a pixel on it.

    wi, wo : unit vectors in the surface frame
    a, b : repeats along U and V that the x axis of the picture crosses
    """

    fabric: Fabric
    wi: tuple[float, float, float]
    wo: tuple[float, float, float]
    a: int
    b: int
    shadow: str = "horizon"

    @property
    def repeat(self) -> int:
        """Threads along a side of the square in which the weave repeats."""
        return math.lcm(*true_repeat(self.fabric))

    @property
    def threads_per_pixel(self) -> float:
        """Width of a pixel in threads."""
        return self.repeat * math.hypot(self.a, self.b) / SIZE

    def uv(self, x: Floats, y: Floats) -> Floats:
        """(n, 2) weave coordinates at pixel coordinates (n,), from 0 to SIZE."""
        m = self.repeat / SIZE
        return np.stack((m * (self.a * x - self.b * y), m * (self.b * x + self.a * y)), axis=1)

    def value(self, uv: Floats, level: str) -> Floats:
        """(n,) mean of the channels at weave coordinates (n, 2)."""
        return cloth_value(self.fabric, self.wi, self.wo, uv, level, self.shadow)


def cloth_value(
    fabric: Fabric,
    wi: tuple[float, float, float],
    wo: tuple[float, float, float],
    uv: Floats,
    level: str,
    shadow: str,
) -> Floats:
    """(n,) radiance per unit `L_i dwi` at weave coordinates (n, 2), mean of the channels."""
    if level == "far":
        return np.repeat(evaluate(fabric, wi, wo, shadow=shadow).mean(axis=1), len(uv))
    return np.asarray(evaluate(fabric, wi, wo, uv, level, shadow).mean(axis=1))


def view_of(
    fabric: Fabric,
    threads_per_pixel: float,
    wi: tuple[float, float, float] = (0.48, 0.36, 0.8),
    wo: tuple[float, float, float] = (0.0, -0.28, 0.96),
    shadow: str = "horizon",
) -> View:
    """The view whose pixel is as near as possible to `threads_per_pixel` wide."""
    repeat = math.lcm(*true_repeat(fabric))
    across = threads_per_pixel * SIZE / repeat
    a, b = round(across * math.cos(TURN)), round(across * math.sin(TURN))
    if max(a, b) < 1:
        raise FabricError(
            "threads_per_pixel",
            f"is {threads_per_pixel:g}; it must be large enough that {SIZE} pixels span a repeat "
            f"of {repeat} threads",
        )
    return View(fabric=fabric, wi=wi, wo=wo, a=a, b=b, shadow=shadow)


def ideal_spectrum(view: View, level: str = "weave") -> NDArray[np.complex128]:
    """(SIZE, SIZE) Fourier coefficients of the cloth below the picture's Nyquist frequency, rows y.

    This is what a camera without aliasing and without blur would record.
    """
    cloth = cloth_spectrum(view, level)
    k = np.fft.fftfreq(FINE, 1.0 / FINE).astype(np.int64)
    kv, ku = np.meshgrid(k, k, indexing="ij")
    x, y = view.a * ku + view.b * kv, view.a * kv - view.b * ku
    inside = (np.abs(x) < SIZE / 2) & (np.abs(y) < SIZE / 2)
    ideal = np.zeros((SIZE, SIZE), np.complex128)
    ideal[y[inside] % SIZE, x[inside] % SIZE] = cloth[inside]
    return ideal


def cloth_spectrum(view: View, level: str) -> NDArray[np.complex128]:
    """(FINE, FINE) Fourier coefficients of one repeat, rows V."""
    line = (np.arange(FINE) + 0.5) / FINE * view.repeat
    v, u = np.meshgrid(line, line, indexing="ij")
    uv = np.stack((u.ravel(), v.ravel()), axis=1)
    found = np.fft.fft2(view.value(uv, level).reshape(FINE, FINE)) / FINE**2
    # Account for the samples, which lie in the middle of their cells.
    k = np.fft.fftfreq(FINE, 1.0 / FINE)
    shift = np.exp(-1j * np.pi * k / FINE)
    return np.asarray(found * shift[:, None] * shift[None, :])


def picture(view: View, level: str, across: int) -> Floats:
    """(SIZE, SIZE) pixels, each the mean of `across` by `across` samples."""
    line = (np.arange(SIZE * across) + 0.5) / across
    y, x = np.meshgrid(line, line, indexing="ij")
    value = view.value(view.uv(x.ravel(), y.ravel()), level)
    return np.asarray(value.reshape(SIZE, across, SIZE, across).mean(axis=(1, 3)))


class Difference(NamedTuple):
    """The difference of a picture (SIZE, SIZE) from the ideal, in three parts.

    alias : what it has and should not have
    blur : what it should have and lacks
    shift : how far its mean is off

    Each is a root mean square over the mean; the squares add up to that of the whole difference.
    """

    alias: float
    blur: float
    shift: float

    @property
    def total(self) -> float:
        """Root mean square of the whole difference."""
        return math.hypot(*self)


def difference(found: Floats, ideal: NDArray[np.complex128]) -> Difference:
    """The difference of a picture from `ideal_spectrum`, divided bin by bin.

    Whatever shortens a coefficient of the ideal is blur. All else is alias, mostly folded
    frequencies.
    """
    k = np.fft.fftfreq(SIZE, 1.0 / SIZE)
    shift = np.exp(-1j * np.pi * k / SIZE)
    spectrum = np.fft.fft2(found) / SIZE**2 * shift[:, None] * shift[None, :]
    error, size = spectrum - ideal, np.abs(ideal)
    along = np.where(size > 0, np.real(error * np.conj(ideal)) / np.maximum(size, 1e-300), 0.0)
    lost = np.minimum(along, 0.0) ** 2
    extra = np.maximum(np.abs(error) ** 2 - lost, 0.0)
    lost[0, 0] = extra[0, 0] = 0.0
    mean = abs(ideal[0, 0])
    return Difference(
        alias=math.sqrt(float(extra.sum())) / mean,
        blur=math.sqrt(float(lost.sum())) / mean,
        shift=abs(error[0, 0]) / mean,
    )
