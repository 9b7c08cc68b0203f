"""The block of rays that `meet` of a light's kind works on, and functions that kinds share.

Lights do not block rays: a ray goes on behind a light, so it sees the sum of all lights that it
passes before its first triangle.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.kernels.real import INLINE
from fabricusd.reference.lights.row import AREA, CHANCE, RED, VISIBLE, P, X, Y, Z
from fabricusd.reference.rays.wave import BLOCK

R = np.float32

# Rows of a block of rays: origin and direction, distance to the first triangle, pdf of the
# direction (negative if light sampling does not compete with it), 1 for a ray from the camera and 0
# for others, the radiance that the ray sees, and scratch.
(O_X, O_Y, O_Z, D_X, D_Y, D_Z, REACH, BEFORE, FIRST, SEEN_R, SEEN_G, SEEN_B, COLUMN, ROW) = (
    row * BLOCK for row in range(14)
)
LIGHT_ROWS = 14


@njit(**INLINE)
def weight_of(block, x, pdf):
    """Power heuristic [Veach1997] of a ray's direction, which light sampling finds with `pdf`."""
    before = block[BEFORE + x]
    ratio = pdf / max(before, R(1e-30))
    return R(1) / (R(1) + ratio * ratio) if before > R(0) else R(1)


@njit(**INLINE)
def add(light, block, x, pdf):
    """Add a light of constant radiance, unless its pdf is 0 or the camera does not see it."""
    hidden = block[FIRST + x] > light[VISIBLE]
    weight = R(0) if hidden or pdf <= R(0) else weight_of(block, x, pdf)
    block[SEEN_R + x] += weight * light[RED]
    block[SEEN_G + x] += weight * light[RED + 1]
    block[SEEN_B + x] += weight * light[RED + 2]


@njit(**INLINE)
def towards(light, block, x):
    """The vector from the ray's origin to the light's position."""
    return light[P] - block[O_X + x], light[P + 1] - block[O_Y + x], light[P + 2] - block[O_Z + x]


@njit(**INLINE)
def add_area(light, block, x, met, t, cosine):
    """Add an area light at distance t; `cosine` is that of its normal with the reversed ray."""
    seen = met and t > R(0) and t < block[REACH + x] and cosine > R(1e-6)
    pdf = light[CHANCE] * t * t / (max(cosine, R(1e-6)) * light[AREA])
    add(light, block, x, pdf if seen else R(0))


@njit(**INLINE)
def meet_flat(light, disk, size, block):
    """Add a flat light: an ellipse if `disk`, else a parallelogram."""
    zx, zy, zz = light[Z], light[Z + 1], light[Z + 2]
    xx, xy, xz = light[X], light[X + 1], light[X + 2]
    yx, yy, yz = light[Y], light[Y + 1], light[Y + 2]
    per_x = R(1) / (xx * xx + xy * xy + xz * xz)
    per_y = R(1) / (yx * yx + yy * yy + yz * yz)
    for x in range(size):
        ax, ay, az = towards(light, block, x)
        dx, dy, dz = block[D_X + x], block[D_Y + x], block[D_Z + x]
        cosine = -(dx * zx + dy * zy + dz * zz)
        t = -(ax * zx + ay * zy + az * zz) / max(cosine, R(1e-6))
        qx, qy, qz = t * dx - ax, t * dy - ay, t * dz - az
        a = (qx * xx + qy * xy + qz * xz) * per_x
        b = (qx * yx + qy * yy + qz * yz) * per_y
        met = a * a + b * b <= R(1) if disk else max(abs(a), abs(b)) <= R(1)
        add_area(light, block, x, met, t, cosine)
