"""A distant light: its rays are parallel except for the angle that the light subtends."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import PART, whole
from fabricusd.reference.lights.dome import Dome
from fabricusd.reference.lights.hit_block import U0, U1, in_cone, keep
from fabricusd.reference.lights.ray_block import D_X, D_Y, D_Z, REACH, add
from fabricusd.reference.lights.row import AREA, CHANCE, SIZE, Axes, Z, brightness, put_axes
from fabricusd.reference.rays.embree import ENDLESS, INFINITE_DISTANCE
from fabricusd.scene.light_kinds import DISTANT
from fabricusd.scene.scene import Light

KIND = DISTANT
R = np.float32
_PI = R(math.pi)


def fill(row: NDArray[np.float64], light: Light, axes: Axes) -> None:
    """AREA is the solid angle over 2 pi, 1 - cos of half the angle, free of cancellation."""
    x, y, z = axes.x / axes.lengths[0], axes.y / axes.lengths[1], axes.z / axes.lengths[2]
    put_axes(row, x, y, z)
    row[SIZE] = math.cos(0.5 * light.angle)
    row[AREA] = 2 * math.sin(0.25 * light.angle) ** 2


def irradiance(row: NDArray[np.float32], dome: Dome, places: NDArray[np.float32]) -> float:
    """The same everywhere; for a light without an angle, the radiance is an irradiance."""
    return 0.5 * brightness(row) * (2 * math.pi * float(row[AREA]) if row[AREA] > 0 else 1.0)


@njit(**PART)
def sample(light, dome, begin, end, block):
    """Sample directions to the light for hits `begin` to before `end`, see `hit_block`."""
    zx, zy, zz = light[Z], light[Z + 1], light[Z + 2]
    chance, wide = light[CHANCE], light[AREA]
    if wide <= R(0):
        for y in range(whole(begin), whole(end)):
            keep(block, y, zx, zy, zz, INFINITE_DISTANCE, -chance)
        return
    pdf = chance / (R(2) * _PI * wide)
    for y in range(whole(begin), whole(end)):
        dx, dy, dz = in_cone(zx, zy, zz, wide, block[U0 + y], block[U1 + y])
        keep(block, y, dx, dy, dz, INFINITE_DISTANCE, pdf)


@njit(**PART)
def meet(light, dome, size, block):
    """Add what `size` rays see of the light, see `ray_block`."""
    if light[AREA] <= R(0):
        return
    zx, zy, zz = light[Z], light[Z + 1], light[Z + 2]
    pdf = light[CHANCE] / (R(2) * _PI * light[AREA])
    for x in range(size):
        # Compare |d - z|^2 = 2 (1 - cos), which resolves the sun's half degree in float32.
        ax, ay, az = block[D_X + x] - zx, block[D_Y + x] - zy, block[D_Z + x] - zz
        inside = R(0.5) * (ax * ax + ay * ay + az * az) <= light[AREA]
        add(light, block, x, pdf if inside and block[REACH + x] >= ENDLESS else R(0))
