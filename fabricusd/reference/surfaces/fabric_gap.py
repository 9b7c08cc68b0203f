"""The light that passes between the threads of cloth whose gap has a direction: `conserving` cloth,
and published cloth under a law that says so.

For a path, the shader decides at the hit: by the repeat's gap(w) at level `far`, by the place at
levels `weave` and `thread` (`appearance.conserving.levels.passing`). A shadow ray has no level and
is thinned by gap(w). Both have the same mean, in the frame of the smooth normal.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance import laws
from fabricusd.appearance.conserving.facets import WOVEN_TABLE
from fabricusd.appearance.conserving.grid import entry_angles, share_at
from fabricusd.appearance.conserving.levels import gap_towards, passing
from fabricusd.appearance.law import PUBLISHED_ONLY, SurfaceLaw
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.kernels.real import LEAN, PART
from fabricusd.reference.rays.triangles import N as NORMALS
from fabricusd.reference.rays.triangles import T as TANGENTS

R = np.float32

TABLE = WOVEN_TABLE[:2]
"""Shape of every table of gap(w)."""

OPEN = 1e-4
"""Cloth of which less passes than this, from everywhere, lets no light straight through."""

BY_DIRECTION = -2.0
"""The opacity of a material whose gap has a direction."""


def gap_table(law: SurfaceLaw, opaque: bool) -> NDArray[np.float32] | None:
    """TABLE of the share that passes cloth of this law; None where it is the same from all
    directions."""
    if opaque:
        return None
    gap = law.conserving.gap
    if law.kind == PUBLISHED_ONLY:
        if not laws.gaps_close(law.published):
            return None
        gap = np.empty(TABLE, np.float32)
        polar, azimuth = (x.ravel() for x in entry_angles(*TABLE))
        towards = np.stack(
            (np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar))
        )
        pass_published(R, law.published, R(1), towards.astype(np.float32), gap.reshape(-1))
    if gap.shape != TABLE or gap.max() < OPEN:
        return None
    return np.ascontiguousarray(gap, np.float32)


@njit(**LEAN)
def pass_published(R, tables, is_open, wo, out):
    """`pass_far` of published cloth."""
    for k in range(out.size):
        out[k] = is_open * laws.openness(R, tables, wo[0, k], wo[1, k], wo[2, k])


@njit(**LEAN)
def pass_gaps(R, tables, is_open, sets, wo, out):
    """Write the probability with which each viewer's ray passes its place of published cloth.

    What gaps seen from above do not let through passes all threads alike, as in `passing`.
    """
    for k in range(out.size):
        share = laws.openness(R, tables, wo[0, k], wo[1, k], wo[2, k])
        if sets[k] == GAP:
            out[k] = is_open * min(R(1), share / tables.gap) if tables.gap > R(0) else R(0)
        else:
            out[k] = is_open * max(R(0), share - tables.gap) / (R(1) - tables.gap)


@njit(**LEAN)
def pass_far(R, tables, open_cloth, wo, out):
    """Write the share of each viewer's light that passes the whole repeat: wo (3, n), out (n,)."""
    for k in range(out.size):
        out[k] = open_cloth * gap_towards(R, tables, wo[0, k], wo[1, k], wo[2, k])


@njit(**LEAN)
def pass_places(R, tables, open_cloth, sets, wo, out):
    """Write the probability with which each viewer's ray passes its place: sets, out (n,)."""
    for k in range(out.size):
        share = passing(R, tables, sets[k] == GAP, wo[0, k], wo[1, k], wo[2, k])
        out[k] = open_cloth * share


@njit(**PART)
def gap_along(gap, record, u, v, dx, dy, dz):
    """The share of a ray's light that passes cloth at a hit of a triangle.

    gap : TABLE of the cloth; record : of the triangle; u, v : barycentric coordinates of the hit
    """
    w = R(1) - u - v
    a, b, c = NORMALS, NORMALS + 3, NORMALS + 6
    nx = w * record[a] + u * record[b] + v * record[c]
    ny = w * record[a + 1] + u * record[b + 1] + v * record[c + 1]
    nz = w * record[a + 2] + u * record[b + 2] + v * record[c + 2]
    inverse = R(1) / math.sqrt(max(nx * nx + ny * ny + nz * nz, R(1e-38)))
    up = (dx * nx + dy * ny + dz * nz) * inverse
    a, b, c = TANGENTS, TANGENTS + 3, TANGENTS + 6
    tx = w * record[a] + u * record[b] + v * record[c]
    ty = w * record[a + 1] + u * record[b + 1] + v * record[c + 1]
    tz = w * record[a + 2] + u * record[b + 2] + v * record[c + 2]
    d = (tx * nx + ty * ny + tz * nz) * inverse * inverse
    tx, ty, tz = tx - d * nx, ty - d * ny, tz - d * nz
    inverse = R(1) / math.sqrt(max(tx * tx + ty * ty + tz * tz, R(1e-38)))
    x = (dx * tx + dy * ty + dz * tz) * inverse
    # The gap is the same at an azimuth and its mirror image in V.
    y = math.sqrt(max(R(0), R(1) - up * up - x * x))
    return min(R(1), share_at(R, gap, x, y, min(R(1), abs(up))))
