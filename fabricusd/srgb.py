"""The sRGB transfer functions, written out so that no colour library has to be loaded."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def linear_from_srgb(display: ArrayLike) -> NDArray[np.float64]:
    """(...) display values, 0 to 1 -> (...) float64 linear. [IEC61966] section 5.2."""
    v = np.asarray(display, np.float64)
    return np.where(v <= 0.04045, v / 12.92, ((np.maximum(v, 0.04045) + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(linear: ArrayLike) -> NDArray[np.float64]:
    """(...) linear values, 0 to 1 -> (...) float64 display. [IEC61966] section 5.3.

    `linear_from_srgb(srgb_from_linear(x)) == x` within 1e-7: the standard rounds the constants
    of its two pieces, so the pieces do not quite meet.
    """
    v = np.asarray(linear, np.float64)
    return np.where(
        v <= 0.0031308, v * 12.92, 1.055 * np.maximum(v, 0.0031308) ** (1 / 2.4) - 0.055
    )


def srgb_encode(linear: NDArray[Any]) -> NDArray[np.float64]:
    """Linear display light to sRGB code values, [0, 1]."""
    return srgb_from_linear(np.clip(np.asarray(linear, np.float64), 0.0, 1.0))


def srgb_decode(code: NDArray[Any]) -> NDArray[np.float64]:
    """sRGB code values to linear light, the inverse of `srgb_encode`."""
    return linear_from_srgb(code)
