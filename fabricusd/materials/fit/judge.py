"""Score a fit by the colours of the cloth under pairs of directions and under a uniform sky.

A pair's colour is that in a light under which a white diffuser is white. The colours under the sky
are the directional albedos of the views. A slightly misplaced highlight spoils pairs of directions,
but not the picture under a sky.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fabricusd.quality.colors import delta_e_2000, lab

Floats = NDArray[np.float64]

VIEWS, LIGHTS = 16, 96
"""Numbers of directions on the hemisphere, uniform in solid angle; views go down to 80 degrees."""

SKY = 0.2
"""Weight of the sky; the pairs have the rest. It is large enough to keep the body colour in place
if highlights cannot be matched, and small enough not to worsen the pairs."""


def hemisphere(count: int, lowest: float = 0.0) -> Floats:
    """(count, 3) unit vectors above z = `lowest`, uniform in solid angle: a Fibonacci spiral."""
    k = np.arange(count) + 0.5
    z = 1.0 - (1.0 - lowest) * k / count
    phi = k * np.pi * (3.0 - np.sqrt(5.0))
    r = np.sqrt(1.0 - z * z)
    return np.stack((r * np.cos(phi), r * np.sin(phi), z), axis=1)


def direction_pairs() -> tuple[Floats, Floats]:
    """(n, 3) wi and (n, 3) wo: each of the VIEWS with each of the LIGHTS."""
    views, lights = hemisphere(VIEWS, np.cos(np.radians(80.0))), hemisphere(LIGHTS)
    return np.tile(lights, (VIEWS, 1)), np.repeat(views, LIGHTS, axis=0)


def albedo(values: Floats) -> Floats:
    """(..., VIEWS, 3) directional albedos of (..., VIEWS * LIGHTS, 3) values."""
    by_view = values.reshape(*values.shape[:-2], VIEWS, LIGHTS, 3)
    return np.asarray(by_view.mean(axis=-2) * 2.0 * np.pi)


class Judge:
    """Compares (rows, VIEWS * LIGHTS, 3) values with a target of that shape.

    weight : (rows,) weight of each row
    """

    def __init__(self, target: Floats, weight: Floats) -> None:
        self.colors = _colors(target)
        self.weight = weight / weight.sum()
        each = np.repeat([(1.0 - SKY) / (VIEWS * LIGHTS), SKY / VIEWS], [VIEWS * LIGHTS, VIEWS])
        self._share = np.sqrt(self.weight[:, None] * each)[..., None]
        self._lab = lab(self.colors)
        lightness, chroma = self._lab[..., 0], np.hypot(self._lab[..., 1], self._lab[..., 2])
        self._hue = self._lab[..., 1:] / np.maximum(chroma, 1e-6)[..., None]
        off = (lightness - 50.0) ** 2
        # [Sharma2005] eq. 15 and 16, with the target's chroma; eq. 17 without its hue term.
        self._scale = np.stack(
            (1.0 + 0.015 * off / np.sqrt(20.0 + off), 1.0 + 0.045 * chroma, 1.0 + 0.015 * chroma),
            axis=-1,
        )

    def residuals(self, values: Floats, less: Floats | float = 1.0) -> Floats:
        """Return differences of lightness, chroma and hue; their squares sum to a mean delta E^2.

        They are scaled like delta E 2000 around the target, but smooth.

        less : (rows, VIEWS * LIGHTS + VIEWS) factor on each difference
        """
        off = lab(_colors(values)) - self._lab
        a, b, hue = off[..., 1], off[..., 2], self._hue
        parts = (off[..., 0], a * hue[..., 0] + b * hue[..., 1], b * hue[..., 0] - a * hue[..., 1])
        share = self._share * np.asarray(less)[..., None]
        return np.asarray((np.stack(parts, axis=-1) / self._scale * share).ravel())

    def evened(self, values: Floats) -> Floats:
        """Return factors for `residuals` with which their squares sum to a mean delta E.

        They hold near these values and are 1/sqrt(delta E), at most 1.
        """
        error = delta_e_2000(_colors(values), self.colors)
        return np.asarray(1.0 / np.sqrt(np.maximum(error, 1.0)))

    def delta_e(self, values: Floats) -> Floats:
        """(rows, VIEWS * LIGHTS) delta E 2000 of the pairs."""
        return delta_e_2000(np.pi * values, self.colors[:, : VIEWS * LIGHTS])

    def delta_e_of_sky(self, values: Floats) -> Floats:
        """(rows, VIEWS) delta E 2000 under the sky."""
        return delta_e_2000(albedo(values), self.colors[:, VIEWS * LIGHTS :])

    def score(self, values: Floats) -> float:
        """Return the mean delta E 2000 of pairs and sky, weighted by SKY and over the rows."""
        pairs, sky = self.delta_e(values).mean(axis=1), self.delta_e_of_sky(values).mean(axis=1)
        return float(self.weight @ ((1.0 - SKY) * pairs + SKY * sky))


def _colors(values: Floats) -> Floats:
    """(rows, VIEWS * LIGHTS + VIEWS, 3) display colours of the pairs, and of each view under the
    sky."""
    return np.concatenate((np.pi * values, albedo(values)), axis=-2)
