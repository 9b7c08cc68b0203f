"""Photographs as a fit takes them: linear light, and refused where they cannot be one."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fabricusd.errors import FabricError
from fabricusd.images.files import read_image

Floats = NDArray[np.float64]

SMALLEST = 128
"""Pixels that a photograph must have per side: the spectrum of fewer tells no period."""
LARGEST = 8192
DARKEST = 1e-4
"""Mean light below which a photograph shows nothing."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
SATURATED = 0.985
"""Linear value from which a pixel counts as saturated."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Photograph:
    """name : of the file; linear : (h, w, 3) linear Rec. 709, 1 being the largest code."""

    name: str
    linear: Floats

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) in pixels."""
        return self.linear.shape[0], self.linear.shape[1]

    @property
    def luminance(self) -> Floats:
        """(h, w) linear."""
        return np.asarray(self.linear @ LUMINANCE)

    @property
    def saturated(self) -> NDArray[np.bool_]:
        """(h, w) which pixels are at the largest code in some channel."""
        return np.asarray((self.linear >= SATURATED).any(axis=2))


def read_photograph(path: str | os.PathLike[str]) -> Photograph:
    """The photograph in a file: 8 bits are sRGB, 16 bits and floats linear.

    Raises FabricError for what is not a picture, too small, too large, dark or not finite.
    """
    where = os.fspath(path)
    pixels = np.asarray(read_image(where), np.float64)
    height, width = pixels.shape[:2]
    if min(height, width) < SMALLEST or max(height, width) > LARGEST:
        raise FabricError(
            f"'{where}'",
            f"has {width} x {height} pixels; it must have {SMALLEST} to {LARGEST} per side",
        )
    bad = int(np.count_nonzero(~np.isfinite(pixels)))
    if bad:
        raise FabricError(f"'{where}'", f"has {bad} values that are not finite; all must be")
    if pixels.shape[2] == 1:
        pixels = np.repeat(pixels, 3, axis=2)
    made = Photograph(name=where, linear=np.maximum(pixels, 0.0))
    if made.luminance.mean() < DARKEST:
        raise FabricError(
            f"'{where}'",
            f"is black: its mean is {made.luminance.mean():.2g}; it must be at least {DARKEST:g}",
        )
    if made.saturated.mean() > 0.5:
        raise FabricError(
            f"'{where}'",
            f"is saturated in {made.saturated.mean():.0%} of its pixels; expose for the cloth",
        )
    return made


def require_same_size(first: Photograph, second: Photograph) -> None:
    """Raise FabricError where two photographs cannot be of one view."""
    if first.shape != second.shape:
        (h, w), (k, v) = first.shape, second.shape
        raise FabricError(
            f"'{second.name}'", f"is {v} x {k} pixels; it must be {w} x {h}, as '{first.name}' is"
        )


def squares(photograph: Photograph, step: int) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Means over squares of pixels: ((n, 3) light, (n, 3) deviation of the mean, (n,) usable).

    A square with saturated pixels in more than a hundredth of it is not usable: its mean is too
    low.
    """
    rows, columns = (size // step for size in photograph.shape)
    cut = photograph.linear[: rows * step, : columns * step]
    tiles = cut.reshape(rows, step, columns, step, 3).transpose(0, 2, 1, 3, 4)
    tiles = tiles.reshape(rows * columns, step * step, 3)
    hot = photograph.saturated[: rows * step, : columns * step]
    hot_share = hot.reshape(rows, step, columns, step).mean(axis=(1, 3)).ravel()
    return tiles.mean(axis=1), tiles.std(axis=1) / step, hot_share <= 0.01


def relative(photograph: Photograph, reach: float) -> Floats:
    """(h, w) luminance over its own blur of `reach` pixels, less 1: what is left is texture."""
    y = photograph.luminance
    return np.asarray(y / np.maximum(gaussian_filter(y, reach), 1e-6) - 1.0)
