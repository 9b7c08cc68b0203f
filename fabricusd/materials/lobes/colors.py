"""Differences of colours as residuals of a fit, with their derivatives.

The sum of squares is close to the sum of squared delta E 2000 around the target, but smooth.
"""

from __future__ import annotations

import warnings
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

REC_709 = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of linear Rec. 709."""

BEYOND_WHITE = 0.2
"""Slope beyond a display's white. There delta E does not change any more, but the light that such a
highlight gives under a sky does."""


class Colors:
    """Residuals of (n, 3) linear Rec. 709 colours against a target of that shape."""

    def __init__(self, target: Floats) -> None:
        self.lab, _ = _lab(target)
        chroma = np.hypot(self.lab[:, 1], self.lab[:, 2])
        hue = self.lab[:, 1:] / np.maximum(chroma, 1e-6)[:, None]
        off = (self.lab[:, 0] - 50.0) ** 2
        # [Sharma2005] eq. 15 and 16, with the target's chroma; eq. 17 without its hue term.
        light = 1.0 / (1.0 + 0.015 * off / np.sqrt(20.0 + off))
        colored, hued = 1.0 / (1.0 + 0.045 * chroma), 1.0 / (1.0 + 0.015 * chroma)
        self._turn = np.zeros((len(target), 3, 3))
        self._turn[:, 0, 0] = light
        self._turn[:, 1, 1:] = hue * colored[:, None]
        self._turn[:, 2, 1:] = np.stack((-hue[:, 1], hue[:, 0]), axis=1) * hued[:, None]

    def residuals(self, values: Floats) -> tuple[Floats, Floats]:
        """Return (n, 3) residuals, in delta E, and their derivatives (n, 3, 3) by the values."""
        lab, slope = _lab(values)
        return np.einsum("nij,nj->ni", self._turn, lab - self.lab), self._turn @ slope


@lru_cache(maxsize=1)
def _to_white() -> Floats:
    """(3, 3) matrix from linear Rec. 709 to XYZ over that of white."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    matrix = np.asarray(colour.RGB_COLOURSPACES["ITU-R BT.709"].matrix_RGB_to_XYZ, np.float64)
    return np.asarray(matrix / matrix.sum(axis=1, keepdims=True))


_TO_LAB = np.array([[0.0, 116.0, 0.0], [500.0, -500.0, 0.0], [0.0, 200.0, -200.0]])

_KNEE, _SLOPE = 216.0 / 24389.0, 24389.0 / (27.0 * 116.0)
"""Of CIE L*a*b*'s linear part."""


def _lab(values: Floats) -> tuple[Floats, Floats]:
    """(n, 3) L*a*b*, and its derivatives (n, 3, 3) by the values."""
    beyond = values > 1.0
    shown = np.maximum(np.where(beyond, 1.0 + BEYOND_WHITE * (values - 1.0), values), 0.0)
    x = shown @ _to_white().T
    root = np.cbrt(np.maximum(x, 1e-12))
    curved = x > _KNEE
    f = np.where(curved, root, _SLOPE * x + 16.0 / 116.0)
    slope = np.where(curved, 1.0 / (3.0 * root * root), _SLOPE)
    inner = slope[:, :, None] * _to_white() * np.where(beyond, BEYOND_WHITE, 1.0)[:, None, :]
    return f @ _TO_LAB.T - np.array([16.0, 0.0, 0.0]), _TO_LAB @ inner
