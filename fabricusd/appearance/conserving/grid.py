"""Tables by direction: where their entries lie, and how kernels read between them.

A table is indexed by polar angle and azimuth, because an average over azimuth is 12-15 % wrong on
satin. Row t in [0, 1] lies at the polar angle 90 sin(90 t) degrees. Narrow lobes make the tables
steep within their width of the horizon, and the rows are dense there. At the horizon an entry is
an even function of 1 - t, and at the pole it continues on the opposite side, so cubic interpolation
needs no one-sided stencil. A direction below the cloth reads the entry of its opposite.

A table that is read for every pair of directions has a border (`bordered`): the entries beyond the
pole, the horizon and the last column are then in place, and the stencil is one loop without tests.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import INLINE, LEAN, PART, acos, asin, atan2

Floats = NDArray[np.float64]
Reals = NDArray[Any]


@njit(**INLINE)
def polar_angle(t):
    """Polar angle [rad] of the row t in [0, 1]."""
    return 0.5 * math.pi * math.sin(0.5 * math.pi * t)


def entry_angles(rows: int, columns: int) -> tuple[Floats, Floats]:
    """Polar angle and azimuth [rad] of every entry, each (rows, columns)."""
    theta = 0.5 * math.pi * np.sin(0.5 * math.pi * np.linspace(0.0, 1.0, rows))
    phi = 2.0 * math.pi * np.arange(columns) / columns
    polar, azimuth = np.meshgrid(theta, phi, indexing="ij")
    return polar, azimuth


@njit(**INLINE)
def cell(R, rows, columns, x, y, z):
    """(row, column, t, u): the cell of a direction above the cloth, and the place in it.

    Without branches and with whole numbers of 32 bits, loops over directions run in vectors: in a
    fifteenth of the time.
    """
    t = asin(R, acos(R, z) * R(2 / math.pi)) * R(2 / math.pi)
    i = t * R(rows - 1)
    j = atan2(R, y, x) * R(columns / (2.0 * math.pi))
    j = j + R(columns) if j < R(0) else j
    row, column = np.int32(min(i, R(rows - 2))), np.int32(j)
    return row, column, i - R(row), j - R(column)


@njit(**INLINE)
def cubic_weight(R, k, t):
    """Weight of the k-th of four entries in Catmull-Rom interpolation between the middle two."""
    if k == 0:
        return R(0.5) * t * (t * (R(2) - t) - R(1))
    if k == 1:
        return R(1) + R(0.5) * t * t * (R(3) * t - R(5))
    if k == 2:
        return R(0.5) * t * (R(1) + t * (R(4) - R(3) * t))
    return R(0.5) * t * t * (t - R(1))


@njit(**INLINE)
def beyond(rows, columns, row, column):
    """(row, column) of an entry of which the row may lie beyond the pole or the horizon."""
    if row < 0:
        row, column = -row, column + columns // 2
    elif row > rows - 1:
        row = 2 * (rows - 1) - row
    return row, (column + columns) % columns


@njit(**PART)
def share_at(R, table, x, y, z):
    """The entry of a (rows, columns) table for a direction, at least 0."""
    if z < R(0):
        x, y, z = -x, -y, -z
    row, column, t, u = cell(R, table.shape[0], table.shape[1], x, y, z)
    return share_in(R, table, row, column, t, u)


@njit(**INLINE)
def share_in(R, table, row, column, t, u):
    """`share_at` in the cell (row, column) at (t, u), as `cell` gives them."""
    rows, columns = table.shape
    total = R(0)
    for a in range(4):
        for b in range(4):
            i, j = beyond(rows, columns, row + a - 1, column + b - 1)
            total += cubic_weight(R, a, t) * cubic_weight(R, b, u) * table[i, j]
    return max(R(0), total)


BORDER_ROWS, BORDER_COLUMNS, WIDTH = 2, 4, 4
"""Rows and columns that `bordered` adds, and the numbers per entry there: with four of them, the
four columns of a stencil are 16 numbers side by side."""


def bordered(sides: Reals) -> Reals:
    """(2, rows + BORDER_ROWS, columns + BORDER_COLUMNS, WIDTH) of a (2, rows, columns, 3) table.

    Entry (i, j) of the result is entry (i - 1, j - 1) of the table, continued as `beyond` says.
    """
    rows, columns = sides.shape[1:3]
    out = np.zeros((2, rows + BORDER_ROWS, columns + BORDER_COLUMNS, WIDTH), sides.dtype)
    for row in range(out.shape[1]):
        for column in range(out.shape[2]):
            i, j = beyond.py_func(rows, columns, row - 1, column - 1)
            out[:, row, column, :3] = sides[:, i, j]
    return out


def without_border(sides: Reals) -> Reals:
    """(2, rows, columns, 3) view of what `bordered` was given."""
    return sides[:, 1:-1, 1:-3, :3]


@njit(**INLINE)
def shape_of(sides):
    """(rows, columns) of a bordered table without its border."""
    return sides.shape[1] - BORDER_ROWS, sides.shape[2] - BORDER_COLUMNS


@njit(**PART)
def side_at(R, sides, side, x, y, z):
    """The three entries of a `bordered` table for a direction and side, at least 0."""
    if z < R(0):
        x, y, z = -x, -y, -z
    rows, columns = shape_of(sides)
    row, column, t, u = cell(R, rows, columns, x, y, z)
    return side_in(R, sides, side, row, column, t, u)


@njit(**INLINE)
def side_in(R, sides, side, row, column, t, u):
    """`side_at` in the cell (row, column) at (t, u), as `cell` gives them."""
    first, second, third = R(0), R(0), R(0)
    for a in range(4):
        for b in range(4):
            weight = cubic_weight(R, a, t) * cubic_weight(R, b, u)
            first += weight * sides[side, row + a, column + b, 0]
            second += weight * sides[side, row + a, column + b, 1]
            third += weight * sides[side, row + a, column + b, 2]
    return max(R(0), first), max(R(0), second), max(R(0), third)


def mean_share(table: Floats) -> float:
    """(1/pi) times the cosine-weighted integral of a table over one side, from Gauss-Legendre
    points in every cell of the interpolated table."""
    if table.size == 0:
        return 0.0
    x, w = np.polynomial.legendre.leggauss(4)
    return float(_integrate(np.float64, np.ascontiguousarray(table, dtype=np.float64), x, w))


@njit(**LEAN)
def _integrate(R, table, x, w):
    rows, columns = table.shape
    turn = 2.0 * math.pi / columns
    total = 0.0
    for i in range((rows - 1) * x.size):
        row = i // x.size
        low, high = polar_angle(row / (rows - 1)), polar_angle((row + 1) / (rows - 1))
        theta = low + 0.5 * (high - low) * (x[i % x.size] + 1.0)
        weight = 0.5 * (high - low) * w[i % x.size] * math.sin(theta) * math.cos(theta)
        for j in range(columns * x.size):
            phi = turn * (j // x.size + 0.5 * (x[j % x.size] + 1.0))
            share = share_at(
                R, table, math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi),
                math.cos(theta),
            )  # fmt: skip
            total += weight * 0.5 * turn * w[j % x.size] * share
    return total / math.pi
