"""The stage before shading: gives each hit its surface frame, random numbers and a light sample."""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.kernels.real import INLINE, KERNEL, LEAN, PART, whole
from fabricusd.reference.lights.sampling import (
    choose_lights,
    no_lights,
    sample_evenly,
    sample_lights,
)
from fabricusd.reference.rays.embree import DX, HIT_U, HIT_V, PRIMITIVE, TFAR
from fabricusd.reference.rays.hit_frames import (
    BLOCK_ROWS,
    CHOSEN,
    MADE,
    NUMBERS,
    RAY,
    TAKEN,
    make_frames,
    make_numbers,
)
from fabricusd.reference.rays.sobol import third_number
from fabricusd.reference.rays.triangles import RECORD
from fabricusd.reference.rays.wave import (
    BEFORE,
    BETA,
    BLOCK,
    CHANCE,
    CORNERS,
    DEPTH,
    DIRECT,
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
    THROUGH,
    WI,
    WIDTH,
)
from fabricusd.reference.rays.wave import PRIMITIVE as TRIANGLE
from fabricusd.reference.stages.arrivals import NUMBERS_PER_STEP, SURFACE_ONLY, UNIFORM
from fabricusd.reference.surfaces.preview import emission_at

R = np.float32


@njit(**KERNEL)
def prepare(step, settings, queue_ends, lanes, queues, paths, numbers, triangles, lights, epsilon,
            hits):  # fmt: skip
    """Turn the lanes of `queues` into hits; within a block, hits of the same light lie together.

    queue_ends : (queues,) int64 - where each queue ends; no block holds hits of two queues
    """
    estimator, (table, dome) = settings.estimator, lights
    block = np.empty(BLOCK_ROWS * BLOCK, np.float32)
    lane_of, choice = np.empty(2 * BLOCK, np.int32), np.empty(BLOCK, np.int32)
    counters, uniform = np.empty(4 * BLOCK, np.uint32), np.empty(BLOCK, np.float32)
    light_ends = np.empty(max(table.shape[0], 1), np.int32)
    sampled = estimator != UNIFORM and estimator != SURFACE_ONLY and table.shape[0] > 0
    place = np.uint32(2 + NUMBERS_PER_STEP * step)
    start = np.int64(0)
    for queue in range(queue_ends.shape[0]):
        queue_end = whole(queue_ends[queue])
        while start < queue_end:
            size = min(BLOCK, queue_end - start)
            _begin(start, size, queues, lanes, paths, lane_of, counters)
            _choose(table, numbers, place, size, counters, uniform, choice)
            _group(size, choice, light_ends, lane_of, counters)
            for x in range(size):
                _take(whole(lane_of[x]), start + x, x, lanes, queues, triangles, block, hits)
            make_frames(size, epsilon, block)
            make_numbers(numbers, size, place, counters, block)
            if sampled:
                sample_lights(table, dome, light_ends, size, block)
            elif estimator == UNIFORM:
                sample_evenly(size, block)
            else:
                no_lights(size, block)
            _bring(start, size, block, hits)
            start += size


@njit(**PART)
def _begin(start, size, queues, lanes, paths, lane_of, counters):
    """Load a block's lanes and their paths' counters into the upper halves of both arrays."""
    order, tags, path_pixel, path_sample = queues.order, lanes.tags, paths.pixel, paths.sample
    for x in range(size):
        lane = whole(order[start + x])
        path = whole(tags[0, lane])
        lane_of[BLOCK + x] = lane
        counters[2 * BLOCK + x], counters[3 * BLOCK + x] = path_pixel[path], path_sample[path]


@njit(**PART)
def _choose(lights, numbers, place, size, counters, uniform, choice):
    """Choose a light for each lane by the number that `make_numbers` later computes again."""
    if lights.shape[0] > 1:
        following = np.uint32(place + np.uint32(1))
        for x in range(size):
            uniform[x] = third_number(
                numbers, counters[2 * BLOCK + x], counters[3 * BLOCK + x], following
            )
    choose_lights(lights, size, uniform, choice)


@njit(**PART)
def _group(size, choice, ends, lane_of, counters):
    """Sort the lanes by light into the lower halves; `ends` is where each light's lanes end."""
    for j in range(ends.shape[0]):
        ends[j] = 0
    for x in range(size):
        ends[whole(choice[x])] += 1
    total = np.int32(0)
    for j in range(ends.shape[0]):
        found = ends[j]
        ends[j] = total
        total += found
    for x in range(size):
        j = whole(choice[x])
        y = whole(ends[j])
        ends[j] = y + 1
        lane_of[y] = lane_of[BLOCK + x]
        counters[y], counters[BLOCK + y] = counters[2 * BLOCK + x], counters[3 * BLOCK + x]


@njit(**INLINE)
def _take(k, h, x, lanes, queues, triangles, block, hits):
    """Copy lane `k` to hit `h`, and the inputs of what is computed to place `x` of the block."""
    rays, rows, lane_tags = lanes.rays, lanes.rows, lanes.tags
    into, tags, records = hits.rows, hits.tags, triangles.records
    bits = rays.view(np.uint32)
    p, lane = k >> 4, k & 15
    triangle, key = bits[p, PRIMITIVE, lane], whole(queues.keys[k])
    tags[PATH, h], tags[DEPTH, h] = lane_tags[0, k], lane_tags[1, k]
    tags[THROUGH, h] = lane_tags[2, k]
    tags[TRIANGLE, h], tags[MATERIAL, h], tags[LEVEL, h] = triangle, key // 6, (key // 2) % 3
    for row in range(3):
        into[BETA + row, h] = rows[LANE_BETA + row, k]
    into[BEFORE, h] = rows[LANE_PDF, k]
    width = rows[LANE_WIDTH, k] + rays[p, TFAR, lane] * rows[LANE_SPREAD, k]
    into[WIDTH, h], into[SPREAD, h] = width, rows[LANE_SPREAD, k]
    into[CORNERS, h], into[CORNERS + 1, h] = rays[p, HIT_U, lane], rays[p, HIT_V, lane]
    for row in range(3):
        block[RAY + row * BLOCK + x] = rays[p, DX + row, lane]
    block[RAY + 3 * BLOCK + x] = rays[p, HIT_U, lane]
    block[RAY + 4 * BLOCK + x] = rays[p, HIT_V, lane]
    for column in range(RECORD):
        block[TAKEN + column * BLOCK + x] = records[triangle, column]
    block[MADE + FOOTPRINT * BLOCK + x] = width


@njit(**PART)
def _bring(start, size, block, hits):
    """Copy the block's frames, numbers and light samples to the hits."""
    rows = hits.rows
    _bring_rows(MADE, 0, SIDE + 1, start, size, block, rows)
    _bring_rows(NUMBERS, CHANCE, CHANCE + 4, start, size, block, rows)
    _bring_rows(CHOSEN, WI, LIGHT_PDF + 1, start, size, block, rows)


@njit(**INLINE)
def _bring_rows(source, first, end, start, size, block, rows):
    for row in range(first, end):
        into, at = rows[row][start:], whole(source + (row - first) * BLOCK)
        for x in range(size):
            into[x] = block[at + x]


@njit(**LEAN)
def add_emission(count, surfaces, hits, film):
    """Add the radiance that emissive surfaces send back along the ray from their front."""
    rows, tags = hits.rows, hits.tags
    for h in range(count):
        red, green, blue = emission_at(
            surfaces, tags[MATERIAL, h], rows[PLACE, h], rows[PLACE + 1, h]
        )
        if red + green + blue > R(0) and rows[SIDE, h] > R(0):
            row = DIRECT if tags[DEPTH, h] <= 1 else INDIRECT
            path = tags[PATH, h]
            film[row, path] += red * rows[BETA, h]
            film[row + 1, path] += green * rows[BETA + 1, h]
            film[row + 2, path] += blue * rows[BETA + 2, h]
