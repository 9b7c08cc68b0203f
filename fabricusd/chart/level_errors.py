"""How wrong each level is at each width of a pixel: what `auto` has to choose between.

The truth is level `thread` averaged over the pixel, a square turned against the weave. Errors are
root mean squares over pixels spread over the repeat, over the cloth's mean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.footprint import LEVELS, weights
from fabricusd.chart.cloth_picture import TURN, cloth_value
from fabricusd.chart.reflectance import places
from fabricusd.fabric import Fabric

Floats = NDArray[np.float64]
Direction = tuple[float, float, float]

INSIDE = 12
"""Samples along a pixel's side."""

PIXELS = 96


@dataclass(frozen=True, kw_only=True)
class Zoom:
    """A cloth at a row of distances.

    widths : (k,) - of a pixel [threads]
    means : (k, PIXELS, 3) - of each level in each pixel, over the cloth's mean
    weights : (k, 3) - with which `auto` takes the levels
    """

    widths: Floats
    means: Floats
    weights: Floats

    @property
    def errors(self) -> Floats:
        """(k, 3) of the levels alone, in the order of LEVELS; `thread` has none."""
        return _rms(self.means - self.means[..., 2:], axis=1)

    @property
    def auto(self) -> Floats:
        """(k, PIXELS) what `auto` shows, in the mean over its choices."""
        return np.einsum("kpl,kl->kp", self.means, self.weights)

    @property
    def auto_errors(self) -> Floats:
        """(k,) of `auto`."""
        return _rms(self.auto - self.means[..., 2], axis=1)


def _rms(x: Floats, axis: int) -> Floats:
    return np.asarray(np.sqrt((x * x).mean(axis=axis)))


def zoom(
    fabric: Fabric, widths: Floats, wi: Direction, wo: Direction, shadow: str = "horizon"
) -> Zoom:
    """Levels and `auto` at pixels of `widths` [threads], lit from wi and seen from wo."""
    centres = places(fabric, PIXELS)
    line = (np.arange(INSIDE) + 0.5) / INSIDE - 0.5
    y, x = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    c, s = math.cos(TURN), math.sin(TURN)
    offsets = np.stack((c * x - s * y, s * x + c * y), axis=1)
    means = np.empty((len(widths), PIXELS, 3))
    for k, width in enumerate(widths):
        uv = (centres[:, None] + width * offsets).reshape(-1, 2)
        for n, level in enumerate(LEVELS):
            value = cloth_value(fabric, wi, wo, uv, level, shadow)
            means[k, :, n] = value.reshape(PIXELS, -1).mean(axis=1)
    means /= means[np.argmax(widths), :, 2].mean()
    return Zoom(widths=widths, means=means, weights=weights(fabric, np.stack((widths, widths), 1)))
