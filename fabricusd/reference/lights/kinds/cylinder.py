"""A cylinder light along its frame's x that shines outwards; the cylinder's ends are open."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import PART, cos, sin, whole
from fabricusd.reference.lights.dome import Dome
from fabricusd.reference.lights.hit_block import U0, U1, keep_point
from fabricusd.reference.lights.ray_block import D_X, D_Y, D_Z, add_area, towards
from fabricusd.reference.lights.row import AREA, SIZE, Axes, P, X, Y, Z, mean_irradiance, put_axes
from fabricusd.scene.light_kinds import CYLINDER
from fabricusd.scene.scene import Light

KIND = CYLINDER
R = np.float32
_PI = R(math.pi)


def fill(row: NDArray[np.float64], light: Light, axes: Axes) -> None:
    """X is half the axis, Y and Z are unit directions across it, and SIZE is the radius."""
    x = 0.5 * light.height * axes.x
    put_axes(row, x, axes.y / axes.lengths[1], axes.z / axes.lengths[2])
    row[SIZE] = light.radius * float(np.mean(axes.lengths[1:]))
    row[AREA] = 2 * math.pi * row[SIZE] * light.height * axes.lengths[0]


def irradiance(row: NDArray[np.float32], dome: Dome, places: NDArray[np.float32]) -> float:
    """Treats the cylinder as if it looked the same from all sides."""
    return mean_irradiance(row, places, one_sided=False)


@njit(**PART)
def sample(light, dome, begin, end, block):
    """Sample directions to the light for hits `begin` to before `end`, see `hit_block`."""
    r = light[SIZE]
    for y in range(whole(begin), whole(end)):
        a, phi = R(2) * block[U0 + y] - R(1), R(2) * _PI * block[U1 + y]
        c, s = cos(R, phi), sin(R, phi)
        nx = c * light[Y] + s * light[Z]
        ny = c * light[Y + 1] + s * light[Z + 1]
        nz = c * light[Y + 2] + s * light[Z + 2]
        keep_point(
            light, block, y,
            light[P] + a * light[X] + r * nx,
            light[P + 1] + a * light[X + 1] + r * ny,
            light[P + 2] + a * light[X + 2] + r * nz,
            nx, ny, nz,
        )  # fmt: skip


@njit(**PART)
def meet(light, dome, size, block):
    """Add what `size` rays see of the light, see `ray_block`."""
    xx, xy, xz = light[X], light[X + 1], light[X + 2]
    per_half2 = R(1) / (xx * xx + xy * xy + xz * xz)
    r2 = light[SIZE] * light[SIZE]
    for x in range(size):
        ax, ay, az = towards(light, block, x)
        dx, dy, dz = block[D_X + x], block[D_Y + x], block[D_Z + x]
        da = (dx * xx + dy * xy + dz * xz) * per_half2
        pa = (ax * xx + ay * xy + az * xz) * per_half2
        ex, ey, ez = dx - da * xx, dy - da * xy, dz - da * xz
        fx, fy, fz = ax - pa * xx, ay - pa * xy, az - pa * xz
        e2 = ex * ex + ey * ey + ez * ez
        ef = ex * fx + ey * fy + ez * fz
        f2 = fx * fx + fy * fy + fz * fz
        squared = ef * ef - e2 * (f2 - r2)
        root = math.sqrt(max(squared, R(0)))
        t = (ef - root) / max(e2, R(1e-12))
        met = e2 > R(1e-12) and squared > R(0) and f2 > r2 and abs(t * da - pa) <= R(1)
        add_area(light, block, x, met, t, root / light[SIZE])
