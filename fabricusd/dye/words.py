"""Colours as people read them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fabricusd.srgb import srgb_encode


def code(color: ArrayLike) -> str:
    """`#rrggbb` of a linear Rec. 709 colour, clipped to what sRGB holds."""
    codes = np.rint(srgb_encode(np.asarray(color, np.float64)) * 255)
    return "#" + "".join(f"{int(c):02x}" for c in codes)
