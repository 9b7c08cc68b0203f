"""From rays that met a surface to hits ready for shading: frames, numbers, a light for each."""

from __future__ import annotations

import numpy as np
from numba import njit

from fabricusd.appearance.real import INLINE, KERNEL, LEAN, PART
from fabricusd.reference.arrivals import NUMBERS_PER_STEP, SURFACE_ONLY, UNIFORM
from fabricusd.reference.embree import DX, HIT_U, HIT_V, PRIMITIVE, TFAR
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
from fabricusd.reference.preview_surface import emission_at
from fabricusd.reference.triangles import RECORD
from fabricusd.reference.wave import (
    BEFORE,
    BETA,
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
    WI,
    WIDTH,
)
from fabricusd.reference.wave import PRIMITIVE as TRIANGLE

R = np.float32


@njit(**KERNEL)
def prepare(step, estimator, count, rays, lanes, lane_tags, keys, order, records, lights, dome,
            epsilon, path_pixel, path_sample, numbers, hits, tags):  # fmt: skip
    """Turn the first `count` lanes of `order` into hits."""
    block = np.empty(BLOCK_ROWS * BLOCK, np.float32)
    counters = np.empty(2 * BLOCK, np.uint32)
    choice, where = np.empty(BLOCK, np.int32), np.empty(BLOCK + 1, np.int32)
    for start in range(0, count, BLOCK):
        size = min(BLOCK, count - start)
        for x in range(size):
            _take(order[start + x], start + x, x, rays, lanes, lane_tags, keys, records,
                  path_pixel, path_sample, block, counters, hits, tags)  # fmt: skip
        make_frames(size, epsilon, block)
        make_numbers(numbers, size, np.uint32(2 + NUMBERS_PER_STEP * step), counters, block)
        if estimator == UNIFORM:
            sample_evenly(size, block)
        elif estimator == SURFACE_ONLY or lights.shape[0] == 0:
            no_lights(size, block)
        else:
            sample_lights(lights, dome, size, choice, where, block)
        _bring(start, size, block, hits)


@njit(**INLINE)
def _take(k, h, x, rays, lanes, lane_tags, keys, records, path_pixel, path_sample, block, counters,
          hits, tags):  # fmt: skip
    """Lane `k` as hit `h`: what goes on unchanged, and place `x` of the block for what does not."""
    whole = rays.view(np.uint32)
    p, lane = k >> 4, k & 15
    triangle, key = whole[p, PRIMITIVE, lane], keys[k]
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


@njit(**PART)
def _bring(start, size, block, hits):
    """Bring the block's frames, numbers and lights to the hits."""
    _bring_rows(MADE, 0, SIDE + 1, start, size, block, hits)
    _bring_rows(NUMBERS, CHANCE, CHANCE + 4, start, size, block, hits)
    _bring_rows(CHOSEN, WI, LIGHT_PDF + 1, start, size, block, hits)


@njit(**INLINE)
def _bring_rows(source, first, end, start, size, block, hits):
    for row in range(first, end):
        into, at = hits[row][start:], source + (row - first) * BLOCK
        for x in range(size):
            into[x] = block[at + x]


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
