"""The view transform: from scene-linear radiance to 8-bit sRGB.

The tone curve is the fit of the ACES reference rendering by [Narkowicz2015], which rolls highlights
off to white. It is scaled so that middle grey stays middle grey, and is followed by the sRGB
encoding. No configuration file and no OpenColorIO are needed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.srgb import srgb_encode

_A, _B, _C, _D, _E = 2.51, 0.03, 2.43, 0.59, 0.14
GREY = 0.18

MOST_STOPS = 500.0
"""Largest exposure in either direction [stops]: 2 to this power times any float32 is a finite
float64."""


def _grey_scale() -> float:
    """The exposure at which the curve maps GREY to GREY: the root of its quadratic."""
    a, b, c = _A - GREY * _C, _B - GREY * _D, -GREY * _E
    return float((-b + np.sqrt(b * b - 4 * a * c)) / (2 * a) / GREY)


_SCALE = _grey_scale()


def tone_curve(radiance: NDArray[Any]) -> NDArray[np.float64]:
    """Map linear radiance to linear display light in [0, 1]; monotonic, and 0.18 maps to 0.18."""
    x = _SCALE * np.maximum(np.nan_to_num(radiance, nan=0.0, posinf=1e6), 0.0)
    x = np.minimum(x, 1e6)
    return np.clip(x * (_A * x + _B) / (x * (_C * x + _D) + _E), 0.0, 1.0)


def view(radiance: NDArray[Any], exposure: float = 0.0) -> NDArray[np.uint8]:
    """Encode (..., 3) radiance as 8-bit sRGB; `exposure` in stops."""
    # A camera in a file may have any exposure. Beyond the limit every pixel is white or black.
    stops = min(max(exposure, -MOST_STOPS), MOST_STOPS)
    code = srgb_encode(tone_curve(np.asarray(radiance, np.float64) * 2.0**stops))
    return np.asarray(np.round(code * 255.0), np.uint8)
