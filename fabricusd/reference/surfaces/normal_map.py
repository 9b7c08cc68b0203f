"""Normal mapping: turns the frame in which a hit is shaded as a normal map's texel says.

A texel is a normal in tangent space: x along increasing u of the *picture*, y along its increasing
v, z along the surface's normal. The tangent is the mesh's direction of increasing u, the bitangent
is `handedness * cross(normal, tangent)`, and both are perpendicular to the normal [Mikkelsen2008].

Light from below the unmapped surface contributes nothing, whatever the map says, and paths that
would go there end. No light leaks through, and no path is reflected twice at one point.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.kernels.real import INLINE, LEAN, whole
from fabricusd.reference.rays.wave import (
    F_PDF,
    GO,
    GO_PDF,
    MATERIAL,
    PLACE,
    SIDE,
    WEIGHT,
    WI,
    WO,
    F,
    N,
    U,
    V,
)
from fabricusd.reference.surfaces.preview import NORMAL_MAP, Surfaces, shade_preview, texture_at

R = np.float32

Floats = NDArray[np.float32]
Integers = NDArray[np.int32]

LEAST_FACING = R(0.01)
"""Smallest cosine between a mapped normal and the direction to the viewer. A normal that a map
turns further away would make the surface black from the front, or lit from behind."""


@njit(**INLINE)
def mapped_frame(x, y, z, side, ox, oy, oz):
    """(tx, ty, tz, bx, by, bz, nx, ny, nz): tangent, bitangent and normal in the hit's own frame.

    x, y, z - the texel, of any length; a texel of length 0 leaves the normal unchanged
    side - 1 on the front and -1 on the back, whose frame is (U, -V, -N) of the front's: seen from
        behind, a bump is a dent, so its normal is minus the front's
    ox, oy, oz - the direction to the viewer, oz > 0

    A normal that is turned away from the viewer is bent towards the viewer until its cosine is
    LEAST_FACING, or the cosine of the unmapped surface if that is smaller.
    """
    square = x * x + y * y + z * z
    inverse = R(1) / math.sqrt(max(square, R(1e-12)))
    none = square < R(1e-12)
    x, y = (R(0) if none else side * x * inverse), (R(0) if none else y * inverse)
    z = R(1) if none else z * inverse
    missing = max(min(LEAST_FACING, oz) - (x * ox + y * oy + z * oz), R(0))
    x, y, z = x + missing * ox, y + missing * oy, z + missing * oz
    inverse = R(1) / math.sqrt(x * x + y * y + z * z)
    x, y, z = x * inverse, y * inverse, z * inverse
    # Make the first axis perpendicular to the normal, or the second if the normal lies along the
    # first.
    first = abs(x) < R(0.999)
    d = x if first else y
    tx, ty, tz = (R(1) if first else R(0)) - d * x, (R(0) if first else R(1)) - d * y, -d * z
    inverse = R(1) / math.sqrt(tx * tx + ty * ty + tz * tz)
    tx, ty, tz = tx * inverse, ty * inverse, tz * inverse
    return tx, ty, tz, y * tz - z * ty, z * tx - x * tz, x * ty - y * tx, x, y, z


def shade_mapped(surfaces: Surfaces, hits: Floats, tags: Integers, first: int, last: int) -> None:
    """`shade_preview` of a surface with a normal map, which also turns rows N, U, V, WO and WI."""
    own = np.empty((3, last - first), np.float32)
    turn_frames(surfaces, hits, tags, first, last, own)
    shade_preview(surfaces, hits, tags, first, last)
    end_below(hits, first, last, own)


@njit(**INLINE)
def _dot(hits, row, h, x, y, z):
    return hits[row, h] * x + hits[row + 1, h] * y + hits[row + 2, h] * z


@njit(**LEAN)
def turn_frames(surfaces, hits, tags, first, last, own):
    """Turn the frames of hits `first` to before `last`, and the directions given in these frames.

    own : (3, last - first) float32 - filled with the unmapped normals in the turned frames
    """
    first, last = whole(first), whole(last)
    index = int(surfaces.table[tags[MATERIAL, first], NORMAL_MAP])
    for h in range(first, last):
        a, b, c = texture_at(surfaces, index, hits[PLACE, h], hits[PLACE + 1, h])
        tx, ty, tz, bx, by, bz, nx, ny, nz = mapped_frame(
            a, b, c, hits[SIDE, h], hits[WO, h], hits[WO + 1, h], hits[WO + 2, h]
        )
        own[0, h - first], own[1, h - first], own[2, h - first] = tz, bz, nz
        for row in (WO, WI):
            along, across = _dot(hits, row, h, tx, ty, tz), _dot(hits, row, h, bx, by, bz)
            hits[row + 2, h] = _dot(hits, row, h, nx, ny, nz)
            hits[row, h], hits[row + 1, h] = along, across
        for k in range(3):
            u, v, n = hits[U + k, h], hits[V + k, h], hits[N + k, h]
            hits[U + k, h] = tx * u + ty * v + tz * n
            hits[V + k, h] = bx * u + by * v + bz * n
            hits[N + k, h] = nx * u + ny * v + nz * n


@njit(**LEAN)
def end_below(hits, first, last, own):
    """Drop light that the unmapped surface has on the other side than the mapped one, and end the
    paths that would go there.

    own : (3, last - first) float32 - as filled by `turn_frames`
    """
    first, last = whole(first), whole(last)
    for h in range(first, last):
        x, y, z = own[0, h - first], own[1, h - first], own[2, h - first]
        lit = R(1) if (_dot(hits, WI, h, x, y, z) > R(0)) == (hits[WI + 2, h] > R(0)) else R(0)
        out = R(1) if (_dot(hits, GO, h, x, y, z) > R(0)) == (hits[GO + 2, h] > R(0)) else R(0)
        for k in range(3):
            hits[F + k, h] *= lit
            hits[WEIGHT + k, h] *= out
        hits[F_PDF, h] *= lit
        pdf = hits[GO_PDF, h]
        hits[GO_PDF, h] = pdf if pdf < R(0) else out * pdf
