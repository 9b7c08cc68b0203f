"""A rect light: a parallelogram that shines along its frame's -z."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import PART, whole
from fabricusd.reference.lights.dome import Dome
from fabricusd.reference.lights.hit_block import U0, U1, keep_flat
from fabricusd.reference.lights.ray_block import meet_flat
from fabricusd.reference.lights.row import AREA, Axes, mean_irradiance, put_axes
from fabricusd.scene.light_kinds import RECT
from fabricusd.scene.scene import Light

KIND = RECT
R = np.float32


def fill(row: NDArray[np.float64], light: Light, axes: Axes) -> None:
    """X and Y reach from the middle to the edges."""
    x, y = 0.5 * light.width * axes.x, 0.5 * light.height * axes.y
    put_axes(row, x, y, axes.normal)
    row[AREA] = 4 * np.linalg.norm(np.cross(x, y))


def irradiance(row: NDArray[np.float32], dome: Dome, places: NDArray[np.float32]) -> float:
    """Zero behind the light."""
    return mean_irradiance(row, places, one_sided=True)


@njit(**PART)
def sample(light, dome, begin, end, block):
    """Sample directions to the light for hits `begin` to before `end`, see `hit_block`."""
    for y in range(whole(begin), whole(end)):
        a, b = R(2) * block[U0 + y] - R(1), R(2) * block[U1 + y] - R(1)
        keep_flat(light, block, y, a, b)


@njit(**PART)
def meet(light, dome, size, block):
    """Add what `size` rays see of the light, see `ray_block`."""
    meet_flat(light, False, size, block)
