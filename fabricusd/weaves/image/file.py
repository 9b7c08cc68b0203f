"""The pixels of an image file, as display colours."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.srgb import srgb_from_linear

MOST_PIXELS = 2**27
"""Most pixels of a weave image: 16384 x 8192, eight times the largest jacquard in use."""


class CodeImage:
    """The pixels of an image file as display colours 0xRRGGBB, read band by band.

    Floating-point images are linear and are encoded for display; transparency shows as white.
    Raises FabricError for a file that is not an image of 1 to `largest` pixels a side and at most
    `MOST_PIXELS` altogether.
    """

    def __init__(self, path: str | os.PathLike[str], largest: int) -> None:
        # Imported here, so that drafts of other kinds do not wait for OpenImageIO.
        from fabricusd.images.flat import FlatImage

        self.image = FlatImage(path, largest, MOST_PIXELS)
        self.shape = (self.image.height, self.image.width)
        self.several = self.image.several

    def bands(self) -> Iterator[NDArray[np.uint32]]:
        """(rows, width) uint32 codes, from the top."""
        row = 0
        for pixels in self.image.bands():
            shown: NDArray[np.uint8] = np.asarray(
                _display(self.image.where, pixels, row) if self.image.linear else pixels, np.uint8
            )
            row += len(pixels)
            if self.image.alpha >= 0:
                # Colours are premultiplied by alpha, so adding 1 - alpha lays them over white.
                shown = _over_white(shown, self.image.alpha)
            yield _packed(shown)

    def pixel(self, x: int, y: int) -> int:
        """The code of one pixel."""
        for codes in self.bands():
            if y < len(codes):
                return int(codes[y, x])
            y -= len(codes)
        raise IndexError("the pixel lies below the image")


def _packed(pixels: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """(h, w, c) uint8 -> (h, w) uint32 0xRRGGBB."""
    codes = pixels[..., 0].astype(np.uint32)
    if pixels.shape[2] < 3:
        codes *= np.uint32(0x010101)
        return codes
    for channel in (1, 2):
        codes <<= np.uint32(8)
        codes |= pixels[..., channel]
    return codes


def _display(where: str, pixels: NDArray[Any], row: int) -> NDArray[np.uint8]:
    """Linear pixels to 8-bit display codes; `row` is the first row of the band."""
    bad = ~np.isfinite(pixels).all(axis=2)
    if bad.any():
        y, x = np.unravel_index(int(np.argmax(bad)), bad.shape)
        raise FabricError(
            f"{where} pixel ({x}, {row + int(y)})",
            f"is {', '.join(f'{v:g}' for v in pixels[y, x])}; it must be finite numbers",
        )
    coded = srgb_from_linear(np.clip(pixels, 0.0, 1.0))
    return np.asarray(np.rint(coded * 255), np.uint8)


def _over_white(pixels: NDArray[np.uint8], alpha: int) -> NDArray[np.uint8]:
    colors = np.delete(pixels, alpha, axis=2).astype(np.uint16)
    laid = colors + (255 - pixels[..., alpha : alpha + 1].astype(np.uint16))
    return np.asarray(np.minimum(laid, 255), np.uint8)
