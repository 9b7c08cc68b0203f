"""A camera with shot noise, read noise, dark current, a black level and a response with a knee."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Camera:
    """How radiance becomes codes: electrons, then a share of the full well, then the response.

    bits : of a code
    full : electrons of a full well
    read : standard deviation of the read noise [electrons]
    dark : dark current [electrons/s]
    black : share of the full well that is added before the response
    knee : share of the full well up to which the response is linear. Above it, the response bends
        as the thesis's Figure 3.7 shows ("mostly linear, becoming non-linear above 240"); 1 clips
    gain : electrons per second and unit of radiance
    """

    bits: int = 12
    full: float = 8000.0
    read: float = 8.0
    dark: float = 4.0
    black: float = 0.03
    knee: float = 0.94
    gain: float = 24000.0

    @property
    def levels(self) -> int:
        """The largest code."""
        return (1 << self.bits) - 1

    def response(self, exposure: Floats) -> Floats:
        """Code, as a share of the largest one, of an exposure as a share of the full well."""
        if self.knee >= 1.0:
            return np.minimum(exposure, 1.0)
        rest = 1.0 - self.knee
        bent = self.knee + rest * -np.expm1(-np.maximum(exposure - self.knee, 0.0) / rest)
        return np.where(exposure < self.knee, exposure, bent)

    def expose(
        self, radiance: Floats, seconds: float, rng: np.random.Generator | None
    ) -> NDArray[Any]:
        """Codes of a mosaicked radiance, uint8 or uint16, of its shape; without noise for rng None.

        The least unit of a code is rounded to, so 8 bits lose what 12 keep.
        """
        electrons = np.maximum(radiance * (self.gain * seconds) + self.dark * seconds, 0.0)
        if rng is not None:
            electrons = rng.poisson(electrons) + rng.normal(0.0, self.read, radiance.shape)
        code = self.response(electrons / self.full + self.black) * self.levels
        kind = np.uint8 if self.bits <= 8 else np.uint16
        return np.clip(np.rint(code), 0, self.levels).astype(kind)


def mosaicked(colour: Floats) -> Floats:
    """(h, w) radiance behind an RGGB filter, from (h, w, 3); both sides must be even."""
    out = colour[..., 1].copy()
    out[0::2, 0::2] = colour[0::2, 0::2, 0]
    out[1::2, 1::2] = colour[1::2, 1::2, 2]
    return out
