"""A dome's picture: looked up by direction, and sampled in proportion to its brightness.

Latitude-longitude as OpenEXR and USD lay it out: +y is the top row, +z the middle column, +x a
quarter of the width to its left. Lookup is bilinear, sampling constant in each texel; a texel's
share comes from the brightest of its neighbours, so that it is never 0 where the lookup is not.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.real import KERNEL, LEAN, acos, atan2, cos, sin

R = np.float32
_PI = R(math.pi)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


class Dome(NamedTuple):
    """image : (h, w, 3) float32; density : (h, w) float32 - [1/sr] times sin(theta);
    alias_share, alias_other : (h w,) - Walker's table; rotation : (3, 3) float32, world to dome."""

    image: NDArray[np.float32]
    density: NDArray[np.float32]
    alias_share: NDArray[np.float32]
    alias_other: NDArray[np.int32]
    rotation: NDArray[np.float32]


def build_dome(image: NDArray[Any], rotation: NDArray[Any]) -> Dome:
    """Tables for a picture (h, w, 3) of radiance; `rotation` (3, 3) goes from world to dome."""
    picture = np.ascontiguousarray(image, np.float32)
    h, w = picture.shape[:2]
    brightness = np.maximum(picture.astype(np.float64) @ LUMINANCE, 0.0)
    wrapped = np.pad(np.pad(brightness, ((1, 1), (0, 0)), "edge"), ((0, 0), (1, 1)), "wrap")
    brightest = np.max([wrapped[j : j + h, i : i + w] for j in range(3) for i in range(3)], axis=0)
    edges = np.cos(np.pi * np.arange(h + 1) / h)
    weight = brightest * (edges[:-1] - edges[1:])[:, None]
    total = weight.sum()
    if not total > 0:
        weight, total = np.repeat((edges[:-1] - edges[1:])[:, None], w, axis=1), 2.0 * w
    share = weight / total
    other, kept = alias_table(share.ravel())
    # Inside a texel a sample is uniform in longitude and latitude.
    density = share * (h * w) / (2 * np.pi**2)
    return Dome(
        picture,
        np.ascontiguousarray(density, np.float32),
        kept,
        other,
        np.ascontiguousarray(rotation, np.float32),
    )


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


@njit(**LEAN)
def place_of(dome, x, y, z):
    """World direction to picture coordinates (column, row) in texels, sin of the polar angle."""
    m = dome.rotation
    a = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
    b = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z
    c = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z
    h, w = dome.density.shape
    longitude = atan2(R, c, a)
    u = (longitude + R(0.5) * _PI) * R(0.5 / math.pi)
    u = u - math.floor(u)
    v = acos(R, b) * R(1.0 / math.pi)
    return u * R(w), v * R(h), math.sqrt(max(a * a + c * c, R(1e-12)))


@njit(**LEAN)
def radiance_at(dome, column, row):
    """Bilinear lookup: (r, g, b)."""
    image = dome.image
    h, w = dome.density.shape
    x, y = column - R(0.5), min(max(row - R(0.5), R(0)), R(h - 1))
    fx, fy = math.floor(x), math.floor(y)
    i, j = int(fx), int(fy)
    s, t = R(x - fx), R(y - fy)
    i0, i1 = (i + w) % w, (i + 1) % w
    j1 = min(j + 1, h - 1)
    w00, w10 = (R(1) - s) * (R(1) - t), s * (R(1) - t)
    w01, w11 = (R(1) - s) * t, s * t
    red = w00 * image[j, i0, 0] + w10 * image[j, i1, 0]
    green = w00 * image[j, i0, 1] + w10 * image[j, i1, 1]
    blue = w00 * image[j, i0, 2] + w10 * image[j, i1, 2]
    red += w01 * image[j1, i0, 0] + w11 * image[j1, i1, 0]
    green += w01 * image[j1, i0, 1] + w11 * image[j1, i1, 1]
    blue += w01 * image[j1, i0, 2] + w11 * image[j1, i1, 2]
    return red, green, blue


@njit(**LEAN)
def density_at(dome, column, row, sine):
    """Probability [1/sr] with which `sample_dome` gives this place."""
    h, w = dome.density.shape
    return dome.density[min(int(row), h - 1), min(int(column), w - 1)] / sine


@njit(**LEAN)
def sample_dome(dome, u0, u1, u2):
    """A world direction and its (column, row, pdf [1/sr]) from three uniform numbers."""
    h, w = dome.density.shape
    k = min(int(u0 * R(h * w)), h * w - 1)
    rest = u2
    kept = dome.alias_share[k]
    # What is left of the number after the choice is uniform again.
    if rest < kept:
        rest = rest / kept
    else:
        rest = (rest - kept) / (R(1) - kept)
        k = int(dome.alias_other[k])
    j = k // w
    i = k - j * w
    column = R(i) + min(max(rest, R(0)), R(0.9999999))
    row = R(j) + u1
    theta = row * (_PI / R(h))
    longitude = column * (R(2) * _PI / R(w)) - R(0.5) * _PI
    sine, height = sin(R, theta), cos(R, theta)
    a, b, c = sine * cos(R, longitude), height, sine * sin(R, longitude)
    m = dome.rotation
    return (
        m[0, 0] * a + m[1, 0] * b + m[2, 0] * c,
        m[0, 1] * a + m[1, 1] * b + m[2, 1] * c,
        m[0, 2] * a + m[1, 2] * b + m[2, 2] * c,
        column,
        row,
        dome.density[j, i] / max(sine, R(1e-6)),
    )
