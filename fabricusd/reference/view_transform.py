"""From scene-linear radiance to what a screen shows.

The curve is [Narkowicz2015]'s fit of the ACES reference rendering, which rolls highlights off to
white, scaled so that middle grey stays middle grey; after it the sRGB encoding. It needs no
configuration file and no OpenColorIO.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.srgb import srgb_encode

_A, _B, _C, _D, _E = 2.51, 0.03, 2.43, 0.59, 0.14
GREY = 0.18

MOST_STOPS = 500.0
"""A factor whose product with any float32 is a finite float64."""


def _grey_scale() -> float:
    """The exposure at which the curve maps GREY to GREY: the root of its quadratic."""
    a, b, c = _A - GREY * _C, _B - GREY * _D, -GREY * _E
    return float((-b + np.sqrt(b * b - 4 * a * c)) / (2 * a) / GREY)


_SCALE = _grey_scale()


def tone_curve(radiance: NDArray[Any]) -> NDArray[np.float64]:
    """Linear to linear display light, [0, 1]; rising, and 0.18 stays 0.18."""
    x = _SCALE * np.maximum(np.nan_to_num(radiance, nan=0.0, posinf=1e6), 0.0)
    x = np.minimum(x, 1e6)
    return np.clip(x * (_A * x + _B) / (x * (_C * x + _D) + _E), 0.0, 1.0)


def view(radiance: NDArray[Any], exposure: float = 0.0) -> NDArray[np.uint8]:
    """(..., 3) radiance to 8-bit sRGB, `exposure` in stops."""
    # A camera in a file may have any; beyond these all is white, or black.
    stops = min(max(exposure, -MOST_STOPS), MOST_STOPS)
    code = srgb_encode(tone_curve(np.asarray(radiance, np.float64) * 2.0**stops))
    return np.asarray(np.round(code * 255.0), np.uint8)
