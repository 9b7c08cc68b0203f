"""Denoising by Open Image Denoise, with the albedo and the normals as guides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError

GUIDES = ("albedo", "normal")
"""Layers that tell edges of the scene from noise."""

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

    The guides are noisy themselves where threads are seen, and are not denoised first: threads
    would be smeared.
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
