"""The stage after shading: turns hits into shadow rays towards lights and the paths' next rays.

Hits are processed in blocks. Their rows are copied into one array, loops that LLVM vectorises
compute the new rays, and only the rays that carry light are written out, packed.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.kernels.real import INLINE, KERNEL, LEAN, PART, whole
from fabricusd.reference.rays.embree import (
    DX,
    GEOMETRY,
    INFINITE_DISTANCE,
    MISS,
    OX,
    TFAR,
    TNEAR,
)
from fabricusd.reference.rays.wave import (
    ALBEDO,
    ALPHA,
    AT_LEVEL,
    BACK,
    BEAUTY_ROWS,
    BEFORE,
    BETA,
    BLOCK,
    CHANCE,
    CORNERS,
    DEPTH,
    DEPTH_Z,
    DISTANCE,
    F_PDF,
    FRONT,
    GO,
    GO_PDF,
    HIT_ROWS,
    KEEP,
    LANE_BETA,
    LANE_PDF,
    LANE_SPREAD,
    LANE_WIDTH,
    LEVEL,
    LIGHT,
    LIGHT_PDF,
    MATERIAL,
    NORMAL,
    PATH,
    SPREAD,
    TANGENT,
    THREAD,
    THREAD_ID,
    THROUGH,
    TO_LIGHT,
    UNLIT,
    UV,
    WEIGHT,
    WI,
    WIDTH,
    WO,
    F,
    N,
    U,
    V,
)
from fabricusd.reference.rays.wave import PRIMITIVE as TRIANGLE
from fabricusd.reference.stages.arrivals import LIGHT_ONLY, MIS, UNIFORM

R = np.float32
UNSEEN = R(-1)
"""The pdf stored for a ray with which light sampling does not compete."""
CARRIES_ON = R(8)
"""Russian roulette spares a path whose throughput is at least the inverse of this. On the sample
scenes, rays times relative MSE is smallest from 6 to 12, a sixth lower than at 2."""
MOST = R(3e38)
"""Values that are not below this count as not finite."""

# Rows of a block after those of `Hits.rows`: the shadow ray's origin and length, the light that it
# brings, and the sum of that over the channels; the next ray's origin, direction, throughput, pdf
# and spread, and whether it is alive. In the sum and in the last row, a value of 0 or less means
# that there is no ray, and _BROKEN that the ray was dropped because a value was not finite.
_SHADOW, _REACH, _BRINGS, _SUM, _START, _ALONG, _BETA, _PDF, _SPREAD, _ALIVE = (
    HIT_ROWS + row for row in (0, 3, 4, 7, 8, 11, 14, 17, 18, 19)
)
_ROWS = HIT_ROWS + 20
_NONE, _BROKEN = R(-1), R(-2)


@njit(**KERNEL)
def depart(step, settings, count, translucent, hits, film, shadows, lanes, result):
    """Write the shadow rays and the next rays of all hits, both packed.

    translucent : (materials,) uint8 - 1 for cloth that scatters light to its other side
    lanes : `Lanes` of the next step
    result : (3,) int64 - numbers of shadow rays, next rays and non-finite values
    """
    estimator = settings.estimator
    block = np.empty(_ROWS * BLOCK, np.float32)
    result[:] = 0
    count = whole(count)
    for start in range(0, count, BLOCK):
        size = min(BLOCK, count - start)
        _load(start, size, hits, block)
        _towards_lights(estimator == MIS, size, block)
        if estimator == UNIFORM:
            _go_uniformly(size, block)
        _onwards(step, estimator == MIS, size, block)
        _write_shadows(start, size, hits, film, shadows, result, block)
        # Trace one ray beyond the last surface: the lights that it sees illuminate that surface.
        beyond = 0 if estimator == LIGHT_ONLY else 1
        deepest = settings.max_depth + beyond, settings.max_through + beyond
        _write_next(start, size, deepest, translucent, hits, lanes, result, block)
    _fill_up(result[0], shadows.rays)
    _fill_up(result[1], lanes.rays)


@njit(**PART)
def _load(start, size, hits, block):
    for row in range(CORNERS):
        source = hits.rows[row][start:]
        for x in range(size):
            block[row * BLOCK + x] = source[x]


# Takes one index instead of a row and a column: numba recompiles a function for every constant.
@njit(**INLINE)
def _three(block, at):
    return block[at], block[at + BLOCK], block[at + 2 * BLOCK]


@njit(**INLINE)
def _put(block, at, a, b, c):
    block[at], block[at + BLOCK], block[at + 2 * BLOCK] = a, b, c


@njit(**PART)
def _towards_lights(mis, size, block):
    """Compute the shadow rays, and the light that they bring if they are not blocked."""
    for x in range(size):
        pdf = block[LIGHT_PDF * BLOCK + x]
        ratio = block[F_PDF * BLOCK + x] / max(pdf, R(1e-30))
        weight = R(1) / (R(1) + ratio * ratio) if mis and pdf > R(0) else R(1)
        br, bg, bb = _three(block, BETA * BLOCK + x)
        fr, fg, fb = _three(block, F * BLOCK + x)
        lr, lg, lb = _three(block, LIGHT * BLOCK + x)
        red, green, blue = weight * br * fr * lr, weight * bg * fg * lg, weight * bb * fb * lb
        total = red + green + blue
        total = total if abs(total) < MOST else _BROKEN
        block[_SUM * BLOCK + x] = R(0) if pdf == R(0) else total
        _put(block, _BRINGS * BLOCK + x, red, green, blue)
        front = block[(WI + 2) * BLOCK + x] >= R(0)
        ax, ay, az = _three(block, FRONT * BLOCK + x)
        bx, by, bz = _three(block, BACK * BLOCK + x)
        _put(
            block,
            _SHADOW * BLOCK + x,
            ax if front else bx,
            ay if front else by,
            az if front else bz,
        )
        # A light may lie on a surface: geometry in the last ten-thousandth of the distance belongs
        # to the lamp and does not block it.
        reach = block[DISTANCE * BLOCK + x]
        block[_REACH * BLOCK + x] = reach if reach >= INFINITE_DISTANCE else reach * R(0.9999)


@njit(**PART)
def _go_uniformly(size, block):
    """Continue in the light sample's direction, which estimator UNIFORM draws over the sphere."""
    for x in range(size):
        pdf = block[KEEP * BLOCK + x] * R(0.25 / math.pi)
        straight = block[GO_PDF * BLOCK + x] < R(0)
        if straight:
            continue
        inverse = R(1) / pdf if pdf > R(0) else R(0)
        for row in range(3):
            block[(GO + row) * BLOCK + x] = block[(WI + row) * BLOCK + x]
            block[(WEIGHT + row) * BLOCK + x] = block[(F + row) * BLOCK + x] * inverse
        block[GO_PDF * BLOCK + x] = pdf


@njit(**PART)
def _onwards(step, mis, size, block):
    """Compute the paths' next rays: as the surface sampled them, or straight on behind it."""
    # The first ray from a surface carries half of its direct light. Ending it costs more in noise
    # than it saves in time: four times as much on a grey floor under a sky.
    least = R(1) if step == 0 else R(0)
    for x in range(size):
        pdf = block[GO_PDF * BLOCK + x]
        straight = pdf < R(0)
        gx, gy, gz = _three(block, GO * BLOCK + x)
        ox, oy, oz = _three(block, WO * BLOCK + x)
        gx, gy, gz = (-ox if straight else gx), (-oy if straight else gy), (-oz if straight else gz)
        ux, uy, uz = _three(block, U * BLOCK + x)
        vx, vy, vz = _three(block, V * BLOCK + x)
        nx, ny, nz = _three(block, N * BLOCK + x)
        _put(
            block, _ALONG * BLOCK + x, gx * ux + gy * vx + gz * nx, gx * uy + gy * vy + gz * ny,
            gx * uz + gy * vz + gz * nz,
        )  # fmt: skip
        front = gz >= R(0) and not straight
        ax, ay, az = _three(block, FRONT * BLOCK + x)
        bx, by, bz = _three(block, BACK * BLOCK + x)
        _put(
            block, _START * BLOCK + x, ax if front else bx, ay if front else by, az if front else bz
        )
        br, bg, bb = _three(block, BETA * BLOCK + x)
        wr, wg, wb = _three(block, WEIGHT * BLOCK + x)
        red, green, blue = wr * br, wg * bg, wb * bb
        most = max(red, max(green, blue))
        # Russian roulette on the largest channel of the throughput.
        chance = max(min(R(1), CARRIES_ON * most), least if most > R(0) else R(0))
        inverse = R(1) / max(chance, R(1e-30))
        red, green, blue = red * inverse, green * inverse, blue * inverse
        _put(
            block, _BETA * BLOCK + x,
            br if straight else red, bg if straight else green, bb if straight else blue,
        )  # fmt: skip
        alive = R(1) if block[(CHANCE + 3) * BLOCK + x] < chance else _NONE
        alive = alive if most < MOST and pdf < MOST else _BROKEN
        alive = _NONE if pdf == R(0) else alive
        block[_ALIVE * BLOCK + x] = R(1) if straight else alive
        spread = block[SPREAD * BLOCK + x]
        # A scattered ray represents a solid angle of one over its pdf.
        wide = R(0.25) * math.sqrt(min(R(1) / max(pdf, R(1e-30)), R(4)))
        block[_SPREAD * BLOCK + x] = spread if straight else max(spread, wide)
        seen = pdf if mis else UNSEEN
        block[_PDF * BLOCK + x] = block[BEFORE * BLOCK + x] if straight else seen


@njit(**INLINE)
def _write_ray(k, start, along, reach, rays, block):
    """Write ray `k` of the packets; `start` and `along` are places of its origin and direction in
    the block."""
    p, lane = k >> 4, k & 15
    for row in range(3):
        rays[p, OX + row, lane] = block[start + row * BLOCK]
        rays[p, DX + row, lane] = block[along + row * BLOCK]
    rays[p, TNEAR, lane], rays[p, TFAR, lane] = R(0), reach
    rays.view(np.uint32)[p, GEOMETRY, lane] = MISS


@njit(**PART)
def _write_shadows(start, size, hits, film, shadows, result, block):
    tags, (rays, light, shadow_path) = hits.tags, shadows
    k = whole(result[0])
    for x in range(size):
        h = start + x
        path, depth = whole(tags[PATH, h]), tags[DEPTH, h]
        if depth == 0 and block[GO_PDF * BLOCK + x] >= R(0):
            film[ALPHA, path] = R(1)
        total = block[_SUM * BLOCK + x]
        if total > R(0):
            reach = block[_REACH * BLOCK + x]
            _write_ray(k, _SHADOW * BLOCK + x, TO_LIGHT * BLOCK + x, reach, rays, block)
            for row in range(3):
                light[row, k] = block[(_BRINGS + row) * BLOCK + x]
            light[3, k] = reach
            shadow_path[k] = path if depth == 0 else -path - 1
            if depth == 0 and film.shape[0] > BEAUTY_ROWS:
                film[UNLIT, path] += total
            k += 1
        elif total == _BROKEN:
            result[2] += 1
    result[0] = k


@njit(**PART)
def _write_next(start, size, deepest, translucent, hits, lanes, result, block):
    tags, (rays, rows, lane_tags) = hits.tags, lanes
    max_depth, max_through = deepest
    k = whole(result[1])
    for x in range(size):
        h = start + x
        alive, depth, through = block[_ALIVE * BLOCK + x], tags[DEPTH, h], tags[THROUGH, h]
        clear = translucent[tags[MATERIAL, h]] != 0
        straight = block[GO_PDF * BLOCK + x] < R(0)
        if alive == _BROKEN:
            result[2] += 1
        at_bound = through >= max_through if clear else depth - through >= max_depth
        if alive < R(0) or (at_bound and not straight):
            continue
        _write_ray(k, _START * BLOCK + x, _ALONG * BLOCK + x, INFINITE_DISTANCE, rays, block)
        for row in range(3):
            rows[LANE_BETA + row, k] = block[(_BETA + row) * BLOCK + x]
        rows[LANE_PDF, k] = block[_PDF * BLOCK + x]
        rows[LANE_WIDTH, k] = block[WIDTH * BLOCK + x]
        rows[LANE_SPREAD, k] = block[_SPREAD * BLOCK + x]
        lane_tags[0, k], lane_tags[1, k] = tags[PATH, h], depth if straight else depth + 1
        lane_tags[2, k] = through + 1 if clear and not straight else through
        k += 1
    result[1] = k


@njit(**INLINE)
def _fill_up(count, rays):
    """Deactivate the lanes of the last packet that hold no ray."""
    count = whole(count)
    for k in range(count, ((count + 15) >> 4) << 4):
        rays[k >> 4, TNEAR, k & 15] = R(0)
        rays[k >> 4, TFAR, k & 15] = R(-1)


@njit(**LEAN)
def record_first(count, eye, view, hits, uv, film):
    """Write the properties of each path's first surface to the rows of the AOVs."""
    rows, tags = hits.rows, hits.tags
    for h in range(count):
        if tags[DEPTH, h] != 0 or rows[GO_PDF, h] < R(0):
            continue
        path = whole(tags[PATH, h])
        distance = R(0)
        for row in range(3):
            film[ALBEDO + row, path] = rows[WEIGHT + row, h] if rows[GO_PDF, h] > R(0) else R(0)
            film[NORMAL + row, path] = rows[N + row, h]
            film[TANGENT + row, path] = rows[U + row, h]
            distance += (rows[FRONT + row, h] - eye[row]) * view[row]
        film[DEPTH_Z, path] = distance
        film[THREAD_ID, path] = rows[THREAD, h]
        film[AT_LEVEL, path] = R(tags[LEVEL, h])
        corner = uv[tags[TRIANGLE, h]]
        b, c = rows[CORNERS, h], rows[CORNERS + 1, h]
        for row in range(2):
            film[UV + row, path] = (
                (R(1) - b - c) * corner[row] + b * corner[row + 2] + c * corner[row + 4]
            )
