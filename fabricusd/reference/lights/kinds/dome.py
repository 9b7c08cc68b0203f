"""The dome light: all domes of a scene, merged into one picture around it."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import PART, whole
from fabricusd.reference.lights.dome import (
    DENSITY,
    Dome,
    cell_at,
    choose_cell,
    direction_in,
    place_of,
    smooth_radiance,
)
from fabricusd.reference.lights.hit_block import (
    DISTANCE,
    DX,
    DY,
    DZ,
    LIGHT_B,
    LIGHT_G,
    LIGHT_R,
    PDF,
    U0,
    U1,
)
from fabricusd.reference.lights.ray_block import (
    COLUMN,
    D_X,
    D_Y,
    D_Z,
    FIRST,
    REACH,
    ROW,
    SEEN_B,
    SEEN_G,
    SEEN_R,
    weight_of,
)
from fabricusd.reference.lights.row import CHANCE, LUMINANCE, VISIBLE, Axes
from fabricusd.reference.rays.embree import ENDLESS, INFINITE_DISTANCE
from fabricusd.scene.light_kinds import DOME
from fabricusd.scene.scene import Light

KIND = DOME
R = np.float32


def fill(row: NDArray[np.float64], light: Light, axes: Axes) -> None:
    """Make the dome visible to the camera, or not; its other data lies in the `Dome`."""
    row[VISIBLE] = 0.0 if light.hidden else 1.0


def irradiance(row: NDArray[np.float32], dome: Dome, places: NDArray[np.float32]) -> float:
    """The same everywhere."""
    h, w = (int(n) for n in dome.size)
    edges = np.cos(np.pi * np.arange(h + 1) / h)
    solid = np.repeat((edges[:-1] - edges[1:]) * 2 * np.pi / w, w)
    return float((dome.cells[:, :3] @ LUMINANCE) @ solid / 4)


@njit(**PART)
def sample(light, dome, begin, end, block):
    """Sample directions to the light for hits `begin` to before `end`, see `hit_block`."""
    chance = light[CHANCE]
    for y in range(whole(begin), whole(end)):
        j, down, i, along = choose_cell(dome, block[U0 + y], block[U1 + y])
        cell = dome.cells[j * dome.size[1] + i]
        block[LIGHT_R + y], block[LIGHT_G + y], block[LIGHT_B + y] = cell[0], cell[1], cell[2]
        block[DISTANCE + y], block[PDF + y] = INFINITE_DISTANCE, cell[DENSITY] * chance
        block[DX + y], block[DY + y], block[DZ + y] = R(j), down, R(i) + along
    for y in range(whole(begin), whole(end)):
        dx, dy, dz = direction_in(dome, block[DX + y], block[DY + y], block[DZ + y])
        block[DX + y], block[DY + y], block[DZ + y] = dx, dy, dz


@njit(**PART)
def meet(light, dome, size, block):
    """Add what `size` rays see of the light, see `ray_block`."""
    if dome.cells.shape[0] == 1:
        pdf = dome.cells[0, DENSITY] * light[CHANCE]
        red, green, blue = dome.cells[0, 0], dome.cells[0, 1], dome.cells[0, 2]
        for x in range(size):
            hidden = block[REACH + x] < ENDLESS or block[FIRST + x] > light[VISIBLE]
            weight = R(0) if hidden else weight_of(block, x, pdf)
            block[SEEN_R + x] += weight * red
            block[SEEN_G + x] += weight * green
            block[SEEN_B + x] += weight * blue
        return
    for x in range(size):
        block[COLUMN + x], block[ROW + x] = place_of(
            dome, block[D_X + x], block[D_Y + x], block[D_Z + x]
        )
    for x in range(size):
        if block[REACH + x] < ENDLESS or block[FIRST + x] > light[VISIBLE]:
            continue
        column, row = block[COLUMN + x], block[ROW + x]
        weight = R(1)
        if block[FIRST + x] > R(0):
            red, green, blue = smooth_radiance(dome, column, row)
        else:
            cell = dome.cells[cell_at(dome, column, row)]
            red, green, blue = cell[0], cell[1], cell[2]
            weight = weight_of(block, x, cell[DENSITY] * light[CHANCE])
        block[SEEN_R + x] += weight * red
        block[SEEN_G + x] += weight * green
        block[SEEN_B + x] += weight * blue
