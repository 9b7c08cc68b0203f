"""A light for each hit of a block, and a direction to it: by area, by solid angle, by brightness.

Hits that chose the same light lie together, so that its kind and numbers are constants of a loop
that LLVM vectorises. Each `pdf` is per solid angle and holds the chance of choosing the light:
0 where the light does not shine on the hit, *minus* the chance for a light without extent, whose
radiance is an irradiance and which no ray hits.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.kernels.real import INLINE, PART, cos, sin, whole
from fabricusd.reference.lights.dome import DENSITY, choose_cell, direction_in
from fabricusd.reference.lights.table import AREA, CHANCE, KIND, RED, SIZE, P, X, Y, Z
from fabricusd.reference.rays.hit_frames import BLOCK, CHOSEN, MADE, NUMBERS
from fabricusd.reference.rays.wave import FRONT, N, U, V
from fabricusd.scene.scene import CYLINDER, DISK, DISTANT, DOME, RECT, SPHERE

R = np.float32
_PI = R(math.pi)
FAR = R(1e30)

# Rows of a block from CHOSEN on, in the order of `Wave.hits` from WI on.
_WI, _TO, _DISTANCE, _LIGHT, _PDF = (CHOSEN + row * BLOCK for row in (0, 3, 6, 7, 10))

_DX, _DY, _DZ = (_TO + row * BLOCK for row in range(3))
_RED, _GREEN, _BLUE = (_LIGHT + row * BLOCK for row in range(3))
_PX, _PY, _PZ = (MADE + (FRONT + row) * BLOCK for row in range(3))
_U0, _U1 = NUMBERS + 5 * BLOCK, NUMBERS + 6 * BLOCK


@njit(**PART)
def choose_lights(lights, count, left, choice):
    """Index of the light that each of `count` uniform numbers `left` chooses, which it uses up."""
    for x in range(count):
        choice[x] = 0
    for j in range(lights.shape[0] - 1):
        chance = lights[j, CHANCE]
        for x in range(count):
            left[x] -= chance
            choice[x] += 0 if left[x] < R(0) else 1


@njit(**PART)
def sample_lights(lights, dome, ends, count, block):
    """Rows WI to LIGHT_PDF of `count` hits, by two of their numbers.

    ends : (lights,) int32 - where the hits of each light end; they lie one light after the other
    """
    begin = np.int64(0)
    for j in range(lights.shape[0]):
        end = whole(ends[j])
        if end > begin:
            _sample(lights[j], dome, begin, end, block)
        begin = end
    _turn(count, block)


@njit(**INLINE)
def _turn(count, block):
    """Directions to the light in the surface frame, and what arrives from there over its pdf."""
    for x in range(count):
        dx, dy, dz = block[_TO + x], block[_TO + BLOCK + x], block[_TO + 2 * BLOCK + x]
        at = MADE + U * BLOCK + x
        block[_WI + x] = dx * block[at] + dy * block[at + BLOCK] + dz * block[at + 2 * BLOCK]
        at = MADE + V * BLOCK + x
        block[_WI + BLOCK + x] = (
            dx * block[at] + dy * block[at + BLOCK] + dz * block[at + 2 * BLOCK]
        )
        at = MADE + N * BLOCK + x
        block[_WI + 2 * BLOCK + x] = (
            dx * block[at] + dy * block[at + BLOCK] + dz * block[at + 2 * BLOCK]
        )
        pdf = abs(block[_PDF + x])
        inverse = R(1) / pdf if pdf > R(0) else R(0)
        block[_LIGHT + x] *= inverse
        block[_LIGHT + BLOCK + x] *= inverse
        block[_LIGHT + 2 * BLOCK + x] *= inverse


@njit(**PART)
def no_lights(count, block):
    """The same rows where no light is sampled."""
    for row in range(11):
        for x in range(count):
            block[CHOSEN + row * BLOCK + x] = R(0)
    for x in range(count):
        block[_WI + 2 * BLOCK + x], block[_DISTANCE + x] = R(1), FAR


@njit(**PART)
def sample_evenly(count, block):
    """Directions uniform over the sphere instead, for the estimator that knows no lights."""
    no_lights(count, block)
    for x in range(count):
        z = R(1) - R(2) * block[NUMBERS + 5 * BLOCK + x]
        r = math.sqrt(max(R(1) - z * z, R(0)))
        phi = R(2) * _PI * block[NUMBERS + 6 * BLOCK + x]
        block[_WI + x], block[_WI + BLOCK + x] = r * cos(R, phi), r * sin(R, phi)
        block[_WI + 2 * BLOCK + x] = z


@njit(**PART)
def _sample(light, dome, begin, end, block):
    """Directions to one light."""
    kind = int(light[KIND])
    if kind == DOME:
        _sample_dome(light, dome, begin, end, block)
        return
    for y in range(whole(begin), whole(end)):
        block[_RED + y], block[_GREEN + y] = light[RED], light[RED + 1]
        block[_BLUE + y] = light[RED + 2]
    if kind == DISTANT:
        _sample_distant(light, begin, end, block)
    elif kind == SPHERE:
        _sample_sphere(light, begin, end, block)
    elif kind == CYLINDER:
        _sample_cylinder(light, begin, end, block)
    elif kind == DISK:
        _sample_disk(light, begin, end, block)
    elif kind == RECT:
        _sample_rect(light, begin, end, block)


@njit(**INLINE)
def _keep(block, y, dx, dy, dz, distance, pdf):
    block[_DX + y], block[_DY + y], block[_DZ + y] = dx, dy, dz
    block[_DISTANCE + y], block[_PDF + y] = distance, pdf


@njit(**PART)
def _sample_dome(light, dome, begin, end, block):
    chance = light[CHANCE]
    for y in range(whole(begin), whole(end)):
        j, down, i, along = choose_cell(dome, block[_U0 + y], block[_U1 + y])
        cell = dome.cells[j * dome.size[1] + i]
        block[_RED + y], block[_GREEN + y], block[_BLUE + y] = cell[0], cell[1], cell[2]
        block[_DISTANCE + y], block[_PDF + y] = FAR, cell[DENSITY] * chance
        block[_DX + y], block[_DY + y], block[_DZ + y] = R(j), down, R(i) + along
    for y in range(whole(begin), whole(end)):
        dx, dy, dz = direction_in(dome, block[_DX + y], block[_DY + y], block[_DZ + y])
        block[_DX + y], block[_DY + y], block[_DZ + y] = dx, dy, dz


@njit(**INLINE)
def _cone(ax, ay, az, one_minus_cos, u0, u1):
    """A direction in the cone around the unit axis a, uniform by solid angle."""
    down = u0 * one_minus_cos
    sine = math.sqrt(max(down * (R(2) - down), R(0)))
    phi = R(2) * _PI * u1
    a, b, c = sine * cos(R, phi), sine * sin(R, phi), R(1) - down
    sign = R(1) if az >= R(0) else R(-1)
    k = R(-1) / (sign + az)
    m = ax * ay * k
    x = a * (R(1) + sign * ax * ax * k) + b * m + c * ax
    y = a * sign * m + b * (sign + ay * ay * k) + c * ay
    return x, y, -a * sign * ax - b * ay + c * az


@njit(**PART)
def _sample_distant(light, begin, end, block):
    zx, zy, zz = light[Z], light[Z + 1], light[Z + 2]
    chance, wide = light[CHANCE], light[AREA]
    if wide <= R(0):
        for y in range(whole(begin), whole(end)):
            _keep(block, y, zx, zy, zz, FAR, -chance)
        return
    pdf = chance / (R(2) * _PI * wide)
    for y in range(whole(begin), whole(end)):
        dx, dy, dz = _cone(zx, zy, zz, wide, block[_U0 + y], block[_U1 + y])
        _keep(block, y, dx, dy, dz, FAR, pdf)


@njit(**PART)
def _sample_sphere(light, begin, end, block):
    cx, cy, cz = light[P], light[P + 1], light[P + 2]
    chance, radius2 = light[CHANCE], light[SIZE] * light[SIZE]
    for y in range(whole(begin), whole(end)):
        ax, ay, az = cx - block[_PX + y], cy - block[_PY + y], cz - block[_PZ + y]
        square = ax * ax + ay * ay + az * az
        outside = square > radius2
        square = max(square, radius2)
        distance = math.sqrt(square)
        inverse = R(1) / distance
        ax, ay, az = ax * inverse, ay * inverse, az * inverse
        sine2 = radius2 / square
        wide = sine2 / (R(1) + math.sqrt(max(R(1) - sine2, R(0))))
        dx, dy, dz = _cone(ax, ay, az, wide, block[_U0 + y], block[_U1 + y])
        along = (dx * ax + dy * ay + dz * az) * distance
        reach = along - math.sqrt(max(radius2 - square + along * along, R(0)))
        pdf = chance / (R(2) * _PI * wide)
        _keep(block, y, dx, dy, dz, reach, pdf if outside else R(0))


@njit(**INLINE)
def _keep_point(light, block, y, qx, qy, qz, nx, ny, nz):
    """Towards the point q of the light, where its normal is n."""
    dx, dy, dz = qx - block[_PX + y], qy - block[_PY + y], qz - block[_PZ + y]
    square = max(dx * dx + dy * dy + dz * dz, R(1e-20))
    distance = math.sqrt(square)
    inverse = R(1) / distance
    dx, dy, dz = dx * inverse, dy * inverse, dz * inverse
    cosine = -(dx * nx + dy * ny + dz * nz)
    pdf = light[CHANCE] * square / (max(cosine, R(1e-6)) * light[AREA])
    _keep(block, y, dx, dy, dz, distance, pdf if cosine > R(1e-6) else R(0))


@njit(**INLINE)
def _keep_flat(light, block, y, a, b):
    """Towards the point of a flat light at a of its x and b of its y axis."""
    _keep_point(
        light, block, y,
        light[P] + a * light[X] + b * light[Y],
        light[P + 1] + a * light[X + 1] + b * light[Y + 1],
        light[P + 2] + a * light[X + 2] + b * light[Y + 2],
        light[Z], light[Z + 1], light[Z + 2],
    )  # fmt: skip


@njit(**PART)
def _sample_rect(light, begin, end, block):
    for y in range(whole(begin), whole(end)):
        a, b = R(2) * block[_U0 + y] - R(1), R(2) * block[_U1 + y] - R(1)
        _keep_flat(light, block, y, a, b)


@njit(**PART)
def _sample_disk(light, begin, end, block):
    for y in range(whole(begin), whole(end)):
        r, phi = math.sqrt(block[_U0 + y]), R(2) * _PI * block[_U1 + y]
        _keep_flat(light, block, y, r * cos(R, phi), r * sin(R, phi))


@njit(**PART)
def _sample_cylinder(light, begin, end, block):
    r = light[SIZE]
    for y in range(whole(begin), whole(end)):
        a, phi = R(2) * block[_U0 + y] - R(1), R(2) * _PI * block[_U1 + y]
        c, s = cos(R, phi), sin(R, phi)
        nx = c * light[Y] + s * light[Z]
        ny = c * light[Y + 1] + s * light[Z + 1]
        nz = c * light[Y + 2] + s * light[Z + 2]
        _keep_point(
            light, block, y,
            light[P] + a * light[X] + r * nx,
            light[P + 1] + a * light[X + 1] + r * ny,
            light[P + 2] + a * light[X + 2] + r * nz,
            nx, ny, nz,
        )  # fmt: skip
