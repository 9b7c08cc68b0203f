"""The cloth place by place: which thread is seen from above, and how much light gets there."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance.frame import to_thread
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.errors import FabricError
from fabricusd.geometry.cloth import Cloth
from fabricusd.geometry.paths import directions
from fabricusd.geometry.rays import NOTHING, Hits, blocked, from_outside, nearest
from fabricusd.geometry.section import leave, squeezed, tube_point
from fabricusd.kernels.real import KERNEL

Floats = NDArray[np.float64]


class Seen(NamedTuple):
    """What is seen from above at each place.

    set : (n,) int32 - WEFT, WARP or GAP; number : (n,) int32 - of the thread in its set, within the
        repeat of weave and sequences, -1 in gaps; kind : (n,) int32 - its type, -1 in gaps
    angle : (n,) float - tangent angle [rad]; across : (n,) float - place across the thread in
        [-1, 1], positive along b, as level `thread` has it; height : (n,) float - of its axis [m]
    """

    set: NDArray[np.int32]
    number: NDArray[np.int32]
    kind: NDArray[np.int32]
    angle: Floats
    across: Floats
    height: Floats


def seen(cloth: Cloth, uv_threads: ArrayLike) -> Seen:
    """The thread seen from above at each place.

    uv_threads : (n, 2) float - place in threads, u across the warp and v across the weft, as
        `appearance.weave.lookup.lookup` takes it
    """
    hits = _from_above(cloth, uv_threads)
    n = len(hits.primitive)
    whole = np.full((3, n), -1, np.int32)
    real = np.zeros((3, n))
    _note(cloth.mesh.rings, cloth.lines, hits, whole, real)
    return Seen(np.where(whole[0] < 0, GAP, whole[0]).astype(np.int32), whole[1], whole[2], *real)


def lit_share(
    cloth: Cloth, uv_threads: ArrayLike, wi: ArrayLike, *, count: int = 16, seed: int = 0
) -> Floats:
    """(k, n) share of the light from each direction that gets to the thread seen at each place.

    uv_threads : (n, 2) as for `seen`; wi : (k, 3) unit vectors in the surface frame
    count : places across the side of the thread that faces the light, over which the share is
        taken. That its far side is dark is the thread's own doing, and no shadow. NaN in gaps
    """
    lights = directions("wi", wi)
    hits = _from_above(cloth, uv_threads)
    on = np.flatnonzero(hits.primitive != NOTHING)
    found = np.full((len(lights), len(hits.primitive)), math.nan)
    rng = np.random.default_rng(seed)
    chosen = hits.only(np.repeat(on, count))
    origin = np.empty((len(on) * count, 3))
    for k, light in enumerate(lights):
        strata = (np.tile(np.arange(count), len(on)) + rng.random(len(origin))) / count
        _facing(cloth.mesh.rings, cloth.lines, chosen, light, 2.0 * strata - 1.0, origin)
        dark = blocked(cloth, origin, np.broadcast_to(light, origin.shape))
        found[k, on] = 1.0 - dark.reshape(len(on), count).mean(axis=1)
    return found


def _from_above(cloth: Cloth, uv_threads: ArrayLike) -> Hits:
    uv = np.asarray(uv_threads, np.float64)
    if uv.ndim != 2 or uv.shape[1] != 2 or not np.isfinite(uv).all():
        raise FabricError("uv_threads", f"has shape {uv.shape}; it must be (n, 2), all finite")
    down = np.tile((0.0, 0.0, -1.0), (len(uv), 1))
    hits = nearest(cloth, from_outside(cloth, uv * cloth.pitch / cloth.patch.size, -down), down)
    # The backing, and where tubes overlap their insides.
    hits.primitive[hits.back] = NOTHING
    return hits


@njit(**KERNEL)
def _note(rings, lines, hits, whole, real):
    for k in range(hits.primitive.size):
        if hits.primitive[k] == NOTHING:
            continue
        line, _, _, z, psi, _, alpha, _ = tube_point(rings, hits.primitive[k], hits.u[k], hits.v[k])
        whole[0, k], whole[1, k] = lines.which[line], lines.number[line]
        whole[2, k] = lines.kind[line]
        real[0, k], real[1, k], real[2, k] = psi, math.cos(alpha), z


@njit(**KERNEL)
def _facing(rings, lines, hits, light, offset, origin):
    for k in range(hits.primitive.size):
        line, x, y, z, psi, _, _, wider = tube_point(rings, hits.primitive[k], hits.u[k], hits.v[k])
        which, c, s = lines.which[line], math.cos(psi), math.sin(psi)
        wide, tall = wider * lines.half_width[line], lines.half_height[line]
        _, b, n = to_thread(float, which, c, s, light[0], light[1], light[2])
        length = max(math.sqrt(b * b + n * n), 1e-30)
        sin_c, cos_c, _ = squeezed(wide, tall, b / length, n / length)
        px, py, pz, _ = leave(which, c, s, x, y, z, wide, tall, sin_c, cos_c, offset[k])
        origin[k, 0], origin[k, 1], origin[k, 2] = px, py, pz
