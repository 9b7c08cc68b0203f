"""The pixels of an image file as display colours."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.srgb import srgb_from_linear


def read_codes(path: str | os.PathLike[str], largest: int) -> NDArray[np.uint32]:
    """(height, width) uint32 display colours 0xRRGGBB, top row first.

    Floating-point images are linear and are encoded for display; transparency shows white.
    Raises FabricError for what is not an image of 1 to `largest` pixels a side.
    """
    # Here, so that drafts of other kinds do not wait for OpenImageIO.
    from fabricusd.images import read_flat

    pixels, alpha = read_flat(path, largest)
    shown: NDArray[np.uint8] = np.asarray(
        _display(str(path), pixels) if pixels.dtype == np.float32 else pixels, np.uint8
    )
    if alpha >= 0:
        # Colours come multiplied by alpha, so adding what is left of 1 lays them on white.
        shown = _over_white(shown, alpha)
    return _packed(shown)


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


def _display(where: str, pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """Linear to 8-bit display codes."""
    bad = ~np.isfinite(pixels).all(axis=2)
    if bad.any():
        y, x = np.unravel_index(int(np.argmax(bad)), bad.shape)
        raise FabricError(
            f"{where} pixel ({x}, {y})",
            f"is {', '.join(f'{v:g}' for v in pixels[y, x])}; it must be finite numbers",
        )
    coded = srgb_from_linear(np.clip(pixels, 0.0, 1.0))
    return np.asarray(np.rint(coded * 255), np.uint8)


def _over_white(pixels: NDArray[np.uint8], alpha: int) -> NDArray[np.uint8]:
    colors = np.delete(pixels, alpha, axis=2).astype(np.uint16)
    laid = colors + (255 - pixels[..., alpha : alpha + 1].astype(np.uint16))
    return np.asarray(np.minimum(laid, 255), np.uint8)
