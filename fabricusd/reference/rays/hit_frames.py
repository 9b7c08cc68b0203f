"""Preparing blocks of hits: positions, surface frames, origins of new rays and random numbers.

The loops run over hits, and LLVM vectorises them. All rows lie in one array at distances that are
known to the compiler, so the compiler need not check them for overlap.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.kernels.real import INLINE, PART
from fabricusd.reference.rays.sobol import four_numbers
from fabricusd.reference.rays.triangles import D1, D2, E1, E2, HAND, P0, RATE, RECORD, ST
from fabricusd.reference.rays.triangles import N as NORMALS
from fabricusd.reference.rays.triangles import T as TANGENTS
from fabricusd.reference.rays.wave import BACK, BLOCK, FOOTPRINT, FRONT, PLACE, SIDE, WO, N, U, V

R = np.float32

TAKEN, RAY = 0, RECORD * BLOCK
"""Where the rows of the triangle's record start, and those of the ray: its direction and the hit's
barycentric coordinates."""

MADE = (RECORD + 5) * BLOCK
"""Where the computed rows start: those of `Hits.rows` from FRONT to SIDE, in their order."""

NUMBERS = MADE + (SIDE + 1) * BLOCK
"""Where the eight rows of random numbers start."""

CHOSEN = NUMBERS + 8 * BLOCK
"""Where the rows of the chosen light start: those of `Hits.rows` from WI to LIGHT_PDF, in their
order."""

BLOCK_ROWS = RECORD + 5 + SIDE + 1 + 8 + 11


@njit(**PART)
def make_numbers(numbers, count, place, counters, block):
    """Write eight uniform numbers per hit, selected by its path's pixel and sample.

    The first two dimensions of a set of four are the best stratified pair. They are stored as the
    set's second and third numbers, which choose a point or direction; the stored first number
    chooses among lobes or lights.
    """
    for x in range(count):
        a, b, c, d = four_numbers(numbers, counters[x], counters[BLOCK + x], place)
        block[NUMBERS + x], block[NUMBERS + BLOCK + x] = c, a
        block[NUMBERS + 2 * BLOCK + x], block[NUMBERS + 3 * BLOCK + x] = b, d
    following = np.uint32(place + np.uint32(1))
    for x in range(count):
        a, b, c, d = four_numbers(numbers, counters[x], counters[BLOCK + x], following)
        block[NUMBERS + 4 * BLOCK + x], block[NUMBERS + 5 * BLOCK + x] = c, a
        block[NUMBERS + 6 * BLOCK + x], block[NUMBERS + 7 * BLOCK + x] = b, d


# Takes one index instead of a row and a column: numba recompiles a function for every constant.
@njit(**INLINE)
def _taken(block, at):
    """Three consecutive numbers of the triangle's record."""
    return block[at], block[at + BLOCK], block[at + 2 * BLOCK]


@njit(**INLINE)
def _make(block, at, a, b, c):
    block[at], block[at + BLOCK], block[at + 2 * BLOCK] = a, b, c


@njit(**PART)
def make_frames(count, epsilon, block):
    """Compute rows FRONT to SIDE of `count` hits; on input, FOOTPRINT is the cone's width [m]."""
    for x in range(count):
        dx, dy, dz = block[RAY + x], block[RAY + BLOCK + x], block[RAY + 2 * BLOCK + x]
        u, v = block[RAY + 3 * BLOCK + x], block[RAY + 4 * BLOCK + x]
        w = R(1) - u - v
        ax, ay, az = _taken(block, TAKEN + E1 * BLOCK + x)
        bx, by, bz = _taken(block, TAKEN + E2 * BLOCK + x)
        # The hit relative to the first corner; the offsets of the corners below are exact.
        rx, ry, rz = u * ax + v * bx, u * ay + v * by, u * az + v * bz
        px, py, pz = _taken(block, TAKEN + P0 * BLOCK + x)
        px, py, pz = px + rx, py + ry, pz + rz
        gx, gy, gz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        inverse = R(1) / math.sqrt(max(gx * gx + gy * gy + gz * gz, R(1e-38)))
        gx, gy, gz = gx * inverse, gy * inverse, gz * inverse
        side = R(1) if gx * dx + gy * dy + gz * dz <= R(0) else R(-1)
        n0x, n0y, n0z = _taken(block, TAKEN + NORMALS * BLOCK + x)
        n1x, n1y, n1z = _taken(block, TAKEN + (NORMALS + 3) * BLOCK + x)
        n2x, n2y, n2z = _taken(block, TAKEN + (NORMALS + 6) * BLOCK + x)
        # [Hanika2021] Lift the point to the tangent planes of the corners, so that the shadow
        # terminator does not show the triangles. Each side of the cloth has its own lift.
        e0 = side * (rx * n0x + ry * n0y + rz * n0z)
        e1 = side * ((rx - ax) * n1x + (ry - ay) * n1y + (rz - az) * n1z)
        e2 = side * ((rx - bx) * n2x + (ry - by) * n2y + (rz - bz) * n2z)
        # Offset the point along the true normal by as much as rounding may move it.
        offset = side * (epsilon + R(1e-6) * max(abs(px), max(abs(py), abs(pz))))
        a, b, c = w * side * min(e0, R(0)), u * side * min(e1, R(0)), v * side * min(e2, R(0))
        _make(block, MADE + FRONT * BLOCK + x,
            px - a * n0x - b * n1x - c * n2x + offset * gx,
            py - a * n0y - b * n1y - c * n2y + offset * gy,
            pz - a * n0z - b * n1z - c * n2z + offset * gz,
        )  # fmt: skip
        a, b, c = w * side * max(e0, R(0)), u * side * max(e1, R(0)), v * side * max(e2, R(0))
        _make(block, MADE + BACK * BLOCK + x,
            px - a * n0x - b * n1x - c * n2x - offset * gx,
            py - a * n0y - b * n1y - c * n2y - offset * gy,
            pz - a * n0z - b * n1z - c * n2z - offset * gz,
        )  # fmt: skip
        nx, ny = w * n0x + u * n1x + v * n2x, w * n0y + u * n1y + v * n2y
        nz = w * n0z + u * n1z + v * n2z
        inverse = side / math.sqrt(max(nx * nx + ny * ny + nz * nz, R(1e-38)))
        nx, ny, nz = nx * inverse, ny * inverse, nz * inverse
        # Whether the smooth normal faces away from the viewer although the triangle does not.
        away = nx * dx + ny * dy + nz * dz >= R(-1e-4)
        nx, ny = (side * gx if away else nx), (side * gy if away else ny)
        nz = side * gz if away else nz
        t0x, t0y, t0z = _taken(block, TAKEN + TANGENTS * BLOCK + x)
        t1x, t1y, t1z = _taken(block, TAKEN + (TANGENTS + 3) * BLOCK + x)
        t2x, t2y, t2z = _taken(block, TAKEN + (TANGENTS + 6) * BLOCK + x)
        tx, ty = w * t0x + u * t1x + v * t2x, w * t0y + u * t1y + v * t2y
        tz = w * t0z + u * t1z + v * t2z
        d = tx * nx + ty * ny + tz * nz
        tx, ty, tz = tx - d * nx, ty - d * ny, tz - d * nz
        # Without a grain, use any direction perpendicular to the normal.
        none = tx * tx + ty * ty + tz * tz < R(1e-12)
        steep = abs(nx) >= R(0.7)
        sx, sy, sz = (-nz if steep else R(0)), (R(0) if steep else nz), (nx if steep else -ny)
        tx, ty, tz = (sx if none else tx), (sy if none else ty), (sz if none else tz)
        inverse = R(1) / math.sqrt(tx * tx + ty * ty + tz * tz)
        tx, ty, tz = tx * inverse, ty * inverse, tz * inverse
        hand = block[TAKEN + HAND * BLOCK + x]
        vx, vy = hand * (ny * tz - nz * ty), hand * (nz * tx - nx * tz)
        vz = hand * (nx * ty - ny * tx)
        _make(block, MADE + N * BLOCK + x, nx, ny, nz)
        _make(block, MADE + U * BLOCK + x, tx, ty, tz)
        _make(block, MADE + V * BLOCK + x, vx, vy, vz)
        _make(
            block, MADE + WO * BLOCK + x, -(dx * tx + dy * ty + dz * tz),
            -(dx * vx + dy * vy + dz * vz), -(dx * nx + dy * ny + dz * nz),
        )  # fmt: skip
        block[MADE + SIDE * BLOCK + x] = side
        at = TAKEN + x
        block[MADE + PLACE * BLOCK + x] = (
            block[at + ST * BLOCK] + u * block[at + D1 * BLOCK] + v * block[at + D2 * BLOCK]
        )
        at += BLOCK
        block[MADE + (PLACE + 1) * BLOCK + x] = (
            block[at + ST * BLOCK] + u * block[at + D1 * BLOCK] + v * block[at + D2 * BLOCK]
        )
        block[MADE + FOOTPRINT * BLOCK + x] *= block[TAKEN + RATE * BLOCK + x]
