"""A dome's picture: looked up by direction, and sampled in proportion to its brightness.

Latitude-longitude as OpenEXR and USD lay it out: +y is the top row, +z the middle column, +x a
quarter of the width to its left. As light a picture is constant in each texel, so that sampling is
exactly as bright as the picture; what a camera sees of it is interpolated.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.real import INLINE, KERNEL, acos, atan2, cos, sin

R = np.float32
_PI = R(math.pi)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

DENSITY, KEPT, OTHER, CELL = 3, 4, 5, 8
"""Columns of `Dome.cells` after the radiance, and how many there are: two to a cache line."""


class Dome(NamedTuple):
    """cells : (h w, CELL) float32 - all that is known of a texel in one place of memory: radiance
    r, g, b, density [1/sr] times sin(theta), and Walker's table, the chance to keep the texel and
    the other choice; size : (2,) int64 - h, w; rotation : (3, 3) float32, world to dome."""

    cells: NDArray[np.float32]
    size: NDArray[np.int64]
    rotation: NDArray[np.float32]


def build_dome(image: NDArray[Any], rotation: NDArray[Any]) -> Dome:
    """Tables for a picture (h, w, 3) of radiance; `rotation` (3, 3) goes from world to dome.

    A picture has at most 2^24 texels, which float32 can number.
    """
    picture = np.ascontiguousarray(image, np.float32)
    h, w = picture.shape[:2]
    brightness = np.maximum(picture.astype(np.float64) @ LUMINANCE, 0.0)
    edges = np.cos(np.pi * np.arange(h + 1) / h)
    bands = np.repeat((edges[:-1] - edges[1:])[:, None], w, axis=1)
    weight = brightness * bands
    if not weight.sum() > 0:
        weight = bands
    share = weight / weight.sum()
    cells = np.zeros((h * w, CELL), np.float32)
    cells[:, :3] = picture.reshape(-1, 3)
    # Inside a texel a sample is uniform in longitude and latitude.
    cells[:, DENSITY] = (share * (h * w) / (2 * np.pi**2)).ravel()
    cells[:, OTHER], cells[:, KEPT] = alias_table(share.ravel())
    return Dome(cells, np.array([h, w]), np.ascontiguousarray(rotation, np.float32))


def alias_table(share: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Walker's table of probabilities that sum to 1: (the other choice, chance to keep the own)."""
    kept = np.ones(len(share))
    other = np.arange(len(share), dtype=np.int32)
    _fill_alias(np.ascontiguousarray(share * len(share)), kept, other)
    return other, kept.astype(np.float32)


@njit(**KERNEL)
def _fill_alias(level, kept, other):
    n = len(level)
    small, large = np.empty(n, np.int64), np.empty(n, np.int64)
    few, many = 0, 0
    for k in range(n):
        if level[k] < 1.0:
            small[few] = k
            few += 1
        else:
            large[many] = k
            many += 1
    while few > 0 and many > 0:
        few -= 1
        a, b = small[few], large[many - 1]
        kept[a] = level[a]
        other[a] = b
        level[b] -= 1.0 - level[a]
        if level[b] < 1.0:
            many -= 1
            small[few] = b
            few += 1


@njit(**INLINE)
def place_of(dome, x, y, z):
    """World direction to picture coordinates (column, row) in texels, sin of the polar angle."""
    m = dome.rotation
    a = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
    b = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z
    c = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z
    longitude = atan2(R, c, a)
    u = (longitude + R(0.5) * _PI) * R(0.5 / math.pi)
    u = u - math.floor(u)
    v = acos(R, b) * R(1.0 / math.pi)
    sine = math.sqrt(max(a * a + c * c, R(1e-12)))
    return R(u) * R(dome.size[1]), v * R(dome.size[0]), sine


@njit(**INLINE)
def cell_at(dome, column, row):
    """Index of the texel at a place."""
    h, w = dome.size[0], dome.size[1]
    return min(int(row), h - 1) * w + min(int(column), w - 1)


@njit(**INLINE)
def smooth_radiance(dome, column, row):
    """Bilinear lookup, for the eye: (r, g, b)."""
    h, w = dome.size[0], dome.size[1]
    x, y = column - R(0.5), min(max(row - R(0.5), R(0)), R(h - 1))
    i, j = math.floor(x), math.floor(y)
    s, t = R(x - R(i)), R(y - R(j))
    red, green, blue = R(0), R(0), R(0)
    for corner in range(4):
        di, dj = corner & 1, corner >> 1
        weight = (s if di else R(1) - s) * (t if dj else R(1) - t)
        k = min(j + dj, h - 1) * w + (i + di + w) % w
        red += weight * dome.cells[k, 0]
        green += weight * dome.cells[k, 1]
        blue += weight * dome.cells[k, 2]
    return red, green, blue


@njit(**INLINE)
def sample_dome(dome, u0, u1, u2):
    """A world direction from three uniform numbers: (x, y, z, r, g, b, pdf [1/sr])."""
    h, w = dome.size[0], dome.size[1]
    k = min(int(u0 * R(h * w)), h * w - 1)
    kept = dome.cells[k, KEPT]
    # What is left of the number after the choice is uniform again.
    if u2 < kept:
        rest = u2 / kept
    else:
        rest = (u2 - kept) / (R(1) - kept)
        k = int(dome.cells[k, OTHER])
    j = k // w
    column = R(k - j * w) + min(max(rest, R(0)), R(0.9999999))
    theta = (R(j) + u1) * (_PI / R(h))
    longitude = column * (R(2) * _PI / R(w)) - R(0.5) * _PI
    sine, b = sin(R, theta), cos(R, theta)
    a, c = sine * cos(R, longitude), sine * sin(R, longitude)
    m = dome.rotation
    return (
        m[0, 0] * a + m[1, 0] * b + m[2, 0] * c,
        m[0, 1] * a + m[1, 1] * b + m[2, 1] * c,
        m[0, 2] * a + m[1, 2] * b + m[2, 2] * c,
        dome.cells[k, 0],
        dome.cells[k, 1],
        dome.cells[k, 2],
        dome.cells[k, DENSITY] / max(sine, R(1e-6)),
    )
