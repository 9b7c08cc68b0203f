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
from fabricusd.appearance.real import INLINE, KERNEL, LEAN
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
from fabricusd.reference.hit_frames import (
    BLOCK,
    BLOCK_ROWS,
    CHOSEN,
    MADE,
    NUMBERS,
    RAY,
    TAKEN,
    make_frames,
    make_numbers,
)
from fabricusd.reference.light_sampling import no_lights, sample_evenly, sample_lights
from fabricusd.reference.lights import VISIBLE, hit_light
from fabricusd.reference.preview_surface import emission_at
from fabricusd.reference.sobol import four_numbers
from fabricusd.reference.triangles import RATE, RECORD
from fabricusd.reference.triangles import T as TANGENTS
from fabricusd.reference.wave import (
    BEFORE,
    BETA,
    CHANCE,
    CORNERS,
    DEPTH,
    DIRECT,
    FAR_LEVEL,
    FOOTPRINT,
    INDIRECT,
    LANE_BETA,
    LANE_PDF,
    LANE_SPREAD,
    LANE_WIDTH,
    LEVEL,
    LIGHT_PDF,
    MATERIAL,
    PATH,
    PLACE,
    SIDE,
    SPREAD,
    WI,
    WIDTH,
)  # fmt: skip
from fabricusd.reference.wave import PRIMITIVE as TRIANGLE

R = np.float32
FAR = R(1e30)

MIS, LIGHT_ONLY, SURFACE_ONLY, UNIFORM = range(4)
"""Estimators of the same integral: both samplings, either, or uniform over all directions."""

AUTO_LEVEL = 3
NUMBERS_PER_STEP = 4
"""Places that a step of a path may use, see `sobol.four_numbers`."""

QUEUES = 6
"""Queues of a material: three levels, two sides."""


@njit(**LEAN)
def arrive(step, max_depth, estimator, count, rays, lanes, lane_tags, lights, dome, film, keys,
           triangle_material, repeats, records, level, path_pixel, path_sample,
           numbers, counts):  # fmt: skip
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
                u, _, _, _ = four_numbers(
                    numbers, path_pixel[path], path_sample[path],
                    np.uint32(2 + NUMBERS_PER_STEP * step + 2),
                )  # fmt: skip
                inverse = (nx * nx + ny * ny + nz * nz) / max(cosine * cosine, R(1e-30))
                record = records[triangle]
                queue = _level_of(record, width, inverse, repeats[material], dx, dy, dz, u)
        keys[k] = (3 * material + queue) * 2 + back
        counts[keys[k]] += 1


@njit(**INLINE)
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


@njit(**INLINE)
def _meet_lights(k, depth, estimator, lights, dome, reach, lanes, lane_tags, film,
                 ox, oy, oz, dx, dy, dz):  # fmt: skip
    """Add what the ray of lane `k` sees of every light before `reach`."""
    before = lanes[LANE_PDF, k]
    red, green, blue = R(0), R(0), R(0)
    for j in range(lights.shape[0]):
        light = lights[j]
        if depth == 0 and light[VISIBLE] == R(0):
            continue
        r, g, b, pdf = hit_light(light, dome, depth == 0, ox, oy, oz, dx, dy, dz, reach)
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


@njit(**KERNEL)
def prepare(step, estimator, count, rays, lanes, lane_tags, keys, offsets, records, lights, dome,
            epsilon, path_pixel, path_sample, numbers, hits, tags):  # fmt: skip
    """Turn each lane with a key into a hit at the next place of its queue.

    offsets : (queues,) int64 - where each queue starts; advanced to where it ends.
    """
    block = np.empty(BLOCK_ROWS * BLOCK, np.float32)
    counters = np.empty(2 * BLOCK, np.uint32)
    places = np.empty(BLOCK, np.int64)
    choice, where = np.empty(BLOCK, np.int32), np.empty(BLOCK + 1, np.int32)
    k = 0
    while k < count:
        fill = 0
        while k < count and fill < BLOCK:
            key = keys[k]
            if key >= 0:
                h = offsets[key]
                offsets[key] = h + 1
                places[fill] = h
                _take(k, h, key, fill, rays, lanes, lane_tags, records, path_pixel, path_sample,
                      block, counters, hits, tags)  # fmt: skip
                fill += 1
            k += 1
        make_frames(fill, epsilon, block)
        make_numbers(numbers, fill, np.uint32(2 + NUMBERS_PER_STEP * step), counters, block)
        if estimator == UNIFORM:
            sample_evenly(fill, block)
        elif estimator == SURFACE_ONLY or lights.shape[0] == 0:
            no_lights(fill, block)
        else:
            sample_lights(lights, dome, fill, choice, where, block)
        _bring(fill, places, block, hits)


@njit(**INLINE)
def _take(k, h, key, x, rays, lanes, lane_tags, records, path_pixel, path_sample, block, counters,
          hits, tags):  # fmt: skip
    """Lane `k` as hit `h`: what goes on unchanged, and place `x` of the block for what does not."""
    whole = rays.view(np.uint32)
    p, lane = k >> 4, k & 15
    triangle = whole[p, PRIMITIVE, lane]
    path = lane_tags[0, k]
    tags[PATH, h], tags[DEPTH, h] = path, lane_tags[1, k]
    tags[TRIANGLE, h], tags[MATERIAL, h], tags[LEVEL, h] = triangle, key // 6, (key // 2) % 3
    for row in range(3):
        hits[BETA + row, h] = lanes[LANE_BETA + row, k]
    hits[BEFORE, h] = lanes[LANE_PDF, k]
    width = lanes[LANE_WIDTH, k] + rays[p, TFAR, lane] * lanes[LANE_SPREAD, k]
    hits[WIDTH, h], hits[SPREAD, h] = width, lanes[LANE_SPREAD, k]
    hits[CORNERS, h], hits[CORNERS + 1, h] = rays[p, HIT_U, lane], rays[p, HIT_V, lane]
    for row in range(3):
        block[RAY + row * BLOCK + x] = rays[p, DX + row, lane]
    block[RAY + 3 * BLOCK + x] = rays[p, HIT_U, lane]
    block[RAY + 4 * BLOCK + x] = rays[p, HIT_V, lane]
    for column in range(RECORD):
        block[TAKEN + column * BLOCK + x] = records[triangle, column]
    block[MADE + FOOTPRINT * BLOCK + x] = width
    counters[x], counters[BLOCK + x] = path_pixel[path], path_sample[path]


@njit(**INLINE)
def _bring(fill, places, block, hits):
    """Bring the block's frames, numbers and lights to their hits."""
    for x in range(fill):
        h = places[x]
        for row in range(SIDE + 1):
            hits[row, h] = block[MADE + row * BLOCK + x]
        for row in range(4):
            hits[CHANCE + row, h] = block[NUMBERS + row * BLOCK + x]
        for row in range(LIGHT_PDF + 1 - WI):
            hits[WI + row, h] = block[CHOSEN + row * BLOCK + x]


@njit(**LEAN)
def add_emission(count, surfaces, hits, tags, film):
    """Add what surfaces that shine by themselves send back along the ray, on their front."""
    for h in range(count):
        red, green, blue = emission_at(
            surfaces, tags[MATERIAL, h], hits[PLACE, h], hits[PLACE + 1, h]
        )
        if red + green + blue > R(0) and hits[SIDE, h] > R(0):
            row = DIRECT if tags[DEPTH, h] <= 1 else INDIRECT
            path = tags[PATH, h]
            film[row, path] += red * hits[BETA, h]
            film[row + 1, path] += green * hits[BETA + 1, h]
            film[row + 2, path] += blue * hits[BETA + 2, h]
