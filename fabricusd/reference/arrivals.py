"""From traced rays to hits: light that arrived, and surfaces made ready for shading.

Rays that met a light add it, weighted against light sampling by the power heuristic [Veach1997].
Rays that met a surface become hits, sorted by material and level so that each is shaded in one
loop.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fabricusd.appearance.footprint import level_weights, pick_level
from fabricusd.appearance.real import LEAN
from fabricusd.reference.counter import four_uniform
from fabricusd.reference.embree import (
    DX,
    DY,
    DZ,
    GEOMETRY,
    HIT_U,
    HIT_V,
    MISS,
    NGX,
    NGY,
    NGZ,
    OX,
    OY,
    OZ,
    PRIMITIVE,
    TFAR,
)  # fmt: skip
from fabricusd.reference.lights import KIND, VISIBLE, choose_light, hit_light, sample_light
from fabricusd.reference.preview_surface import emission_at
from fabricusd.reference.scene import DOME
from fabricusd.reference.triangles import D1, D2, E1, E2, HAND, P0, RATE, ST
from fabricusd.reference.triangles import N as NORMALS
from fabricusd.reference.triangles import T as TANGENTS
from fabricusd.reference.wave import (
    BACK,
    BEFORE,
    BETA,
    CHANCE,
    CORNERS,
    DEPTH,
    DIRECT,
    DISTANCE,
    FAR_LEVEL,
    FOOTPRINT,
    FRONT,
    INDIRECT,
    LANE_BETA,
    LANE_PDF,
    LANE_SPREAD,
    LANE_WIDTH,
    LEVEL,
    LIGHT,
    LIGHT_PDF,
    MATERIAL,
    PATH,
    PLACE,
    SIDE,
    SPREAD,
    TO_LIGHT,
    WI,
    WIDTH,
    WO,
    N,
    U,
    V,
)  # fmt: skip
from fabricusd.reference.wave import PRIMITIVE as TRIANGLE

R = np.float32
FAR = R(1e30)

MIS, LIGHT_ONLY, SURFACE_ONLY, UNIFORM = range(4)
"""Estimators of the same integral: both samplings, either, or uniform over all directions."""

AUTO_LEVEL = 3
NUMBERS_PER_STEP = 4
"""Counters that a step of a path may use, see `counter.four_uniform`."""

QUEUES = 6
"""Queues of a material: three levels, two sides."""


@njit(**LEAN)
def arrive(step, max_depth, estimator, count, rays, lanes, lane_tags, lights, dome, film, keys,
           triangle_material, repeats, records, level, pixels, samples, first,
           seed, counts):  # fmt: skip
    """Add the light that rays met, and give each lane that goes on the key of its queue, else -1.

    repeats : (materials, 2) float32 - ends and picks of a fabric's repeat, 0 where the surface has
    no levels. counts : (QUEUES materials,) int64, filled with the length of each queue, which is
    keyed by `(3 material + level) 2 + back`.
    """
    counts[:] = 0
    whole = rays.view(np.uint32)
    for k in range(count):
        p, lane = k >> 4, k & 15
        missed = whole[p, GEOMETRY, lane] == MISS
        depth = lane_tags[1, k]
        dx, dy, dz = rays[p, DX, lane], rays[p, DY, lane], rays[p, DZ, lane]
        reach = FAR if missed else rays[p, TFAR, lane]
        if (depth == 0 or estimator != LIGHT_ONLY) and (missed or lights.shape[0] > 0):
            _meet_lights(
                k, depth, estimator, lights, dome, reach, lanes, lane_tags, film,
                rays[p, OX, lane], rays[p, OY, lane], rays[p, OZ, lane], dx, dy, dz,
            )  # fmt: skip
        if missed or depth > max_depth:
            # A path at its last depth still sees lights; emission of surfaces is left to `prepare`.
            keys[k] = -1
            continue
        triangle = whole[p, PRIMITIVE, lane]
        material = triangle_material[triangle]
        nx, ny, nz = rays[p, NGX, lane], rays[p, NGY, lane], rays[p, NGZ, lane]
        cosine = dx * nx + dy * ny + dz * nz
        back = 1 if cosine > R(0) else 0
        queue = FAR_LEVEL
        if repeats[material, 0] > R(0):
            queue = level
            if level == AUTO_LEVEL:
                width = lanes[LANE_WIDTH, k] + reach * lanes[LANE_SPREAD, k]
                path = lane_tags[0, k]
                u, _, _, _ = four_uniform(
                    np.uint32(pixels[path // samples]),
                    np.uint32(first + path % samples),
                    np.uint32(2 + NUMBERS_PER_STEP * step + 2),
                    seed,
                )
                inverse = (nx * nx + ny * ny + nz * nz) / max(cosine * cosine, R(1e-30))
                record = records[triangle]
                queue = _level_of(record, width, inverse, repeats[material], dx, dy, dz, u)
        keys[k] = (3 * material + queue) * 2 + back
        counts[keys[k]] += 1


@njit(**LEAN)
def _level_of(record, width, inverse, repeat, dx, dy, dz, u):
    """Level for a ray's cone of `width` where `inverse` is one over the squared cosine."""
    # A cone's cut with the surface is longer along the ray than across it.
    a = dx * record[TANGENTS] + dy * record[TANGENTS + 1] + dz * record[TANGENTS + 2]
    along, flat = a * a * inverse, inverse - R(1)
    extent_u = width * record[RATE] * math.sqrt(R(1) + along)
    extent_v = width * record[RATE + 1] * math.sqrt(R(1) + max(flat - along, R(0)))
    far, weave, _ = level_weights(R, repeat[0], repeat[1], extent_u, extent_v)
    level, _ = pick_level(R, far, weave, u)
    return level


@njit(**LEAN)
def _meet_lights(k, depth, estimator, lights, dome, reach, lanes, lane_tags, film,
                 ox, oy, oz, dx, dy, dz):  # fmt: skip
    """Add what the ray of lane `k` sees of every light before `reach`."""
    before = lanes[LANE_PDF, k]
    red, green, blue = R(0), R(0), R(0)
    for j in range(lights.shape[0]):
        light = lights[j]
        if depth == 0 and light[VISIBLE] == R(0):
            continue
        r, g, b, pdf = hit_light(light, dome, ox, oy, oz, dx, dy, dz, reach)
        if pdf <= R(0):
            continue
        weight = R(1)
        if estimator == 0 and before > R(0):
            ratio = pdf / before
            weight = R(1) / (R(1) + ratio * ratio)
        red, green, blue = red + weight * r, green + weight * g, blue + weight * b
    if red + green + blue > R(0):
        path = lane_tags[0, k]
        row = DIRECT if depth <= 1 else INDIRECT
        film[row, path] += red * lanes[LANE_BETA, k]
        film[row + 1, path] += green * lanes[LANE_BETA + 1, k]
        film[row + 2, path] += blue * lanes[LANE_BETA + 2, k]


@njit(**LEAN)
def prepare(step, estimator, count, rays, lanes, lane_tags, keys, offsets, records, lights, dome,
            surfaces, epsilon, pixels, samples, first, seed, film, hits, tags):  # fmt: skip
    """Turn each lane with a key into a hit at the next place of its queue.

    offsets : (queues,) int64 - where each queue starts; advanced to where it ends.
    """
    whole = rays.view(np.uint32)
    for k in range(count):
        key = keys[k]
        if key < 0:
            continue
        h = offsets[key]
        offsets[key] = h + 1
        p, lane = k >> 4, k & 15
        triangle = whole[p, PRIMITIVE, lane]
        record = records[triangle]
        path = lane_tags[0, k]
        tags[PATH, h], tags[DEPTH, h] = path, lane_tags[1, k]
        tags[TRIANGLE, h], tags[MATERIAL, h], tags[LEVEL, h] = triangle, key // 6, (key // 2) % 3
        dx, dy, dz = rays[p, DX, lane], rays[p, DY, lane], rays[p, DZ, lane]
        u, v = rays[p, HIT_U, lane], rays[p, HIT_V, lane]
        cosine = _frame(record, u, v, dx, dy, dz, epsilon, hits, h)
        for row in range(3):
            hits[BETA + row, h] = lanes[LANE_BETA + row, k]
        hits[BEFORE, h] = lanes[LANE_PDF, k]
        width = lanes[LANE_WIDTH, k] + rays[p, TFAR, lane] * lanes[LANE_SPREAD, k]
        hits[WIDTH, h], hits[SPREAD, h] = width, lanes[LANE_SPREAD, k]
        hits[FOOTPRINT, h] = width * record[RATE]
        hits[CORNERS, h], hits[CORNERS + 1, h] = u, v
        pixel = np.uint32(pixels[path // samples])
        sample = np.uint32(first + path % samples)
        dimension = np.uint32(2 + NUMBERS_PER_STEP * step)
        c0, c1, c2, c3 = four_uniform(pixel, sample, dimension, seed)
        hits[CHANCE, h], hits[CHANCE + 1, h] = c0, c1
        hits[CHANCE + 2, h], hits[CHANCE + 3, h] = c2, c3
        c0, c1, c2, c3 = four_uniform(pixel, sample, dimension + np.uint32(1), seed)
        _choose_direction(estimator, lights, dome, c0, c1, c2, c3, hits, h)
        red, green, blue = emission_at(surfaces, key // 6, hits[PLACE, h], hits[PLACE + 1, h])
        if red + green + blue > R(0) and cosine > R(0):
            row = DIRECT if lane_tags[1, k] <= 1 else INDIRECT
            film[row, path] += red * hits[BETA, h]
            film[row + 1, path] += green * hits[BETA + 1, h]
            film[row + 2, path] += blue * hits[BETA + 2, h]


@njit(**LEAN)
def _frame(record, u, v, dx, dy, dz, epsilon, hits, h):
    """Write place, frame and the origins of new rays; returns the cosine to the true normal."""
    w = R(1) - u - v
    ax, ay, az = record[E1], record[E1 + 1], record[E1 + 2]
    bx, by, bz = record[E2], record[E2 + 1], record[E2 + 2]
    # From the first corner; the corners' own offsets below are exact differences.
    rx, ry, rz = u * ax + v * bx, u * ay + v * by, u * az + v * bz
    px, py, pz = record[P0] + rx, record[P0 + 1] + ry, record[P0 + 2] + rz
    gx, gy, gz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    inverse = R(1) / math.sqrt(max(gx * gx + gy * gy + gz * gz, R(1e-38)))
    gx, gy, gz = gx * inverse, gy * inverse, gz * inverse
    cosine = -(gx * dx + gy * dy + gz * dz)
    side = R(1) if cosine >= R(0) else R(-1)
    n0x, n0y, n0z = record[NORMALS], record[NORMALS + 1], record[NORMALS + 2]
    n1x, n1y, n1z = record[NORMALS + 3], record[NORMALS + 4], record[NORMALS + 5]
    n2x, n2y, n2z = record[NORMALS + 6], record[NORMALS + 7], record[NORMALS + 8]
    # [Hanika2021]: the point lifted to the corners' tangent planes, so that the smooth surface's
    # terminator is not cut into the triangles. One lift for each side of the cloth.
    e0 = rx * n0x + ry * n0y + rz * n0z
    e1 = (rx - ax) * n1x + (ry - ay) * n1y + (rz - az) * n1z
    e2 = (rx - bx) * n2x + (ry - by) * n2y + (rz - bz) * n2z
    u0, u1, u2 = w * min(e0, R(0)), u * min(e1, R(0)), v * min(e2, R(0))
    d0, d1, d2 = w * max(e0, R(0)), u * max(e1, R(0)), v * max(e2, R(0))
    ox = px - u0 * n0x - u1 * n1x - u2 * n2x
    oy = py - u0 * n0y - u1 * n1y - u2 * n2y
    oz = pz - u0 * n0z - u1 * n1z - u2 * n2z
    qx = px - d0 * n0x - d1 * n1x - d2 * n2x
    qy = py - d0 * n0y - d1 * n1y - d2 * n2y
    qz = pz - d0 * n0z - d1 * n1z - d2 * n2z
    if side < R(0):
        ox, oy, oz, qx, qy, qz = qx, qy, qz, ox, oy, oz
    # As much as rounding may move the point, along the true normal.
    offset = side * (epsilon + R(1e-6) * max(abs(px), max(abs(py), abs(pz))))
    hits[FRONT, h], hits[BACK, h] = ox + offset * gx, qx - offset * gx
    hits[FRONT + 1, h], hits[BACK + 1, h] = oy + offset * gy, qy - offset * gy
    hits[FRONT + 2, h], hits[BACK + 2, h] = oz + offset * gz, qz - offset * gz
    nx, ny = w * n0x + u * n1x + v * n2x, w * n0y + u * n1y + v * n2y
    nz = w * n0z + u * n1z + v * n2z
    inverse = side / math.sqrt(max(nx * nx + ny * ny + nz * nz, R(1e-38)))
    nx, ny, nz = nx * inverse, ny * inverse, nz * inverse
    if -(nx * dx + ny * dy + nz * dz) <= R(1e-4):
        # The smooth normal looks away although the triangle does not.
        nx, ny, nz = side * gx, side * gy, side * gz
    tx = w * record[TANGENTS] + u * record[TANGENTS + 3] + v * record[TANGENTS + 6]
    ty = w * record[TANGENTS + 1] + u * record[TANGENTS + 4] + v * record[TANGENTS + 7]
    tz = w * record[TANGENTS + 2] + u * record[TANGENTS + 5] + v * record[TANGENTS + 8]
    d = tx * nx + ty * ny + tz * nz
    tx, ty, tz = tx - d * nx, ty - d * ny, tz - d * nz
    square = tx * tx + ty * ty + tz * tz
    if square < R(1e-12):
        tx, ty, tz = (R(0), nz, -ny) if abs(nx) < R(0.7) else (-nz, R(0), nx)
        square = tx * tx + ty * ty + tz * tz
    inverse = R(1) / math.sqrt(square)
    tx, ty, tz = tx * inverse, ty * inverse, tz * inverse
    hand = record[HAND]
    vx, vy, vz = hand * (ny * tz - nz * ty), hand * (nz * tx - nx * tz), hand * (nx * ty - ny * tx)
    hits[N, h], hits[N + 1, h], hits[N + 2, h] = nx, ny, nz
    hits[U, h], hits[U + 1, h], hits[U + 2, h] = tx, ty, tz
    hits[V, h], hits[V + 1, h], hits[V + 2, h] = vx, vy, vz
    hits[WO, h] = -(dx * tx + dy * ty + dz * tz)
    hits[WO + 1, h] = -(dx * vx + dy * vy + dz * vz)
    hits[WO + 2, h] = -(dx * nx + dy * ny + dz * nz)
    hits[SIDE, h] = side
    hits[PLACE, h] = record[ST] + u * record[D1] + v * record[D2]
    hits[PLACE + 1, h] = record[ST + 1] + u * record[D1 + 1] + v * record[D2 + 1]
    return cosine


@njit(**LEAN)
def _choose_direction(estimator, lights, dome, c0, c1, c2, c3, hits, h):
    """Write the direction to a light, what arrives from there, and its pdf."""
    hits[LIGHT_PDF, h] = R(0)
    hits[DISTANCE, h] = FAR
    hits[LIGHT, h], hits[LIGHT + 1, h], hits[LIGHT + 2, h] = R(0), R(0), R(0)
    if estimator == UNIFORM:
        z = R(1) - R(2) * c1
        r = math.sqrt(max(R(1) - z * z, R(0)))
        phi = R(2 * math.pi) * c2
        hits[WI, h], hits[WI + 1, h], hits[WI + 2, h] = r * math.cos(phi), r * math.sin(phi), z
        return
    hits[WI, h], hits[WI + 1, h], hits[WI + 2, h] = R(0), R(0), R(1)
    if lights.shape[0] == 0 or estimator == SURFACE_ONLY:
        return
    light = lights[choose_light(lights, c0)]
    dx, dy, dz, distance, red, green, blue, pdf = sample_light(
        light, dome, hits[FRONT, h], hits[FRONT + 1, h], hits[FRONT + 2, h], c1, c2, c3
    )
    if pdf == R(0):
        return
    inverse = R(1) / abs(pdf)
    hits[WI, h] = dx * hits[U, h] + dy * hits[U + 1, h] + dz * hits[U + 2, h]
    hits[WI + 1, h] = dx * hits[V, h] + dy * hits[V + 1, h] + dz * hits[V + 2, h]
    hits[WI + 2, h] = dx * hits[N, h] + dy * hits[N + 1, h] + dz * hits[N + 2, h]
    hits[TO_LIGHT, h], hits[TO_LIGHT + 1, h], hits[TO_LIGHT + 2, h] = dx, dy, dz
    hits[DISTANCE, h] = distance if light[KIND] != R(DOME) else FAR
    hits[LIGHT, h], hits[LIGHT + 1, h] = red * inverse, green * inverse
    hits[LIGHT + 2, h] = blue * inverse
    hits[LIGHT_PDF, h] = pdf
