"""Pictures of weaves made without the renderer: cells of two shades, blurred, with grain."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from fabricusd.measure.flat.photograph import Photograph
from fabricusd.weaves import parse_weave

FINE = 4


def woven(weave, pitch, *, turn=0.0, size=256, shades=((0.5, 0.4, 0.3), (0.2, 0.25, 0.3)),
          grain=0.01, wobble=0.0, seed=0):  # fmt: skip
    """A photograph of `weave`: warp cells have the first shade, weft cells the second.

    pitch : pixels from end to end and from pick to pick; turn : counter-clockwise [rad]
    wobble : standard deviation of a change of shade along each end, over 6 pixels
    """
    cells = parse_weave(weave).weave.cells
    rng = np.random.default_rng(seed)
    at = (np.arange(size * FINE) + 0.5) / FINE
    x, y = np.meshgrid(at, at[::-1])
    c, s = np.cos(turn), np.sin(turn)
    u, v = (c * x + s * y) / pitch[0], (-s * x + c * y) / pitch[1]
    i, j = np.floor(u).astype(int), np.floor(v).astype(int)
    warp = cells[i % cells.shape[0], j % cells.shape[1]]
    linear = np.where(warp[..., None], shades[0], shades[1]).astype(float)
    if wobble:
        noise = gaussian_filter(rng.standard_normal((size * 2, 4 * size)), (0, 6), mode="wrap")
        noise *= wobble / noise.std()
        linear *= (
            1 + np.where(warp, noise[i % len(noise), y.astype(int) % (4 * size)], 0)[..., None]
        )
    linear = linear.reshape(size, FINE, size, FINE, 3).mean(axis=(1, 3))
    linear = gaussian_filter(linear, (0.6, 0.6, 0)) * (
        1 + grain * rng.standard_normal((size, size, 1))
    )
    return Photograph(name=weave, linear=np.clip(linear, 0, 1))
