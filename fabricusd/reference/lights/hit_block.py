"""The block of hits that light samplers read and fill, and functions that kinds share to fill it.

A sampler is given the hits from `begin` to before `end` of a block. It reads two uniform numbers
and the position of each hit, and stores the direction to the light, the distance, and the pdf of
the direction per solid angle, which includes the chance of choosing the light. The pdf is 0 if the
light does not shine on the hit, and *minus* the chance for a light without extent, which no ray can
hit.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.kernels.real import INLINE, cos, sin
from fabricusd.reference.lights.row import AREA, CHANCE, P, X, Y, Z
from fabricusd.reference.rays.hit_frames import CHOSEN, MADE, NUMBERS
from fabricusd.reference.rays.wave import BLOCK, FRONT

R = np.float32
_PI = R(math.pi)

# Rows from CHOSEN on, in the order of the rows of `Hits.rows` from WI on.
WI, TO, DISTANCE, LIGHT, PDF = (CHOSEN + row * BLOCK for row in (0, 3, 6, 7, 10))

DX, DY, DZ = (TO + row * BLOCK for row in range(3))
LIGHT_R, LIGHT_G, LIGHT_B = (LIGHT + row * BLOCK for row in range(3))
PX, PY, PZ = (MADE + (FRONT + row) * BLOCK for row in range(3))
U0, U1 = NUMBERS + 5 * BLOCK, NUMBERS + 6 * BLOCK


@njit(**INLINE)
def keep(block, y, dx, dy, dz, distance, pdf):
    """Store a direction, the distance to the light along it, and its pdf."""
    block[DX + y], block[DY + y], block[DZ + y] = dx, dy, dz
    block[DISTANCE + y], block[PDF + y] = distance, pdf


@njit(**INLINE)
def in_cone(ax, ay, az, one_minus_cos, u0, u1):
    """Sample a direction in the cone around the unit axis a, uniform by solid angle."""
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


@njit(**INLINE)
def keep_point(light, block, y, qx, qy, qz, nx, ny, nz):
    """Store the direction towards the point q on the light, where the light's normal is n."""
    dx, dy, dz = qx - block[PX + y], qy - block[PY + y], qz - block[PZ + y]
    square = max(dx * dx + dy * dy + dz * dz, R(1e-20))
    distance = math.sqrt(square)
    inverse = R(1) / distance
    dx, dy, dz = dx * inverse, dy * inverse, dz * inverse
    cosine = -(dx * nx + dy * ny + dz * nz)
    pdf = light[CHANCE] * square / (max(cosine, R(1e-6)) * light[AREA])
    keep(block, y, dx, dy, dz, distance, pdf if cosine > R(1e-6) else R(0))


@njit(**INLINE)
def keep_flat(light, block, y, a, b):
    """Store the direction towards the point of a flat light at a along its x and b along its y."""
    keep_point(
        light, block, y,
        light[P] + a * light[X] + b * light[Y],
        light[P + 1] + a * light[X + 1] + b * light[Y + 1],
        light[P + 2] + a * light[X + 2] + b * light[Y + 2],
        light[Z], light[Z + 1], light[Z + 2],
    )  # fmt: skip
