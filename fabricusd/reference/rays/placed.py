"""Instances in the ray tracer: one Embree scene for each group of meshes that stand together, an
array of transforms that places it, and the triangles that were hit as they lie in the world.

After a trace, `to_world` writes the record of each hit triangle, carried to where its instance
stands, to a buffer of the batch, and makes PRIMITIVE the hit's place in that buffer. All later
stages therefore work on hits of instances as on those of any other triangle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.calls import Calls
from fabricusd.kernels.real import INLINE, LEAN, whole
from fabricusd.reference.rays.embree import (
    GEOMETRY,
    HIT_U,
    HIT_V,
    INSTANCE,
    INSTANCE_PRIMITIVE,
    MISS,
    NGX,
    PRIMITIVE,
    aligned_empty,
)
from fabricusd.reference.rays.triangles import (
    D1,
    D2,
    E1,
    E2,
    HAND,
    P0,
    RATE,
    RECORD,
    ST,
    Triangles,
    TriangleTables,
)
from fabricusd.reference.rays.triangles import N as NORMALS
from fabricusd.reference.rays.triangles import T as TANGENTS
from fabricusd.reference.rays.wave import Wave

R = np.float32


class Carried(NamedTuple):
    """What is known of triangles: all of a scene, or those that the rays of a batch hit.

    records : (m, RECORD) float32; material : (m,) int32; home : (m, 2) int64, or (0, 2) where no
    fabric has uneven threads; uv : (m, 6) float32, or (0, 6) where no layer shows them
    """

    records: NDArray[np.float32]
    material: NDArray[np.int32]
    home: NDArray[np.int64]
    uv: NDArray[np.float32]


class Carrier:
    """Gives the stages of a batch the triangles that its rays hit."""

    def __init__(self, tables: TriangleTables, begins: NDArray[np.int64]) -> None:
        self._tables, self._begins, self._call = tables, begins, Calls()
        self._places = tables.placements.reshape(-1, 12)
        self._every = Triangles(tables.records, tables.material)

    def triangles(self, wave: Wave) -> tuple[Triangles, NDArray[np.float32]]:
        """The triangles, and their UVs, that PRIMITIVE numbers after `carry`."""
        if not self._tables.groups:
            return self._every, self._tables.uv
        if wave.carried is None:
            wave.carried = _room_for(wave.capacity, self._source(wave))
        return Triangles(wave.carried.records, wave.carried.material), wave.carried.uv

    def carry(self, wave: Wave, rays: NDArray[np.float32], count: int) -> None:
        """Bring the triangles that the first `count` rays hit to where their instances stand."""
        if self._tables.groups:
            source = self._source(wave)
            self._call(to_world, count, rays, self._begins, self._places, source, wave.carried)

    def _source(self, wave: Wave) -> Carried:
        tables = self._tables
        uv = tables.uv if wave.aovs else np.zeros((0, 6), np.float32)
        return Carried(tables.records, tables.material, tables.home, uv)


def _room_for(capacity: int, source: Carried) -> Carried:
    """A buffer for the triangles that `capacity` rays hit."""
    return Carried(
        aligned_empty((capacity, RECORD)),
        aligned_empty((capacity,), np.int32),
        np.zeros((capacity if len(source.home) else 0, 2), np.int64),
        np.zeros((capacity if len(source.uv) else 0, 6), np.float32),
    )


@njit(**LEAN)
def to_world(count, rays, begins, placements, source, into):
    """Write the triangles that rays hit to `into`, as they lie in the world, after `intersect`.

    Each ray's PRIMITIVE becomes its own number, the row of its triangle in `into`. Its normal,
    which Embree gives in the space of the instance, becomes that of the carried triangle.

    begins : (geometries, 2) int64 - the first triangle and the first placement of each geometry
    placements : (k, 12) float32 - rows of the transforms
    """
    bits = rays.view(np.uint32)
    records, material, home, uv = source
    to_records, to_material, to_home, to_uv = into
    for k in range(whole(count)):
        p, lane = k >> 4, k & 15
        if bits[p, GEOMETRY, lane] == MISS:
            continue
        number = bits[p, INSTANCE, lane]
        triangle = whole(bits[p, PRIMITIVE, lane])
        record, mirrored = to_records[k], False
        if number == MISS:
            for column in range(RECORD):
                record[column] = records[triangle, column]
        else:
            triangle += begins[whole(number), 0]
            place = begins[whole(number), 1] + whole(bits[p, INSTANCE_PRIMITIVE, lane])
            mirrored = _carry(placements[place], records[triangle], record)
            x, y, z = _cross(record, E1, record, E2)
            rays[p, NGX, lane], rays[p, NGX + 1, lane], rays[p, NGX + 2, lane] = x, y, z
        if mirrored:
            u = rays[p, HIT_U, lane]
            rays[p, HIT_U, lane], rays[p, HIT_V, lane] = rays[p, HIT_V, lane], u
        to_material[k] = material[triangle]
        for axis in range(2 if home.shape[0] else 0):
            to_home[k, axis] = home[triangle, axis]
        for corner in range(3 if uv.shape[0] else 0):
            other = 3 - corner if mirrored and corner else corner
            to_uv[k, 2 * other] = uv[triangle, 2 * corner]
            to_uv[k, 2 * other + 1] = uv[triangle, 2 * corner + 1]
        bits[p, PRIMITIVE, lane] = k


@njit(**INLINE)
def _cross(a, i, b, j):
    """The cross product of three numbers of `a` from `i` on, and three of `b` from `j` on."""
    return (
        a[i + 1] * b[j + 2] - a[i + 2] * b[j + 1],
        a[i + 2] * b[j] - a[i] * b[j + 2],
        a[i] * b[j + 1] - a[i + 1] * b[j],
    )


@njit(**INLINE)
def _turned(m, x, y, z):
    """A vector under the linear part of a transform."""
    return (
        m[0] * x + m[1] * y + m[2] * z,
        m[4] * x + m[5] * y + m[6] * z,
        m[8] * x + m[9] * y + m[10] * z,
    )


@njit(**INLINE)
def _unit(x, y, z):
    inverse = R(1) / math.sqrt(max(x * x + y * y + z * z, R(1e-38)))
    return x * inverse, y * inverse, z * inverse


@njit(**INLINE)
def _carry(m, record, into):
    """Write a triangle's record under the transform `m`; return whether that mirrors it.

    A mirrored triangle exchanges its second and its third corner: it then winds about its front.
    """
    ax, ay, az = _cross(m, 4, m, 8)
    bx, by, bz = _cross(m, 8, m, 0)
    cx, cy, cz = _cross(m, 0, m, 4)
    mirrored = m[0] * ax + m[1] * ay + m[2] * az < R(0)
    sign = R(-1) if mirrored else R(1)
    x, y, z = _turned(m, record[P0], record[P0 + 1], record[P0 + 2])
    into[P0], into[P0 + 1], into[P0 + 2] = x + m[3], y + m[7], z + m[11]
    one, two = (E2, E1) if mirrored else (E1, E2)
    into[E1], into[E1 + 1], into[E1 + 2] = _turned(m, record[one], record[one + 1], record[one + 2])
    into[E2], into[E2 + 1], into[E2 + 2] = _turned(m, record[two], record[two + 1], record[two + 2])
    for corner in range(3):
        other = 3 - corner if mirrored and corner else corner
        at, to = NORMALS + 3 * corner, NORMALS + 3 * other
        x, y, z = record[at], record[at + 1], record[at + 2]
        # Normals transform by the inverse transpose, of which this is a multiple.
        nx, ny, nz = _unit(
            sign * (ax * x + ay * y + az * z),
            sign * (bx * x + by * y + bz * z),
            sign * (cx * x + cy * y + cz * z),
        )
        into[to], into[to + 1], into[to + 2] = nx, ny, nz
        at, to = TANGENTS + 3 * corner, TANGENTS + 3 * other
        x, y, z = _turned(m, record[at], record[at + 1], record[at + 2])
        flat = x * nx + y * ny + z * nz
        into[to], into[to + 1], into[to + 2] = _unit(x - flat * nx, y - flat * ny, z - flat * nz)
    one, two = (D2, D1) if mirrored else (D1, D2)
    for axis in range(2):
        into[ST + axis] = record[ST + axis]
        into[D1 + axis], into[D2 + axis] = record[one + axis], record[two + axis]
    into[HAND] = sign * record[HAND]
    _set_rate(into)
    return mirrored


@njit(**INLINE)
def _set_rate(record):
    """Write RATE of a record, as `triangles` does for all records of a mesh."""
    x, y, z = _cross(record, E1, record, E2)
    inverse = R(1) / max(x * x + y * y + z * z, R(1e-36))
    e, f = E1, E2
    alx = (record[f + 1] * z - record[f + 2] * y) * inverse
    aly = (record[f + 2] * x - record[f] * z) * inverse
    alz = (record[f] * y - record[f + 1] * x) * inverse
    upx = (y * record[e + 2] - z * record[e + 1]) * inverse
    upy = (z * record[e] - x * record[e + 2]) * inverse
    upz = (x * record[e + 1] - y * record[e]) * inverse
    for axis in range(2):
        d1, d2 = record[D1 + axis], record[D2 + axis]
        gx, gy, gz = d1 * alx + d2 * upx, d1 * aly + d2 * upy, d1 * alz + d2 * upz
        record[RATE + axis] = math.sqrt(gx * gx + gy * gy + gz * gz)
