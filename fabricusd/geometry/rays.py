"""Rays through cloth without end: traced in a patch of triangles, put back where they leave it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.geometry.cloth import Cloth
from fabricusd.kernels.real import INLINE, KERNEL
from fabricusd.reference.rays.embree import (
    DX,
    DY,
    DZ,
    GEOMETRY,
    HIT_U,
    HIT_V,
    LANES,
    MISS,
    NGX,
    NGY,
    NGZ,
    OX,
    OY,
    OZ,
    PRIMITIVE,
    TFAR,
    new_packets,
)

Floats = NDArray[np.float64]

NOTHING = -1
"""`Hits.primitive` of a ray that leaves the cloth."""

PATCHES = 4096
"""Patches that a ray crosses at most. One that is still inside lies in the cloth's plane to within
1e-4 and counts as leaving it."""


class Hits(NamedTuple):
    """primitive : (n,) int32 - triangle, NOTHING where the ray leaves; u, v : (n,) float32 - place
    on it; back : (n,) bool - whether it was hit from inside the tube."""

    primitive: NDArray[np.int32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    back: NDArray[np.bool_]

    def only(self, keep: NDArray[Any]) -> Hits:
        """Those that a mask or indices choose."""
        return Hits(self.primitive[keep], self.u[keep], self.v[keep], self.back[keep])


def nearest(cloth: Cloth, origin: Floats, direction: Floats) -> Hits:
    """What rays meet first.

    origin : (n, 3) float [m], between bottom and top of the patch; direction : (n, 3) unit vectors
    """
    n = len(origin)
    hits = Hits(
        np.full(n, NOTHING, np.int32),
        np.zeros(n, np.float32),
        np.zeros(n, np.float32),
        np.zeros(n, np.bool_),
    )
    place, live = origin.copy(), np.arange(n)
    packets = new_packets(n)
    for _ in range(PATCHES):
        if not len(live):
            break
        _fill(cloth.patch, packets, packets.view(np.uint32), live, place, direction)
        cloth.accelerator.intersect(packets, (len(live) + LANES - 1) // LANES)
        kept = _found(cloth.patch, packets, packets.view(np.uint32), live, place, direction, hits)
        live = live[:kept]
    return hits


def blocked(cloth: Cloth, origin: Floats, direction: Floats) -> NDArray[np.bool_]:
    """(n,) whether something lies in the rays' way; arguments as for `nearest`."""
    out = np.zeros(len(origin), np.bool_)
    place, live = origin.copy(), np.arange(len(origin))
    packets = new_packets(len(origin))
    for _ in range(PATCHES):
        if not len(live):
            break
        _fill(cloth.patch, packets, packets.view(np.uint32), live, place, direction)
        cloth.accelerator.occluded(packets, (len(live) + LANES - 1) // LANES)
        live = live[: _stopped(cloth.patch, packets, live, place, direction, out)]
    return out


@njit(**INLINE)
def _folded(x, size):
    """`x` moved by whole repeats into [0, size)."""
    return x - np.floor(x / size) * size


@njit(**KERNEL)
def _fill(patch, packets, whole, live, place, direction):
    """Write the live rays into the first packets, their places put back into the repeat."""
    for slot in range(live.size):
        k = live[slot]
        p, lane = slot // LANES, slot % LANES
        place[k, 0] = _folded(place[k, 0], patch.size[0])
        place[k, 1] = _folded(place[k, 1], patch.size[1])
        packets[p, OX, lane] = place[k, 0]
        packets[p, OY, lane] = place[k, 1]
        packets[p, OZ, lane] = place[k, 2]
        packets[p, DX, lane] = direction[k, 0]
        packets[p, DY, lane] = direction[k, 1]
        packets[p, DZ, lane] = direction[k, 2]
        packets[p, TFAR, lane] = np.inf
        whole[p, GEOMETRY, lane] = MISS
    for slot in range(live.size, (live.size + LANES - 1) // LANES * LANES):
        packets[slot // LANES, TFAR, slot % LANES] = -1.0


@njit(**INLINE)
def _goes_on(patch, place, direction, k):
    """Whether ray `k` leaves the patch's rim before the cloth's; it is then moved there."""
    rim = np.inf
    for axis in range(2):
        d = direction[k, axis]
        if d > 0.0:
            rim = min(rim, (patch.high[axis] - place[k, axis]) / d)
        elif d < 0.0:
            rim = min(rim, (patch.low[axis] - place[k, axis]) / d)
    d = direction[k, 2]
    out = np.inf
    if d > 0.0:
        out = (patch.top - place[k, 2]) / d
    elif d < 0.0:
        out = (patch.bottom - place[k, 2]) / d
    if out > rim:
        for axis in range(3):
            place[k, axis] += direction[k, axis] * rim
    return out > rim


@njit(**KERNEL)
def _found(patch, packets, whole, live, place, direction, hits):
    """Note the hits; returns how many rays go on, moved to the front of `live`."""
    kept = 0
    for slot in range(live.size):
        k = live[slot]
        p, lane = slot // LANES, slot % LANES
        if whole[p, GEOMETRY, lane] != MISS:
            hits.primitive[k] = np.int32(whole[p, PRIMITIVE, lane])
            hits.u[k], hits.v[k] = packets[p, HIT_U, lane], packets[p, HIT_V, lane]
            outward = (
                packets[p, NGX, lane] * direction[k, 0]
                + packets[p, NGY, lane] * direction[k, 1]
                + packets[p, NGZ, lane] * direction[k, 2]
            )
            hits.back[k] = outward > 0.0
        elif _goes_on(patch, place, direction, k):
            live[kept] = k
            kept += 1
    return kept


@njit(**KERNEL)
def _stopped(patch, packets, live, place, direction, out):
    """Note what is blocked; returns how many rays go on, moved to the front of `live`."""
    kept = 0
    for slot in range(live.size):
        k = live[slot]
        if packets[slot // LANES, TFAR, slot % LANES] < 0.0:
            out[k] = True
        elif _goes_on(patch, place, direction, k):
            live[kept] = k
            kept += 1
    return kept


def from_outside(cloth: Cloth, uv: Floats, w: Floats) -> Floats:
    """(n, 3) origins [m] at the places `uv` (n, 2), in repeats, of rays that come from `w`."""
    out: Any = np.empty((len(uv), 3))
    out[:, :2] = uv * cloth.patch.size
    out[:, 2] = np.where(w[:, 2] > 0, cloth.patch.top, cloth.patch.bottom)
    return np.asarray(out)
