"""Compute the moments of the weave over a texel, from which every map is made.

Moments are linear: the moments of a texel are the means of those of the four finer texels in it.
Mip levels are therefore means of moments, and each map is computed from the moments of its own
level, so that slopes, variances and directions are correct at every level. Tangent angles and
slopes have second moments, after [Olano2010]. Horizons are stored as the mean of the squared sine,
which is the share of a cosine-weighted sky that they hide.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.shadow.horizon_lookup import entry_at
from fabricusd.appearance.shadow.methods import lit
from fabricusd.appearance.weave.coverage import GAP, WARP
from fabricusd.appearance.weave.lookup import crown_on, find, move_along, wrap
from fabricusd.appearance.weave.place import Hit
from fabricusd.appearance.weave.yarn.lay import EVENLY, lay_at, sound
from fabricusd.bake.texels.angle_rows import HEIGHTS, STEPS
from fabricusd.bake.texels.moment_indices import (
    AZIMUTHS,
    BACK_COVER,
    HEIGHT,
    HORIZON,
    LIT,
    MOMENTS,
    SLOPE,
    SLOPE_2,
    TINT,
    VOLUME,
)
from fabricusd.kernels.real import INLINE, LEAN

ROUNDEST = 0.95
"""Position across a round thread beyond which its slope is held constant: the slope is infinite at
the edge, and its square has no mean."""

WHOLE = 2.0
"""Repeats that a texel must span along both axes to take the repeat's mean. Any deviation from the
mean would be moire, the beat of the repeat against the texel raster."""

MOST_SAMPLES = 8
"""Largest number of samples along each side of a texel."""


def samples_for(step: NDArray[np.float64], repeat: tuple[int, int]) -> int:
    """Return the samples along each side of a texel that spans `step` (2, 2) threads.

    Three per thread, from four to MOST_SAMPLES; 0 if the texel takes the repeat's mean.
    """
    if spans_repeats(step, repeat):
        return 0
    span = float(np.abs(step).sum(axis=1).max())
    return int(min(max(math.ceil(3.0 * span), 4), MOST_SAMPLES))


def spans_repeats(step: NDArray[np.float64], repeat: tuple[int, int]) -> bool:
    """Whether a texel that spans `step` (2, 2) threads takes the repeat's mean."""
    return bool((np.abs(step).sum(axis=1) >= WHOLE * np.array(repeat)).all())


@njit(**LEAN)
def texels(  # type: ignore[no-untyped-def]
    made, apart, step, start, corner, owner, mine, side, sums, out
):
    """Write the moments of the texels that `mine` owns to out (MOMENTS, h, w); leave the others.

    apart : (2, 2) float64 - threads from one texel to the next: columns for right and for down
    step : (2, 2) float64 - threads that a texel spans; differs from `apart` if texels overlap
    start : (2,) float64 - weave coordinates of the first texel's outer corner
    corner : (x, y) of the first texel on its sheet
    side : samples along each side of a texel, 0 to take the repeat's mean
    sums : (MOMENTS,) float32 - scratch space for the sums over samples

    Samples are stratified and jittered by a hash of the texel's position on the sheet: a regular
    raster would alias with a weave of the same pitch, and identically in all texels.
    """
    R = np.float32
    height, width = owner.shape
    for j in range(height):
        for i in range(width):
            if owner[j, i] != mine:
                continue
            if side == 0:
                for p in range(MOMENTS):
                    out[p, j, i] = made.mean[p]
                continue
            for p in range(MOMENTS):
                sums[p] = R(0)
            seed = _mixed(np.uint64(corner[0] + i) << np.uint64(32) | np.uint64(corner[1] + j))
            left = start[0] + apart[0, 0] * i + apart[0, 1] * j
            top = start[1] + apart[1, 0] * i + apart[1, 1] * j
            for b in range(side):
                for a in range(side):
                    seed = _mixed(seed + np.uint64(0x9E3779B97F4A7C15))
                    x = (a + (seed >> np.uint64(32)) * 2.0**-32) / side
                    y = (b + (seed & np.uint64(0xFFFFFFFF)) * 2.0**-32) / side
                    u = left + step[0, 0] * x + step[0, 1] * y
                    v = top + step[1, 0] * x + step[1, 1] * y
                    _add(made, u, v, sums)
            share = R(1.0 / (side * side))
            for p in range(MOMENTS):
                out[p, j, i] = sums[p] * share


@njit(**LEAN)
def threads_under(made, weave, sets, threads):  # type: ignore[no-untyped-def]
    """Write the thread set and type at weave coordinates (n, 2) float64 to sets, threads (n,), and
    into `weave` the places of the even cloth, which uneven threads move."""
    R = np.float32
    for k in range(weave.shape[0]):
        u, v, warp, weft = laid_at(made, weave[k, 0], weave[k, 1], R(0))
        which, thread, s, _, _, length = find(R, made.cloth, u, v)
        if made.uneven != 0 and which != GAP and length > R(0):
            seen, place = (warp, v) if which == WARP else (weft, u)
            moved, _, _ = move_along(
                R, made.cloth, made.yarn, which, thread, seen.number, s, length, place
            )
            u, v = (u, moved) if which == WARP else (moved, v)
        weave[k, 0], weave[k, 1] = u, v
        sets[k], threads[k] = which, thread


@njit(**INLINE)
def laid_at(made, u, v, blur):  # type: ignore[no-untyped-def]
    """(u, v, warp, weft): the place of the even cloth that looks as (u, v) does, and the `Lateral`
    of both sets there; blur : extent of the footprint [m]."""
    R = np.float32
    if made.uneven == 0 or not sound(u, v):
        return u, v, EVENLY, EVENLY
    warp, weft = lay_at(R, made.yarn, u, v, blur)
    return (
        float(warp.number) + float(warp.place),
        float(weft.number) + float(weft.place),
        warp,
        weft,
    )


@njit(**INLINE)
def _mixed(x):  # type: ignore[no-untyped-def]
    """Hash 64 bits to 64 bits, [Steele2014]."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@njit(**INLINE)
def _step_of(angle):  # type: ignore[no-untyped-def]
    """Row of `Recipe.rows` for a tangent angle [rad]."""
    R = np.float32
    step = int((angle * R(1.0 / math.pi) + R(0.5)) * R(STEPS - 1) + R(0.5))
    return min(max(step, 0), STEPS - 1)


@njit(**INLINE)
def _add_back(made, u, v, out):  # type: ignore[no-untyped-def]
    """Add what the back of the cloth shows at weave coordinates (u, v) of its front."""
    which, thread, _, _, angle, _ = find(np.float32, made.back, u, -v)
    if which != GAP:
        step = _step_of(angle)
        for p in range(made.back_rows.shape[3]):
            out[BACK_COVER + p] += made.back_rows[which, thread, step, p]


@njit(**INLINE)
def _add(made, u, v, out):  # type: ignore[no-untyped-def]
    """Add the sample at weave coordinates (u, v) to a texel's sums."""
    R = np.float32
    u, v, warp, weft = laid_at(made, u, v, R(0))
    if made.two_sided != 0:
        _add_back(made, u, v, out)
    which, thread, s, w, angle, length = find(R, made.cloth, u, v)
    if which == GAP:
        if made.light[2] > R(0):
            out[LIT] += R(1)
        return
    seen = warp if which == WARP else weft
    if made.uneven != 0 and length > R(0):
        at, s, angle = move_along(
            R, made.cloth, made.yarn, which, thread, seen.number, s, length,
            v if which == WARP else u,
        )  # fmt: skip
        u, v = (u, at) if which == WARP else (at, v)
    step = _step_of(angle)
    for p in range(LIT):
        out[p] += made.rows[which, thread, step, p]
    if made.uneven != 0:
        tint, more = TINT + 3 * which, seen.shade - R(1)
        for c in range(3):
            out[tint + c] += more * made.rows[which, thread, step, tint + c]
            out[VOLUME + c] += more * made.rows[which, thread, step, VOLUME + c]
    place = s * R(HEIGHTS - 1)
    low = min(int(place), HEIGHTS - 2)
    rise = made.heights[thread, low]
    rise += (made.heights[thread, low + 1] - rise) * (place - R(low))
    crown = made.cloth.half_height[which, thread]
    if made.rounded != 0:
        crown = crown_on(R, made.cloth, which, thread, w)
        _add_round(made, which, thread, w, step, out)
    out[HEIGHT] += length * rise + made.cloth.lift[which] + crown
    if made.light[2] > R(0):
        out[LIT] += lit(
            R, made.cloth, made.shadow, u, v, Hit(which, thread, s, w, length),
            made.light[0], made.light[1], made.light[2],
        )  # fmt: skip
    _add_horizon(made, u, v, which, out)


@njit(**INLINE)
def _add_round(made, which, thread, w, step, out):  # type: ignore[no-untyped-def]
    """Add the slope across a round thread at position `w` in [-1, 1] across its width."""
    R = np.float32
    edge = min(max(w, R(-ROUNDEST)), R(ROUNDEST))
    share = made.cloth.width[which] if made.cloth.width[which] > R(0) else R(1)
    reach = R(0.5) * share * made.cloth.pitch[which]
    steep = made.cloth.half_height[which, thread] / reach
    across = -edge / R(math.sqrt(R(1) - edge * edge)) * steep
    along = 1 if which == WARP else 0
    # w grows along -U on the warp, along +V on the weft.
    across = -across if which == WARP else across
    out[SLOPE + 1 - along] += across
    out[SLOPE_2 + 1 - along] += across * across
    out[SLOPE_2 + 2] += across * made.rows[which, thread, step, SLOPE + along]


@njit(**INLINE)
def _add_horizon(made, u, v, which, out):  # type: ignore[no-untyped-def]
    """Add the nearest entry of the horizon table; averaging a texel's samples interpolates it."""
    R = np.float32
    table = made.table
    if table.shape[4] != AZIMUTHS:
        return
    end, pick = math.floor(u), math.floor(v)
    a, b = entry_at(table, made.kinds, u, v)
    p, q = R(u - end), R(v - pick)
    cloth = made.cloth
    top = int(cloth.grid[wrap(end, cloth.grid.shape[0]), wrap(pick, cloth.grid.shape[1])])
    if top == WARP:
        p, q = q, p
    width = cloth.width[top]
    slot = 0
    if which == top:
        along = p
    else:
        slot = 1
        seen = q if q < R(0.5) else q - width
        along = seen / (R(1) - width)
    row = min(max(int(along * table.shape[3]), 0), table.shape[3] - 1)
    for k in range(AZIMUTHS):
        sine = R(table[a, b, slot, row, k]) * R(1.0 / 255.0)
        out[HORIZON + k] += sine * sine


def halve(
    moments: NDArray[np.float32], owned: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the next mip level: means of 2 x 2 texels, weighted by their owned shares.

    moments : (p, h, w)
    owned : (h, w) share of each texel that belongs to the UV layout
    """
    p, h, w = moments.shape
    half = np.empty((p, h // 2, w // 2), np.float32)
    share = np.empty((h // 2, w // 2), np.float32)
    _halve(moments, owned, half, share)
    return half, share


@njit(**LEAN)
def _halve(moments, owned, half, share):  # type: ignore[no-untyped-def]
    R = np.float32
    height, width = share.shape
    for j in range(height):
        for i in range(width):
            share[j, i] = R(0.25) * (
                (owned[2 * j, 2 * i] + owned[2 * j, 2 * i + 1])
                + (owned[2 * j + 1, 2 * i] + owned[2 * j + 1, 2 * i + 1])
            )
    for p in range(moments.shape[0]):
        for j in range(height):
            for i in range(width):
                total = (
                    moments[p, 2 * j, 2 * i] * owned[2 * j, 2 * i]
                    + moments[p, 2 * j, 2 * i + 1] * owned[2 * j, 2 * i + 1]
                ) + (
                    moments[p, 2 * j + 1, 2 * i] * owned[2 * j + 1, 2 * i]
                    + moments[p, 2 * j + 1, 2 * i + 1] * owned[2 * j + 1, 2 * i + 1]
                )
                half[p, j, i] = R(0.25) * total / max(share[j, i], R(1e-20))
