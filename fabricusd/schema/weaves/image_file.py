"""The pixels of an image file. The one file of the importers that knows OpenImageIO."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.files import readable_file
from fabricusd.schema.weaves.color import srgb_from_linear


def read_codes(path: str | os.PathLike[str], largest: int) -> NDArray[np.uint32]:
    """(height, width) uint32 display colours 0xRRGGBB, top row first.

    Floating-point images are linear and are encoded for display; transparency shows white.
    Raises FabricError for what is not an image of 1 to `largest` pixels a side.
    """
    import OpenImageIO as oiio

    where = str(readable_file(path))
    reader = oiio.ImageInput.open(where)
    if reader is None:
        reason = " ".join(oiio.geterror().split())[:200]
        raise FabricError(where, f"is not an image ({reason}); it must be one")
    spec = reader.spec()
    if not (1 <= spec.width <= largest and 1 <= spec.height <= largest and spec.depth <= 1):
        raise FabricError(
            where,
            f"is {spec.width} x {spec.height} x {spec.depth} pixels; it must be from 1 to "
            f"{largest} a side, and flat",
        )
    if spec.deep or spec.nchannels < 1:
        raise FabricError(where, "has no pixels of one colour each; it must be a flat image")
    linear = spec.format.basetype in (oiio.HALF, oiio.FLOAT, oiio.DOUBLE)
    used = min(spec.nchannels, 4)
    pixels = reader.read_image(0, 0, 0, used, oiio.FLOAT if linear else oiio.UINT8)
    reason = " ".join(reader.geterror().split())[:200]
    reader.close()
    if pixels is None or reason:
        raise FabricError(
            where, f"cannot be read to its end ({reason or 'no pixels'}); it must be a whole image"
        )
    pixels = np.asarray(pixels).reshape(spec.height, spec.width, used)
    if linear:
        pixels = _display(where, pixels)
    alpha = spec.alpha_channel
    if 0 <= alpha < used:
        # Colours come multiplied by alpha, so adding what is left of 1 lays them on white.
        pixels = _over_white(pixels, alpha)
    codes = pixels[..., 0].astype(np.uint32)
    if pixels.shape[2] < 3:
        codes *= np.uint32(0x010101)
        return codes
    for channel in (1, 2):
        codes <<= np.uint32(8)
        codes |= pixels[..., channel]
    return codes


def _display(where: str, pixels: NDArray[np.float32]) -> NDArray[np.uint8]:
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
