"""A dome light's picture: looked up by direction, and sampled in proportion to its brightness.

The layout is latitude-longitude as in OpenEXR and USD: +y is the top row, +z the middle column, and
+x lies a quarter of the width to its left. For illumination, the picture is constant over each
texel, so that the sampling density is exactly proportional to it. For camera rays, the picture is
interpolated.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import INLINE, acos, atan2, cos, sin
from fabricusd.reference.lights.row import LUMINANCE

R = np.float32
_PI = R(math.pi)
DENSITY, UPTO, GUIDE, CELL = 3, 4, 5, 8
"""Columns of `Dome.cells` after the radiance, and their number; two cells share a cache line."""


class Dome(NamedTuple):
    """The tables of a dome's picture.

    cells : (h w, CELL) float32 - the data of each texel, contiguous in memory: radiance r, g, b;
        density [1/sr]; cumulative share of the row's brightness, up to and including this texel;
        guide: the texel at which the search of the row starts for numbers from k/w on, where k is
        this texel's column
    rows : (h, 2) float32 - cumulative share and guide of the rows
    size : (2,) int64 - h, w; rotation : (3, 3) float32 - world to dome
    """

    cells: NDArray[np.float32]
    rows: NDArray[np.float32]
    size: NDArray[np.int64]
    rotation: NDArray[np.float32]


def build_dome(image: NDArray[Any], rotation: NDArray[Any]) -> Dome:
    """Build the tables of an (h, w, 3) picture of radiance; `rotation` (3, 3) is world to dome."""
    picture = np.ascontiguousarray(image, np.float32)
    h, w = picture.shape[:2]
    brightness = np.maximum(picture.astype(np.float64) @ LUMINANCE, 0.0)
    edges = np.cos(np.pi * np.arange(h + 1) / h)
    solid = (edges[:-1] - edges[1:]) * (2 * np.pi / w)
    if not brightness.sum() > 0:
        brightness[:] = 1.0
    of_rows = brightness.sum(axis=1) * solid
    # A black row is never chosen; its shares only have to be finite.
    inside = np.where(of_rows[:, None] > 0, brightness, 1.0)
    cells = np.zeros((h, w, CELL), np.float32)
    cells[..., :3] = picture
    cells[..., DENSITY] = brightness / of_rows.sum()
    cells[..., UPTO], cells[..., GUIDE] = shares_and_guides(inside)
    upto, guide = shares_and_guides(of_rows[None])
    rows = np.stack([upto[0], guide[0]], axis=1)
    return Dome(
        cells.reshape(-1, CELL), rows, np.array([h, w]), np.ascontiguousarray(rotation, np.float32)
    )


def shares_and_guides(
    weight: NDArray[np.float64],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """For (m, n) rows of weights: cumulative shares, and guides where a search for k/n may begin.

    [Chen1974] A search that starts at the guide takes fewer than two steps on average.
    """
    n = weight.shape[1]
    upto = np.cumsum(weight, axis=1)
    shares = np.asarray(upto / upto[:, -1:], np.float32)
    # Uniform numbers are below 1, so a share of 2 stops every search before the end of the row.
    last = n - np.argmax(weight[:, ::-1] > 0, axis=1)
    shares[np.arange(n) >= last[:, None] - 1] = 2.0
    starts = (np.arange(n) / n).astype(np.float32)
    guide = np.stack([np.searchsorted(row, starts, side="right") for row in shares])
    return shares, guide.astype(np.float32)


@njit(**INLINE)
def place_of(dome, x, y, z):
    """Map a world direction to picture coordinates (column, row) [texels]."""
    m = dome.rotation
    a = m[0, 0] * x + m[0, 1] * y + m[0, 2] * z
    b = m[1, 0] * x + m[1, 1] * y + m[1, 2] * z
    c = m[2, 0] * x + m[2, 1] * y + m[2, 2] * z
    longitude = atan2(R, c, a)
    u = (longitude + R(0.5) * _PI) * R(0.5 / math.pi)
    u = u - math.floor(u)
    v = acos(R, b) * R(1.0 / math.pi)
    return R(u) * R(dome.size[1]), v * R(dome.size[0])


@njit(**INLINE)
def cell_at(dome, column, row):
    """Index of the texel at (column, row)."""
    h, w = dome.size[0], dome.size[1]
    return min(int(row), h - 1) * w + min(int(column), w - 1)


@njit(**INLINE)
def smooth_radiance(dome, column, row):
    """Bilinear lookup of (r, g, b), for camera rays."""
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
def _find(table, start, count, upto, guide, u):
    """Find u among `count` cumulative shares: (index, fractional position there in [0, 1))."""
    k = min(int(u * R(count)), count - 1)
    k = int(table[start + k, guide])
    while u >= table[start + k, upto]:
        k += 1
    low = table[start + k - 1, upto] if k > 0 else R(0)
    rest = (u - low) / (min(table[start + k, upto], R(1)) - low)
    return k, min(max(rest, R(0)), R(0.9999999))


@njit(**INLINE)
def choose_cell(dome, u0, u1):
    """Choose a texel in proportion to its brightness: (row, position down the row, column, position
    along the texel), both positions in [0, 1)."""
    h, w = dome.size[0], dome.size[1]
    if h * w == 1:
        return 0, u0, 0, u1
    j, down = _find(dome.rows, 0, h, 0, 1, u0)
    i, along = _find(dome.cells, j * w, w, UPTO, GUIDE, u1)
    return j, down, i, along


@njit(**INLINE)
def direction_in(dome, row, down, column):
    """World direction of a point in the picture: `column` in texels, and `down` within `row`.

    `down` is linear in solid angle.
    """
    top = cos(R, row * (_PI / R(dome.size[0])))
    bottom = cos(R, (row + R(1)) * (_PI / R(dome.size[0])))
    b = top + down * (bottom - top)
    sine = math.sqrt(max((R(1) - b) * (R(1) + b), R(0)))
    longitude = column * (R(2) * _PI / R(dome.size[1])) - R(0.5) * _PI
    a, c = sine * cos(R, longitude), sine * sin(R, longitude)
    m = dome.rotation
    return (
        m[0, 0] * a + m[1, 0] * b + m[2, 0] * c,
        m[0, 1] * a + m[1, 1] * b + m[2, 1] * c,
        m[0, 2] * a + m[1, 2] * b + m[2, 2] * c,
    )
