"""From shaded hits to new rays: shadow rays towards lights, and the paths' next rays."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.appearance.real import INLINE, LEAN
from fabricusd.reference.arrivals import LIGHT_ONLY, MIS, SURFACE_ONLY, UNIFORM
from fabricusd.reference.embree import (
    DX,
    DY,
    DZ,
    GEOMETRY,
    HIT_U,
    HIT_V,
    MISS,
    OX,
    OY,
    OZ,
    PRIMITIVE,
    TFAR,
    TNEAR,
)  # fmt: skip
from fabricusd.reference.preview_surface import opacity_at
from fabricusd.reference.triangles import D1, D2, E1, E2, P0, ST
from fabricusd.reference.wave import (
    ALBEDO,
    ALPHA,
    AT_LEVEL,
    BACK,
    BEAUTY_ROWS,
    BEFORE,
    BETA,
    CHANCE,
    CORNERS,
    DEPTH,
    DEPTH_Z,
    DIRECT,
    DISTANCE,
    F_PDF,
    FRONT,
    GO,
    GO_PDF,
    INDIRECT,
    KEEP,
    LANE_BETA,
    LANE_PDF,
    LANE_SPREAD,
    LANE_WIDTH,
    LEVEL,
    LIGHT,
    LIGHT_PDF,
    LIT,
    NORMAL,
    PATH,
    SPREAD,
    TANGENT,
    THREAD,
    THREAD_ID,
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
)  # fmt: skip
from fabricusd.reference.wave import PRIMITIVE as TRIANGLE

R = np.float32
FAR = R(1e30)
UNSEEN = R(-1)
"""A ray's pdf where no light sampling competes with it."""


@njit(**LEAN)
def depart(estimator, count, max_depth, hits, tags, film, shadow_rays, shadow, shadow_path,
           next_rays, next_lanes, next_tags, result):  # fmt: skip
    """Write the shadow rays and next rays of all hits, each packed.

    shadow : (4, n) - what a shadow ray adds where nothing is in its way, and its length.
    result : (3,) int64 - shadow rays, next rays, values that were not finite.
    """
    shadows, spawned = 0, 0
    for h in range(count):
        depth = tags[DEPTH, h]
        path = tags[PATH, h]
        go_pdf = hits[GO_PDF, h]
        if go_pdf >= R(0):
            film[ALPHA, path] = R(1)
        pdf = hits[LIGHT_PDF, h]
        if pdf != R(0):
            weight = R(1)
            if pdf > R(0) and estimator == MIS:
                ratio = hits[F_PDF, h] / pdf
                weight = R(1) / (R(1) + ratio * ratio)
            red = weight * hits[BETA, h] * hits[F, h] * hits[LIGHT, h]
            green = weight * hits[BETA + 1, h] * hits[F + 1, h] * hits[LIGHT + 1, h]
            blue = weight * hits[BETA + 2, h] * hits[F + 2, h] * hits[LIGHT + 2, h]
            total = red + green + blue
            if not (abs(total) < R(3e38)):
                result[2] += 1
            elif total > R(0):
                _shadow_ray(shadows, h, hits, shadow_rays)
                shadow[0, shadows], shadow[1, shadows], shadow[2, shadows] = red, green, blue
                shadow[3, shadows] = shadow_rays[shadows >> 4, TFAR, shadows & 15]
                shadow_path[shadows] = path if depth == 0 else -path - 1
                if depth == 0 and film.shape[0] > BEAUTY_ROWS:
                    film[UNLIT, path] += total
                shadows += 1
        if go_pdf < R(0):
            _go_straight(spawned, h, hits, tags, next_rays, next_lanes, next_tags)
            spawned += 1
        elif depth < max_depth or estimator != LIGHT_ONLY:
            # One ray beyond the last surface: what it sees of lights belongs to that surface.
            spawned += _scatter(
                estimator, spawned, h, hits, tags, next_rays, next_lanes, next_tags, result
            )
    for k in range(shadows, ((shadows + 15) >> 4) << 4):
        shadow_rays[k >> 4, TNEAR, k & 15] = R(0)
        shadow_rays[k >> 4, TFAR, k & 15] = R(-1)
    for k in range(spawned, ((spawned + 15) >> 4) << 4):
        next_rays[k >> 4, TNEAR, k & 15] = R(0)
        next_rays[k >> 4, TFAR, k & 15] = R(-1)
    result[0], result[1] = shadows, spawned


@njit(**INLINE)
def _shadow_ray(k, h, hits, rays):
    p, lane = k >> 4, k & 15
    start = FRONT if hits[WI + 2, h] >= R(0) else BACK
    rays[p, OX, lane], rays[p, OY, lane] = hits[start, h], hits[start + 1, h]
    rays[p, OZ, lane] = hits[start + 2, h]
    rays[p, DX, lane], rays[p, DY, lane] = hits[TO_LIGHT, h], hits[TO_LIGHT + 1, h]
    rays[p, DZ, lane] = hits[TO_LIGHT + 2, h]
    rays[p, TNEAR, lane] = R(0)
    # Lights may lie on a surface: what is in the last ten-thousandth is the lamp, not an obstacle.
    reach = hits[DISTANCE, h]
    rays[p, TFAR, lane] = reach if reach >= FAR else reach * R(0.9999)
    rays.view(np.uint32)[p, GEOMETRY, lane] = MISS


@njit(**INLINE)
def _new_ray(k, start, h, dx, dy, dz, hits, rays):
    p, lane = k >> 4, k & 15
    rays[p, OX, lane], rays[p, OY, lane] = hits[start, h], hits[start + 1, h]
    rays[p, OZ, lane] = hits[start + 2, h]
    rays[p, DX, lane], rays[p, DY, lane], rays[p, DZ, lane] = dx, dy, dz
    rays[p, TNEAR, lane], rays[p, TFAR, lane] = R(0), FAR
    rays.view(np.uint32)[p, GEOMETRY, lane] = MISS


@njit(**INLINE)
def _world(hits, h, x, y, z):
    return (
        x * hits[U, h] + y * hits[V, h] + z * hits[N, h],
        x * hits[U + 1, h] + y * hits[V + 1, h] + z * hits[N + 1, h],
        x * hits[U + 2, h] + y * hits[V + 2, h] + z * hits[N + 2, h],
    )


@njit(**INLINE)
def _go_straight(k, h, hits, tags, rays, lanes, lane_tags):
    """The same ray behind the surface, as if that were not there."""
    dx, dy, dz = _world(hits, h, -hits[WO, h], -hits[WO + 1, h], -hits[WO + 2, h])
    _new_ray(k, BACK, h, dx, dy, dz, hits, rays)
    for row in range(3):
        lanes[LANE_BETA + row, k] = hits[BETA + row, h]
    lanes[LANE_PDF, k] = hits[BEFORE, h]
    lanes[LANE_WIDTH, k], lanes[LANE_SPREAD, k] = hits[WIDTH, h], hits[SPREAD, h]
    lane_tags[0, k], lane_tags[1, k] = tags[PATH, h], tags[DEPTH, h]


@njit(**INLINE)
def _scatter(estimator, k, h, hits, tags, rays, lanes, lane_tags, result):
    """The path's next ray at place `k`; 1 if there is one."""
    x, y, z = hits[GO, h], hits[GO + 1, h], hits[GO + 2, h]
    red, green, blue = hits[WEIGHT, h], hits[WEIGHT + 1, h], hits[WEIGHT + 2, h]
    pdf = hits[GO_PDF, h]
    if estimator == UNIFORM:
        x, y, z = hits[WI, h], hits[WI + 1, h], hits[WI + 2, h]
        pdf = hits[KEEP, h] * R(0.25 / math.pi)
        if pdf > R(0):
            red, green, blue = hits[F, h] / pdf, hits[F + 1, h] / pdf, hits[F + 2, h] / pdf
    if pdf <= R(0):
        return 0
    red, green, blue = red * hits[BETA, h], green * hits[BETA + 1, h], blue * hits[BETA + 2, h]
    most = max(red, max(green, blue))
    if not (most < R(3e38)) or not (pdf < R(3e38)):
        result[2] += 1
        return 0
    # Russian roulette on what the path can still carry; paths that carry half or more go on.
    chance = min(R(1), R(2) * most)
    if hits[CHANCE + 3, h] >= chance:
        return 0
    inverse = R(1) / chance
    dx, dy, dz = _world(hits, h, x, y, z)
    _new_ray(k, FRONT if z >= R(0) else BACK, h, dx, dy, dz, hits, rays)
    lanes[LANE_BETA, k], lanes[LANE_BETA + 1, k] = red * inverse, green * inverse
    lanes[LANE_BETA + 2, k] = blue * inverse
    lanes[LANE_PDF, k] = UNSEEN if estimator in (SURFACE_ONLY, UNIFORM, LIGHT_ONLY) else pdf
    lanes[LANE_WIDTH, k] = hits[WIDTH, h]
    # A scattered ray stands for the share of directions that its pdf leaves to it.
    lanes[LANE_SPREAD, k] = max(hits[SPREAD, h], R(0.25) * math.sqrt(min(R(1) / pdf, R(4))))
    lane_tags[0, k], lane_tags[1, k] = tags[PATH, h], tags[DEPTH, h] + 1
    return 1


@njit(**LEAN)
def record_first(count, eye, view, hits, tags, uv, film):
    """Write the properties of first surfaces, for the AOVs."""
    for h in range(count):
        if tags[DEPTH, h] != 0 or hits[GO_PDF, h] < R(0):
            continue
        path = tags[PATH, h]
        distance = R(0)
        for row in range(3):
            film[ALBEDO + row, path] = hits[WEIGHT + row, h] if hits[GO_PDF, h] > R(0) else R(0)
            film[NORMAL + row, path] = hits[N + row, h]
            film[TANGENT + row, path] = hits[U + row, h]
            distance += (hits[FRONT + row, h] - eye[row]) * view[row]
        film[DEPTH_Z, path] = distance
        film[THREAD_ID, path] = hits[THREAD, h]
        film[AT_LEVEL, path] = R(tags[LEVEL, h])
        corner = uv[tags[TRIANGLE, h]]
        b, c = hits[CORNERS, h], hits[CORNERS + 1, h]
        for row in range(2):
            film[UV + row, path] = (
                (R(1) - b - c) * corner[row] + b * corner[row + 2] + c * corner[row + 4]
            )


@njit(**LEAN)
def settle(count, shadow_rays, shadow, shadow_path, film, aovs):
    """Add what unblocked shadow rays bring."""
    for k in range(count):
        path = shadow_path[k]
        row = DIRECT
        if path < 0:
            path, row = -path - 1, INDIRECT
        if shadow_rays[k >> 4, TFAR, k & 15] < R(0):
            continue
        if aovs and row == DIRECT:
            film[LIT, path] += shadow[0, k] + shadow[1, k] + shadow[2, k]
        film[row, path] += shadow[0, k]
        film[row + 1, path] += shadow[1, k]
        film[row + 2, path] += shadow[2, k]


@njit(**LEAN)
def thin_out(count, rays, shadow, shadow_path, opacity, surfaces, triangle_material, records,
             epsilon, aovs, film):  # fmt: skip
    """Let shadow rays through what is not opaque, after `intersect`.

    Rays that met nothing are settled; those that met something opaque end; the others are
    weakened and go on behind it. opacity : (materials,) float32 - constant of each material, below
    0 where it varies over the surface. Returns how many go on, packed to the front.
    """
    whole = rays.view(np.uint32)
    left = 0
    for k in range(count):
        p, lane = k >> 4, k & 15
        path = shadow_path[k]
        row = DIRECT if path >= 0 else INDIRECT
        column = path if path >= 0 else -path - 1
        if whole[p, GEOMETRY, lane] == MISS:
            for j in range(3):
                film[row + j, column] += shadow[j, k]
            if aovs and row == DIRECT:
                film[LIT, column] += shadow[0, k] + shadow[1, k] + shadow[2, k]
            continue
        triangle = whole[p, PRIMITIVE, lane]
        material = triangle_material[triangle]
        record = records[triangle]
        u, v = rays[p, HIT_U, lane], rays[p, HIT_V, lane]
        blocked = opacity[material]
        if blocked < R(0):
            blocked = opacity_at(
                surfaces, material,
                record[ST] + u * record[D1] + v * record[D2],
                record[ST + 1] + u * record[D1 + 1] + v * record[D2 + 1],
            )  # fmt: skip
        through = R(1) - blocked
        if through <= R(1e-4):
            continue
        rest = rays[p, TFAR, lane]
        q, place = left >> 4, left & 15
        end = shadow[3, k]
        for j in range(3):
            shadow[j, left] = through * shadow[j, k]
        shadow_path[left] = path
        dx, dy, dz = rays[p, DX, lane], rays[p, DY, lane], rays[p, DZ, lane]
        x = record[P0] + u * record[E1] + v * record[E2]
        y = record[P0 + 1] + u * record[E1 + 1] + v * record[E2 + 1]
        z = record[P0 + 2] + u * record[E1 + 2] + v * record[E2 + 2]
        rays[q, OX, place], rays[q, OY, place], rays[q, OZ, place] = x, y, z
        rays[q, DX, place], rays[q, DY, place], rays[q, DZ, place] = dx, dy, dz
        rays[q, TNEAR, place] = R(8) * epsilon + R(4e-6) * max(abs(x), max(abs(y), abs(z)))
        rays[q, TFAR, place] = end if end >= FAR else end - rest
        shadow[3, left] = rays[q, TFAR, place]
        whole[q, GEOMETRY, place] = MISS
        left += 1
    for k in range(left, ((left + 15) >> 4) << 4):
        rays[k >> 4, TNEAR, k & 15] = R(0)
        rays[k >> 4, TFAR, k & 15] = R(-1)
    return left
