"""How strong the weave is in a patch that the law predicts, measured as in a photograph."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fabricusd.measure.flat import law
from fabricusd.measure.flat.photograph import LUMINANCE

Floats = NDArray[np.float64]


class SlowContrast:
    """Contrast of a patch in waves that are given.

    waves : (k, 2) cycles per pixel; none for all that the patch shows
    """

    def __init__(self, waves: Floats) -> None:
        self.count = len(waves)
        at = np.arange(law.PATCH) + 0.5
        x, y = (a.ravel() for a in np.meshgrid(at, at))
        phase = 2.0 * math.pi * (np.stack((x, y), axis=1) @ waves.T)
        w = np.sin(math.pi * at / law.PATCH)
        self.window = np.outer(w, w).ravel()[:, None]
        columns = np.concatenate((np.ones((len(x), 1)), np.cos(phase), np.sin(phase)), axis=1)
        self.fit = np.linalg.pinv(columns * self.window)

    def __call__(self, picture: Floats) -> tuple[float, Floats]:
        """(contrast of the luminance, (3,) of each channel over it, with sign) of a patch."""
        pixels = picture.reshape(-1, 3)
        if not self.count:
            return _whole_contrast(pixels)
        planes = np.concatenate((pixels, pixels @ LUMINANCE[:, None]), axis=1)
        found = self.fit @ (planes * self.window)
        relative = found[1:] / np.maximum(found[0], 1e-12)
        square = max(float((relative[:, 3] ** 2).sum()), 1e-12)
        return math.sqrt(0.5 * square), relative[:, :3].T @ relative[:, 3] / square


def _whole_contrast(pixels: Floats) -> tuple[float, Floats]:
    """`SlowContrast` of (n, 3) pixels, by all that they show."""
    y = pixels @ LUMINANCE
    texture = y / max(float(y.mean()), 1e-12) - 1.0
    variance = max(float((texture**2).mean()), 1e-12)
    relative = pixels / np.maximum(pixels.mean(axis=0), 1e-12) - 1.0
    return math.sqrt(variance), np.asarray(relative.T @ texture / len(texture) / variance)
