"""A sphere light that shines outwards."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import PART, whole
from fabricusd.reference.lights.dome import Dome
from fabricusd.reference.lights.hit_block import PX, PY, PZ, U0, U1, in_cone, keep
from fabricusd.reference.lights.ray_block import D_X, D_Y, D_Z, REACH, add, towards
from fabricusd.reference.lights.row import (
    AREA,
    CHANCE,
    SIZE,
    Axes,
    P,
    mean_irradiance,
    put_axes,
)
from fabricusd.scene.light_kinds import SPHERE
from fabricusd.scene.scene import Light

KIND = SPHERE
R = np.float32
_PI = R(math.pi)


def fill(row: NDArray[np.float64], light: Light, axes: Axes) -> None:
    """SIZE is the radius; a frame that scales unevenly is replaced by its mean scale."""
    put_axes(row, axes.x, axes.y, axes.normal)
    row[SIZE] = light.radius * float(np.mean(axes.lengths))
    row[AREA] = 4 * math.pi * row[SIZE] ** 2


def irradiance(row: NDArray[np.float32], dome: Dome, places: NDArray[np.float32]) -> float:
    """The sphere looks the same from all sides."""
    return mean_irradiance(row, places, one_sided=False)


@njit(**PART)
def sample(light, dome, begin, end, block):
    """Sample directions to the light for hits `begin` to before `end`, see `hit_block`."""
    cx, cy, cz = light[P], light[P + 1], light[P + 2]
    chance, radius2 = light[CHANCE], light[SIZE] * light[SIZE]
    for y in range(whole(begin), whole(end)):
        ax, ay, az = cx - block[PX + y], cy - block[PY + y], cz - block[PZ + y]
        square = ax * ax + ay * ay + az * az
        outside = square > radius2
        square = max(square, radius2)
        distance = math.sqrt(square)
        inverse = R(1) / distance
        ax, ay, az = ax * inverse, ay * inverse, az * inverse
        sine2 = radius2 / square
        wide = sine2 / (R(1) + math.sqrt(max(R(1) - sine2, R(0))))
        dx, dy, dz = in_cone(ax, ay, az, wide, block[U0 + y], block[U1 + y])
        along = (dx * ax + dy * ay + dz * az) * distance
        reach = along - math.sqrt(max(radius2 - square + along * along, R(0)))
        pdf = chance / (R(2) * _PI * wide)
        keep(block, y, dx, dy, dz, reach, pdf if outside else R(0))


@njit(**PART)
def meet(light, dome, size, block):
    """Add what `size` rays see of the light, see `ray_block`."""
    radius2 = light[SIZE] * light[SIZE]
    for x in range(size):
        ax, ay, az = towards(light, block, x)
        dx, dy, dz = block[D_X + x], block[D_Y + x], block[D_Z + x]
        square = ax * ax + ay * ay + az * az
        along = ax * dx + ay * dy + az * dz
        bx, by, bz = ax - along * dx, ay - along * dy, az - along * dz
        inside = radius2 - (bx * bx + by * by + bz * bz)
        near = along - math.sqrt(max(inside, R(0)))
        met = square > radius2 and along > R(0) and inside >= R(0) and near < block[REACH + x]
        sine2 = radius2 / max(square, radius2)
        one_minus_cos = sine2 / (R(1) + math.sqrt(R(1) - sine2))
        add(light, block, x, light[CHANCE] / (R(2) * _PI * one_minus_cos) if met else R(0))
