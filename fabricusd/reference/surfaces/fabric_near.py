"""What lies under hits at levels `weave` and `thread`, and the shadows that fall there.

Even threads and shadows by `horizon` are looked up by the vectorised loops of `place_blocks` and
`horizon_blocks`, the other methods one hit after the other. A shadow is a factor for each direction
of each hit; kernels of methods that no picture uses are never compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.shadow import place_blocks
from fabricusd.appearance.shadow.kinds import HORIZON, NONE, Shadow
from fabricusd.appearance.shadow.methods import horizon_block, mean_block, shade
from fabricusd.appearance.shadow.place_blocks import (
    ACROSS,
    ANGLE,
    LENGTH,
    LIT,
    OF_SET,
    OF_THREAD,
    S,
    look_up_block,
    pieces_block,
)
from fabricusd.appearance.weave.compiled import CompiledFabric
from fabricusd.appearance.weave.coverage import GAP, WARP, WEFT
from fabricusd.appearance.weave.lookup import move_along
from fabricusd.appearance.weave.place import Hit, Places
from fabricusd.appearance.weave.yarn.lay import (
    DOUBLE_ROWS,
    IN_CELL,
    INT_ROWS,
    REAL_ROWS,
    TONE,
    lay_block,
    sound,
    strand,
)
from fabricusd.kernels.calls import Calls
from fabricusd.kernels.real import BLOCK, INLINE, KERNEL, LEAN
from fabricusd.reference.rays.wave import FOOTPRINT, PLACE

R = np.float32


class Points(NamedTuple):
    """The thread under each of n hits, as `weave.lookup.find` gives it.

    sets : (n,) uint8; threads : (n,) int32; along, across, psi0, length : (n,) float32
    strand : (n,) float32 - position across the strand of plies; `across` itself where none shows
    shade : (n,) float32 - factor of the albedo; (0,) for even threads
    """

    sets: NDArray[np.uint8]
    threads: NDArray[np.int32]
    along: NDArray[np.float32]
    across: NDArray[np.float32]
    psi0: NDArray[np.float32]
    length: NDArray[np.float32]
    strand: NDArray[np.float32]
    shade: NDArray[np.float32]


def places_of(points: Points) -> Places:
    """What the surface laws read of `points`."""
    return Places(points.sets, points.threads, points.psi0, points.strand, points.shade)


class Lit(NamedTuple):
    """Factors of the values of n hits by the shadows of neighbouring threads, each (n,) float32.

    light : for `Scattering.wi`; bounce : for `Scattering.go`
    """

    light: NDArray[np.float32]
    bounce: NDArray[np.float32]


@njit(**INLINE)
def _places_of_block(hits, v_sign, first, size, uv):
    """The places of `size` hits as the side of the cloth counts them, into uv (BLOCK, 2)."""
    for x in range(size):
        uv[x, 0] = float(hits[PLACE, first + x])
        uv[x, 1] = float(v_sign * hits[PLACE + 1, first + x])


@njit(**KERNEL)
def look_up(R, cloth, shadow, v_sign, hits, first, points):
    """Look up the even thread under each hit."""
    ints = np.empty(place_blocks.INT_ROWS * BLOCK, np.int32)
    reals, uv = np.empty(place_blocks.REAL_ROWS * BLOCK, R), np.empty((BLOCK, 2))
    count = points.sets.shape[0]
    for start in range(0, count, BLOCK):
        size = min(BLOCK, count - start)
        _places_of_block(hits, v_sign, first + start, size, uv)
        look_up_block(R, cloth, shadow, uv, 0, size, ints, reals)
        _even_points(R, start, size, ints, reals, points)


@njit(**INLINE)
def _even_points(R, start, size, ints, reals, points):
    """Copy what `look_up_block` found to the points from `start` on."""
    sets, threads, along, across, psi0, length, _, _ = points
    none = R(0)
    for x in range(size):
        k, gap = start + x, ints[OF_SET + x] == GAP
        sets[k], threads[k] = ints[OF_SET + x], ints[OF_THREAD + x]
        along[k] = none if gap else reals[S + x]
        across[k] = none if gap else reals[ACROSS + x]
        psi0[k] = none if gap else reals[ANGLE + x]
        length[k] = none if gap else reals[LENGTH + x]


@njit(**KERNEL)
def look_up_uneven(R, cloth, shadow, yarn, home, v_sign, triangles, hits, first, points):
    """Look up the uneven thread under each hit; PLACE becomes the place of the even cloth at which
    that thread lies, for the shadows.

    home : `TriangleTables.home`; triangles : (n,) of each hit
    """
    u, v, blur = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK, R)
    doubles, reals = np.empty(DOUBLE_ROWS * BLOCK), np.empty(REAL_ROWS * BLOCK, R)
    ints, near = np.empty(INT_ROWS * BLOCK, np.int32), np.empty((BLOCK, 2))
    even_ints = np.empty(place_blocks.INT_ROWS * BLOCK, np.int32)
    even_reals = np.empty(place_blocks.REAL_ROWS * BLOCK, R)
    count, metres = points.sets.shape[0], R(yarn.cell[WEFT])
    for start in range(0, count, BLOCK):
        size = min(BLOCK, count - start)
        for x in range(size):
            h = first + start + x
            u[x] = float(hits[PLACE, h]) + home[triangles[h], 0]
            v[x] = float(hits[PLACE + 1, h]) + home[triangles[h], 1]
            blur[x] = hits[FOOTPRINT, h] * metres
        lay_block(R, yarn, u, v, blur, size, doubles, reals, ints)
        for x in range(size):
            at = home[triangles[first + start + x]]
            place_u, place_v = _laid(u[x], v[x], x, ints, reals)
            near[x, 0], near[x, 1] = place_u - at[0], v_sign * (place_v - at[1])
        look_up_block(R, cloth, shadow, near, 0, size, even_ints, even_reals)
        _even_points(R, start, size, even_ints, even_reals, points)
        for x in range(size):
            h = first + start + x
            _move(
                R, cloth, yarn, home[triangles[h]], v_sign, u[x], v[x], x, reals, ints, near, hits,
                h, start + x, points,
            )  # fmt: skip


@njit(**INLINE)
def _laid(u, v, x, ints, reals):
    """Entry x of what `lay_block` found at (u, v): the place of the even cloth [threads]."""
    if not sound(u, v):
        return u, v
    return (
        float(ints[WARP * BLOCK + x]) + float(reals[IN_CELL + WARP * BLOCK + x]),
        float(ints[WEFT * BLOCK + x]) + float(reals[IN_CELL + WEFT * BLOCK + x]),
    )


@njit(**INLINE)
def _move(R, cloth, yarn, home, v_sign, u, v, x, reals, ints, near, hits, h, k, points):
    """Turn entry k of `points` from the even thread at `near` into the uneven one that `lay_block`
    found at (u, v), and write hit `h`'s PLACE; x : entry of the block."""
    sets, threads, along, across, psi0, length, strands, shades = points
    which, thread = np.int64(sets[k]), threads[k]
    near_u, near_v = near[x, 0], v_sign * near[x, 1]
    strands[k], shades[k] = across[k], R(1)
    if which != GAP and sound(u, v):
        number = ints[which * BLOCK + x]
        shades[k] = reals[TONE + which * BLOCK + x]
        if yarn.plies != 0:
            at = v_sign * v if which == WARP else u
            strands[k] = strand(R, yarn, which, thread, number, across[k], at * yarn.cell[which])
        if length[k] > R(0):
            place_u, place_v = _laid(u, v, x, ints, reals)
            # Along the thread as this side counts it: from the back, V runs the other way.
            place = v_sign * place_v if which == WARP else place_u
            moved, along[k], psi0[k] = move_along(
                R, cloth, yarn, which, thread, number, along[k], length[k], place
            )
            near_u = near_u if which == WARP else moved - home[0]
            near_v = v_sign * moved - home[1] if which == WARP else near_v
    hits[PLACE, h], hits[PLACE + 1, h] = R(near_u), R(near_v)


def shadows(
    call: Calls,
    cloth: CompiledFabric,
    shadow: Shadow,
    v_sign: np.float32,
    hits: NDArray[np.float32],
    first: int,
    directions: tuple[NDArray[np.float32], NDArray[np.float32]],
    points: Points,
    lit: Lit,
) -> None:
    """Compute `lit` of hits from `first` on, for light from `directions`, each (3, n).

    call : what calls the kernels of this cloth
    """
    if shadow.method == NONE:
        lit.light[:] = lit.bounce[:] = 1.0
        return
    kernel = shadows_by_horizon if shadow.method == HORIZON else shadows_one_by_one
    call(kernel, R, cloth, shadow, v_sign, hits, first, directions, points, lit)


@njit(**KERNEL)
def shadows_by_horizon(R, cloth, shadow, v_sign, hits, first, directions, points, lit):
    """`shadows` by the method `horizon`."""
    ints = np.empty(place_blocks.INT_ROWS * BLOCK, np.int32)
    reals, uv = np.empty(place_blocks.REAL_ROWS * BLOCK, R), np.empty((BLOCK, 2))
    count = points.sets.shape[0]
    for start in range(0, count, BLOCK):
        size = min(BLOCK, count - start)
        _places_of_block(hits, v_sign, first + start, size, uv)
        look_up_block(R, cloth, shadow, uv, 0, size, ints, reals)
        # Uneven threads lie elsewhere along the run than the place says.
        for x in range(size):
            which, thread = points.sets[start + x], points.threads[start + x]
            s = points.along[start + x]
            ints[OF_SET + x], ints[OF_THREAD + x], reals[S + x] = which, thread, s
        pieces_block(R, cloth, size, ints, reals)
        for turn in range(2):
            _one_direction(R, cloth, shadow, directions[turn], start, size, ints, reals, lit[turn])


@njit(**INLINE)
def _one_direction(R, cloth, shadow, w, start, size, ints, reals, out):
    horizon_block(R, cloth, shadow, w, start, size, ints, reals)
    mean_block(R, cloth, shadow, w, start, size, ints, reals)
    for x in range(size):
        # Light from behind the cloth is shadowed by the threads on that side.
        out[start + x] = R(1) if w[2, start + x] <= R(0) else reals[LIT + x]


@njit(**LEAN)
def shadows_one_by_one(R, cloth, shadow, v_sign, hits, first, directions, points, lit):
    """`shadows` by any method."""
    sets, threads, along, across, _, length, _, _ = points
    for k in range(sets.shape[0]):
        u, v = float(hits[PLACE, first + k]), float(v_sign * hits[PLACE + 1, first + k])
        hit = Hit(sets[k], threads[k], along[k], across[k], length[k])
        for turn in range(2):
            x, y, z = directions[turn][0, k], directions[turn][1, k], directions[turn][2, k]
            behind = z <= R(0)
            lit[turn][k] = R(1) if behind else shade(R, cloth, shadow, u, v, hit, x, y, z)
