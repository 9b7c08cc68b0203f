"""What rays see of the lights before their first triangle, a block of rays at a time.

Lights are no obstacles: a ray goes on behind them, so what it sees is the sum over all that it
passes. A light's kind is a constant of each loop, and LLVM vectorises the loops.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.kernels.real import INLINE, PART
from fabricusd.reference.lights.dome import DENSITY, cell_at, place_of, smooth_radiance
from fabricusd.reference.lights.table import AREA, CHANCE, KIND, RED, SIZE, VISIBLE, P, X, Y, Z
from fabricusd.scene.scene import CYLINDER, DISK, DISTANT, DOME, SPHERE

R = np.float32
_PI = R(math.pi)
BLOCK = 128

# Rows of a block of rays: origin and direction, length up to the first triangle, pdf of the
# direction (below 0: nothing else samples it), 1 for a ray from the camera and 0 for others, what
# the ray sees, and scratch.
(O_X, O_Y, O_Z, D_X, D_Y, D_Z, REACH, BEFORE, FIRST, SEEN_R, SEEN_G, SEEN_B, _COLUMN, _ROW) = (
    row * BLOCK for row in range(14)
)
LIGHT_ROWS = 14
ENDLESS = R(1e29)
"""Length from which on a ray has met nothing."""


@njit(**PART)
def meet_lights(lights, dome, all_first, size, block):
    """Rows SEEN_R to SEEN_B of `size` rays: radiance of all lights that they pass, each weighted
    by the power heuristic against light sampling.

    all_first : whether every ray comes from the camera, so that lights it does not see are skipped
    """
    for row in range(SEEN_R, SEEN_B + 1, BLOCK):
        for x in range(size):
            block[row + x] = R(0)
    for j in range(lights.shape[0]):
        light = lights[j]
        kind = int(light[KIND])
        if kind == DOME:
            _meet_dome(light, dome, size, block)
        elif all_first and light[VISIBLE] == R(0):
            continue
        elif kind == DISTANT:
            _meet_distant(light, size, block)
        elif kind == SPHERE:
            _meet_sphere(light, size, block)
        elif kind == CYLINDER:
            _meet_cylinder(light, size, block)
        else:
            _meet_flat(light, kind == DISK, size, block)


@njit(**INLINE)
def _weight(block, x, pdf):
    """[Veach1997], of a direction that light sampling finds with the density `pdf`."""
    before = block[BEFORE + x]
    ratio = pdf / max(before, R(1e-30))
    return R(1) / (R(1) + ratio * ratio) if before > R(0) else R(1)


@njit(**INLINE)
def _add(light, block, x, pdf):
    """Add a light of constant radiance, unless its pdf is 0 or it hides from the camera."""
    hidden = block[FIRST + x] > light[VISIBLE]
    weight = R(0) if hidden or pdf <= R(0) else _weight(block, x, pdf)
    block[SEEN_R + x] += weight * light[RED]
    block[SEEN_G + x] += weight * light[RED + 1]
    block[SEEN_B + x] += weight * light[RED + 2]


@njit(**INLINE)
def _towards(light, block, x):
    """From the ray's origin to the light's position."""
    return light[P] - block[O_X + x], light[P + 1] - block[O_Y + x], light[P + 2] - block[O_Z + x]


@njit(**PART)
def _meet_dome(light, dome, size, block):
    if dome.cells.shape[0] == 1:
        pdf = dome.cells[0, DENSITY] * light[CHANCE]
        red, green, blue = dome.cells[0, 0], dome.cells[0, 1], dome.cells[0, 2]
        for x in range(size):
            weight = _weight(block, x, pdf) if block[REACH + x] >= ENDLESS else R(0)
            block[SEEN_R + x] += weight * red
            block[SEEN_G + x] += weight * green
            block[SEEN_B + x] += weight * blue
        return
    for x in range(size):
        block[_COLUMN + x], block[_ROW + x] = place_of(
            dome, block[D_X + x], block[D_Y + x], block[D_Z + x]
        )
    for x in range(size):
        if block[REACH + x] < ENDLESS:
            continue
        column, row = block[_COLUMN + x], block[_ROW + x]
        weight = R(1)
        if block[FIRST + x] > R(0):
            red, green, blue = smooth_radiance(dome, column, row)
        else:
            cell = dome.cells[cell_at(dome, column, row)]
            red, green, blue = cell[0], cell[1], cell[2]
            weight = _weight(block, x, cell[DENSITY] * light[CHANCE])
        block[SEEN_R + x] += weight * red
        block[SEEN_G + x] += weight * green
        block[SEEN_B + x] += weight * blue


@njit(**PART)
def _meet_distant(light, size, block):
    if light[AREA] <= R(0):
        return
    zx, zy, zz = light[Z], light[Z + 1], light[Z + 2]
    pdf = light[CHANCE] / (R(2) * _PI * light[AREA])
    for x in range(size):
        # |d - z|^2 = 2 (1 - cos), which keeps the sun's half degree in float32.
        ax, ay, az = block[D_X + x] - zx, block[D_Y + x] - zy, block[D_Z + x] - zz
        inside = R(0.5) * (ax * ax + ay * ay + az * az) <= light[AREA]
        _add(light, block, x, pdf if inside and block[REACH + x] >= ENDLESS else R(0))


@njit(**PART)
def _meet_sphere(light, size, block):
    radius2 = light[SIZE] * light[SIZE]
    for x in range(size):
        ax, ay, az = _towards(light, block, x)
        dx, dy, dz = block[D_X + x], block[D_Y + x], block[D_Z + x]
        square = ax * ax + ay * ay + az * az
        along = ax * dx + ay * dy + az * dz
        bx, by, bz = ax - along * dx, ay - along * dy, az - along * dz
        inside = radius2 - (bx * bx + by * by + bz * bz)
        near = along - math.sqrt(max(inside, R(0)))
        met = square > radius2 and along > R(0) and inside >= R(0) and near < block[REACH + x]
        sine2 = radius2 / max(square, radius2)
        one_minus_cos = sine2 / (R(1) + math.sqrt(R(1) - sine2))
        _add(light, block, x, light[CHANCE] / (R(2) * _PI * one_minus_cos) if met else R(0))


@njit(**INLINE)
def _add_area(light, block, x, met, t, cosine):
    """Add a light of an area at the distance t, where its normal makes the cosine with the ray."""
    seen = met and t > R(0) and t < block[REACH + x] and cosine > R(1e-6)
    pdf = light[CHANCE] * t * t / (max(cosine, R(1e-6)) * light[AREA])
    _add(light, block, x, pdf if seen else R(0))


@njit(**PART)
def _meet_flat(light, disk, size, block):
    zx, zy, zz = light[Z], light[Z + 1], light[Z + 2]
    xx, xy, xz = light[X], light[X + 1], light[X + 2]
    yx, yy, yz = light[Y], light[Y + 1], light[Y + 2]
    per_x = R(1) / (xx * xx + xy * xy + xz * xz)
    per_y = R(1) / (yx * yx + yy * yy + yz * yz)
    for x in range(size):
        ax, ay, az = _towards(light, block, x)
        dx, dy, dz = block[D_X + x], block[D_Y + x], block[D_Z + x]
        cosine = -(dx * zx + dy * zy + dz * zz)
        t = -(ax * zx + ay * zy + az * zz) / max(cosine, R(1e-6))
        qx, qy, qz = t * dx - ax, t * dy - ay, t * dz - az
        a = (qx * xx + qy * xy + qz * xz) * per_x
        b = (qx * yx + qy * yy + qz * yz) * per_y
        met = a * a + b * b <= R(1) if disk else max(abs(a), abs(b)) <= R(1)
        _add_area(light, block, x, met, t, cosine)


@njit(**PART)
def _meet_cylinder(light, size, block):
    """The outside of a cylinder; its ends are open."""
    xx, xy, xz = light[X], light[X + 1], light[X + 2]
    per_half2 = R(1) / (xx * xx + xy * xy + xz * xz)
    r2 = light[SIZE] * light[SIZE]
    for x in range(size):
        ax, ay, az = _towards(light, block, x)
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
        _add_area(light, block, x, met, t, root / light[SIZE])
