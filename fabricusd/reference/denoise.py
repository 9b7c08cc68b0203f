"""Denoising by Open Image Denoise, which is kept from smearing threads.

The denoiser is guided by the albedo and the normals. Threads of a pixel or two are finer than its
guides, and it takes them for noise: of linen at 64 samples per pixel, its picture is twice as far
from the truth as the noisy one. Where the two differ by more than the noise explains, the noisy one
is therefore mixed in again, by the shares that make the error smallest.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError

GUIDES = ("albedo", "normal", "variance")
"""Layers that tell edges of the scene, and how much of a difference is noise."""

WINDOW = 5
"""Side of the squares [pixels] over which differences are compared with the noise."""

MISSING = "needs Open Image Denoise; install it with: pip install 'fabricusd[denoise]'"


def require_denoiser() -> Any:
    """The module that denoises; FabricError where it is not installed."""
    try:
        import pyoidn
    except (ImportError, OSError) as error:
        raise FabricError("--denoise", MISSING) from error
    return pyoidn


def has_denoiser() -> bool:
    """Whether `denoised` can be called."""
    try:
        require_denoiser()
    except FabricError:
        return False
    return True


def denoised(layers: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
    """(h, w, 3) the beauty without its noise; the layers must hold it and `GUIDES`.

    In each square of `WINDOW` pixels, the mean squared difference of the two pictures, less the
    variance V, is the squared bias B of the denoised one. The mixture B : V of the noisy and the
    denoised picture has the smallest error.
    """
    return mixed(layers["beauty"][..., :3], smoothed(layers), layers["variance"])


def smoothed(layers: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
    """(h, w, 3) what Open Image Denoise makes of the beauty.

    The guides are noisy themselves where threads are seen, and are not denoised first.
    """
    pyoidn = require_denoiser()
    color = np.ascontiguousarray(layers["beauty"][..., :3], np.float32)
    albedo = np.clip(np.ascontiguousarray(layers["albedo"][..., :3], np.float32), 0.0, 1.0)
    normal = np.ascontiguousarray(layers["normal"], np.float32)
    try:
        result = pyoidn.denoise(color, albedo=albedo, normal=normal, hdr=True)
    except RuntimeError as error:
        raise FabricError("--denoise", f"failed: {error}") from error
    return np.asarray(result, np.float32)


def mixed(
    noisy: NDArray[np.float32], smooth: NDArray[np.float32], variance: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(h, w, 3) the mixture of a noisy and a smooth picture with the smallest error.

    variance : (h, w, 3) of the noisy picture's pixels; where it is not finite, as after a single
        sample, the smooth picture stands
    """
    # Imported here, because every picture would wait for it.
    from scipy.ndimage import uniform_filter

    square = (WINDOW, WINDOW, 0)
    difference = noisy.astype(np.float64) - smooth
    known = np.isfinite(variance).all(axis=-1, keepdims=True)
    noise = uniform_filter(np.where(known, variance, 0.0).astype(np.float64), square)
    bias = np.maximum(uniform_filter(difference**2, square) - noise, 0.0)
    total = bias + noise
    share = np.divide(bias, total, out=np.zeros_like(total), where=total > 0) * known
    return np.asarray(smooth + share * difference, np.float32)
