"""What the simulated camera is pointed at: a thread, a white tile, a chart of grey patches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Floats = NDArray[np.float64]

FINE = 16
"""Points per pixel across the thread, at which its profile is computed."""

ROUGHNESS, ROUGH_ROWS = 0.15, 2.0
"""Standard deviation of a thread's brightness along it, and how many rows it stays alike."""


def thread_radiance(
    value: Sequence[float] | Floats,
    shape: tuple[int, int],
    diameter: float,
    defocus: float,
    offset: float,
    rng: np.random.Generator,
) -> Floats:
    """(h, w, 3) radiance of an upright thread, whose mean over width and length is `value`.

    value : (3,) f_s cos(theta_i) E, E the irradiance
    diameter, defocus, offset : of the imaged thread, the standard deviation of the blur, and from
        the middle of the frame [pixels]
    rng : for the unevenness along the thread
    """
    height, width = shape
    x = (np.arange(width * FINE) + 0.5) / FINE - width / 2 - offset
    across = x / (diameter / 2)
    profile = np.sqrt(np.maximum(1.0 - across**2, 0.0)) * (4.0 / np.pi)
    if defocus > 0:
        profile = gaussian_filter1d(profile, defocus * FINE)
    profile = profile.reshape(width, FINE).mean(axis=1)
    rough = gaussian_filter1d(rng.standard_normal(height), ROUGH_ROWS)
    rough = 1.0 + ROUGHNESS * rough * (2.0 * ROUGH_ROWS * np.sqrt(np.pi)) ** 0.5
    rough = np.maximum(rough, 0.2)
    rough *= height / rough.sum()
    colour = np.asarray(value, np.float64)
    return np.asarray(rough[:, None, None] * profile[None, :, None] * colour)


def white_radiance(value: Sequence[float] | Floats, shape: tuple[int, int]) -> Floats:
    """(h, w, 3) radiance of an even tile."""
    return np.broadcast_to(np.asarray(value, np.float64), (*shape, 3)).copy()


def chart_radiance(greys: Floats, rows: int, columns: int, shape: tuple[int, int]) -> Floats:
    """(h, w, 3) radiance of (rows * columns,) grey patches that fill a frame, from the top left."""
    h, w = shape
    row = np.minimum(np.arange(h) * rows // h, rows - 1)
    column = np.minimum(np.arange(w) * columns // w, columns - 1)
    patch = greys[row[:, None] * columns + column[None, :]]
    return np.repeat(patch[..., None], 3, axis=2)
