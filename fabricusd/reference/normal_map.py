"""Normal maps: from a texel to the frame that a hit is shaded in.

A texel is a normal in tangent space: x along growing u of the *picture*, y along its growing v, z
along the surface's normal. The tangent is the mesh's direction of growing u, the bitangent
`handedness * cross(normal, tangent)`, both perpendicular to the normal [Mikkelsen2008].
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.real import INLINE

R = np.float32

LEAST_FACING = R(0.01)
"""Least cosine between a mapped normal and the direction to the viewer. What a map turns further
away would be black from the front, and lit from behind."""


def along_the_mesh(pixels: NDArray[np.float32], place: tuple[float, ...]) -> NDArray[np.float32]:
    """(h, w, 3) normals along the picture's axes -> along the mesh's u and v.

    place : `Texture.place`. Where it turns or mirrors the picture, the relief turns with it. A
    place that squeezes the picture to a line leaves the normals as they are.
    """
    a, b, _, d, e, _ = place
    mirrored = math.copysign(1.0, a * e - b * d)
    # The direction of growing picture u in (u, v): the first column of the inverse.
    along, up = e * mirrored, -d * mirrored
    length = math.hypot(along, up)
    if a * e - b * d == 0 or length == 0 or (up == 0 and along > 0 and mirrored > 0):
        return pixels
    along, up = along / length, up / length
    x, y, z = np.moveaxis(pixels, -1, 0)
    return np.stack([along * x - mirrored * up * y, up * x + mirrored * along * y, z], axis=-1)


@njit(**INLINE)
def mapped_frame(x, y, z, side, ox, oy, oz):
    """(tx, ty, tz, bx, by, bz, nx, ny, nz): tangent, bitangent and normal in the hit's own frame.

    x, y, z - the texel, of any length; none where it is 0
    side - 1 on the front and -1 on the back, whose frame is (U, -V, -N) of the front's: seen from
        behind, a bump is a dent, so its normal is minus the front's
    ox, oy, oz - the direction to the viewer, oz > 0

    A normal that is turned away from the viewer is bent towards him until its cosine is
    LEAST_FACING, or that of the surface where it is less.
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
    # The first axis made perpendicular to the normal, or the second where the normal lies along it.
    first = abs(x) < R(0.999)
    d = x if first else y
    tx, ty, tz = (R(1) if first else R(0)) - d * x, (R(0) if first else R(1)) - d * y, -d * z
    inverse = R(1) / math.sqrt(tx * tx + ty * ty + tz * tz)
    tx, ty, tz = tx * inverse, ty * inverse, tz * inverse
    return tx, ty, tz, y * tz - z * ty, z * tx - x * tz, x * ty - y * tx, x, y, z
