"""The sample pictures: a sky, artwork of three colours, and a drawdown."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ROSE, LEAF, GROUND = (150, 32, 48), (70, 92, 58), (232, 224, 206)
"""Codes of sRGB of the artwork's three regions."""


def sky(height: int = 128) -> NDArray[np.float32]:
    """(h, 2 h, 3) radiance of a latitude-longitude picture: an overcast sky with a bright window.

    The ground is darker than the sky; the window, to the left of the front, lights the subject.
    """
    v, u = np.meshgrid(
        (np.arange(height) + 0.5) / height, (np.arange(2 * height) + 0.5) / (2 * height),
        indexing="ij",
    )  # fmt: skip
    up = np.cos(np.pi * v)
    blue = np.array([0.55, 0.62, 0.72]) * (0.35 + 0.4 * np.clip(up, 0, 1))[..., None]
    ground = np.full(3, 0.12) * (1 - 0.3 * np.clip(-up, 0, 1))[..., None]
    picture = np.where((up > 0)[..., None], blue, ground)
    window = (np.abs(u - 0.38) < 0.045) & (np.abs(v - 0.34) < 0.1)
    bars = (np.abs(u - 0.38) < 0.003) | (np.abs(v - 0.34) < 0.006)
    picture = np.where((window & ~bars)[..., None], np.array([9.0, 8.6, 8.0]), picture)
    return picture.astype(np.float32)


def rose(size: int = 240) -> NDArray[np.uint8]:
    """(size, size, 3) artwork that repeats: a rose of five petals with two leaves, on a ground."""
    y, x = np.mgrid[0:size, 0:size]
    x, y = (2 * (x + 0.5) / size - 1), (1 - 2 * (y + 0.5) / size)
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    picture = np.full((size, size, 3), GROUND, np.uint8)
    for side in (-1.0, 1.0):
        along, across = 0.8 * x * side - 0.6 * y - 0.62, 0.6 * x * side + 0.8 * y + 0.12
        picture[(along / 0.3) ** 2 + (across / 0.12) ** 2 < 1] = LEAF
    petals = 0.42 + 0.1 * np.cos(5 * angle)
    picture[radius < petals] = ROSE
    # Rings between the petals, in the ground's colour.
    spiral = np.mod(radius / 0.13 - 2.5 * angle / np.pi, 1.0)
    picture[(radius < 0.85 * petals) & (spiral < 0.16)] = GROUND
    return picture


def diamonds(size: int = 24) -> NDArray[np.uint8]:
    """(size, size, 3) drawdown, a pixel per crossing, black where warp is on top: a pointed 2/2
    twill."""
    fold = np.abs(np.mod(np.arange(size), size) - size // 2)
    warp = np.mod(fold[:, None] + fold[None, :], 4) < 2
    return np.repeat(np.where(warp, 0, 255).astype(np.uint8)[..., None], 3, axis=-1)
