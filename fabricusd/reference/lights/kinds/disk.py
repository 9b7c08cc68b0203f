"""A disk light: an ellipse that shines along its frame's -z."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import PART, cos, sin, whole
from fabricusd.reference.lights.dome import Dome
from fabricusd.reference.lights.hit_block import U0, U1, keep_flat
from fabricusd.reference.lights.ray_block import meet_flat
from fabricusd.reference.lights.row import AREA, Axes, mean_irradiance, put_axes
from fabricusd.scene.light_kinds import DISK
from fabricusd.scene.scene import Light

KIND = DISK
R = np.float32
_PI = R(math.pi)


def fill(row: NDArray[np.float64], light: Light, axes: Axes) -> None:
    """X and Y are the half axes of the ellipse."""
    x, y = light.radius * axes.x, light.radius * axes.y
    put_axes(row, x, y, axes.normal)
    row[AREA] = math.pi * np.linalg.norm(np.cross(x, y))


def irradiance(row: NDArray[np.float32], dome: Dome, places: NDArray[np.float32]) -> float:
    """Zero behind the light."""
    return mean_irradiance(row, places, one_sided=True)


@njit(**PART)
def sample(light, dome, begin, end, block):
    """Sample directions to the light for hits `begin` to before `end`, see `hit_block`."""
    for y in range(whole(begin), whole(end)):
        r, phi = math.sqrt(block[U0 + y]), R(2) * _PI * block[U1 + y]
        keep_flat(light, block, y, r * cos(R, phi), r * sin(R, phi))


@njit(**PART)
def meet(light, dome, size, block):
    """Add what `size` rays see of the light, see `ray_block`."""
    meet_flat(light, True, size, block)
