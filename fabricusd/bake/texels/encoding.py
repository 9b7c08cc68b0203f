"""Encode maps as 16-bit integers, for PNG and TIFF.

Colours take the sRGB curve. Zero of a direction or an angle is encoded as the middle of the range.
Ids are stored plus one, since -1 means none. Unbounded maps are scaled from their smallest to their
largest value. The manifest records the encoding, so that `decoded` can recover the values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.texels.maps import TextureMap
from fabricusd.srgb import srgb_decode, srgb_encode

FORMATS = {"exr": ".exr", "png": ".png", "tiff": ".tif"}
"""File formats and their suffixes. EXR files hold half floats and mip levels."""

GREATEST = 65535
"""The largest 16-bit integer."""

GREATEST_SCALE = 1e30
"""Beyond any value of a map, and within single precision."""


@dataclass(frozen=True, kw_only=True)
class Encoding:
    """value = scale * number/65535 + offset, after the sRGB curve where `transfer` is "srgb"."""

    transfer: str
    scale: float
    offset: float

    def encoded(self, values: NDArray[Any]) -> NDArray[np.uint16]:
        """Encode values as integers; values out of range are clamped."""
        part = (np.asarray(values, np.float64) - self.offset) / self.scale
        if self.transfer == "srgb":
            part = srgb_encode(part)
        return np.rint(np.clip(part, 0.0, 1.0) * GREATEST).astype(np.uint16)

    def decoded(self, parts: NDArray[Any]) -> NDArray[np.float32]:
        """Decode integers that a reader has divided by 65535."""
        linear = srgb_decode(parts) if self.transfer == "srgb" else parts
        values = np.asarray(linear, np.float64) * self.scale + self.offset
        # Ids are integers, which a division and a multiplication do not always preserve.
        return np.asarray(np.rint(values) if self.scale == GREATEST else values, np.float32)


def encoding_from(said: Any) -> Encoding:
    """Return the encoding that a JSON value describes; raise ValueError if it is invalid."""
    if not isinstance(said, dict) or set(said) != {"transfer", "scale", "offset"}:
        raise ValueError("an encoding has 'transfer', 'scale' and 'offset'")
    transfer, scale, offset = said["transfer"], said["scale"], said["offset"]
    if transfer not in ("linear", "srgb"):
        raise ValueError(f"'transfer' is {transfer!r:.40}; it must be linear or srgb")
    for name, value in (("scale", scale), ("offset", offset)):
        if type(value) not in (int, float) or not abs(value) < GREATEST_SCALE:
            raise ValueError(
                f"'{name}' is {value!r:.40}; it must be a number below {GREATEST_SCALE:g}"
            )
    if not scale > 0:
        raise ValueError(f"'scale' is {scale!r}; it must be above 0")
    return Encoding(transfer=transfer, scale=float(scale), offset=float(offset))


_FIXED = {
    "share": (1.0, 0.0),
    "direction": (2.0, -1.0),
    "axis": (2.0, -1.0),
    "angle": (math.pi, -0.5 * math.pi),
    "id": (float(GREATEST), -1.0),
}
"""Scale and offset by kind of map; the other kinds are scaled to the range of their values."""


def encoding_of(one: TextureMap, bands: Iterable[NDArray[Any]]) -> Encoding:
    """Return a map's encoding; its `bands` are read only if its kind is unbounded."""
    if one.kind_of in _FIXED:
        scale, offset = _FIXED[one.kind_of]
        return Encoding(transfer="srgb" if one.color else "linear", scale=scale, offset=offset)
    low, high = math.inf, -math.inf
    for band in bands:
        low, high = min(low, float(band.min())), max(high, float(band.max()))
    return Encoding(transfer="linear", scale=max(high - low, 1e-12), offset=low)


def stored_by(file_format: str) -> Callable[[TextureMap, NDArray[Any]], NDArray[Any]]:
    """Return a function that rounds a map's values (..., channels) as the file format does."""

    def stored(one: TextureMap, values: NDArray[Any]) -> NDArray[Any]:
        if file_format == "exr":
            return values.astype(one.kind)
        encoding = encoding_of(one, (values,))
        return encoding.decoded(encoding.encoded(values) / GREATEST)

    return stored
