"""The stage after tracing: adds the light that rays hit, and sorts surface hits into queues.

The light that a ray passes is added to its path, weighted against light sampling by the power
heuristic [Veach1997]. A ray that hit a surface gets the key of the queue in which the hit is
shaded. There is one queue for each material, level and side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from fabricusd.appearance.weave.footprint import level_weights, pick_level
from fabricusd.kernels.real import INLINE, KERNEL, PART, whole
from fabricusd.reference.lights.hits import meet_lights
from fabricusd.reference.lights.ray_block import (
    BEFORE,
    D_X,
    D_Y,
    D_Z,
    FIRST,
    LIGHT_ROWS,
    O_X,
    REACH,
    SEEN_B,
    SEEN_G,
    SEEN_R,
)
from fabricusd.reference.rays.embree import (
    DX,
    ENDLESS,
    GEOMETRY,
    INFINITE_DISTANCE,
    LANES,
    MISS,
    NGX,
    OX,
    PRIMITIVE,
    TFAR,
)
from fabricusd.reference.rays.sobol import four_numbers
from fabricusd.reference.rays.triangles import RATE
from fabricusd.reference.rays.triangles import T as TANGENTS
from fabricusd.reference.rays.wave import (
    BLOCK,
    DIRECT,
    FAR_LEVEL,
    INDIRECT,
    LANE_BETA,
    LANE_PDF,
    LANE_SPREAD,
    LANE_WIDTH,
)

R = np.float32

MIS, LIGHT_ONLY, SURFACE_ONLY, UNIFORM = range(4)
"""Estimators of the same integral: light and surface sampling combined, either one alone, or
uniform directions over the sphere."""

AUTO_LEVEL = 3


class Settings(NamedTuple):
    """What holds for all paths of a picture.

    estimator : MIS to UNIFORM; level : a level or AUTO_LEVEL
    max_depth, max_through : most bounces of a path, at translucent cloth and at all other surfaces
    """

    estimator: int
    level: int
    max_depth: int
    max_through: int


NUMBERS_PER_STEP = 4
"""Number of places that a step of a path may use, see `sobol.four_numbers`."""

QUEUES = 6
"""Queues per material: three levels times two sides."""

# Rows of a block after those of `ray_block`: the geometric normal and its cosine with the ray; for
# level `auto`, the gradients of both coordinates, the direction of increasing u, the limits, the
# cone's width, a uniform number, and the resulting level.
_NORMAL, _COSINE, _STEEP, _GRAIN, _LIMITS, _WIDTH, _NUMBER, _LEVEL = (
    (LIGHT_ROWS + row) * BLOCK for row in (0, 3, 4, 6, 9, 13, 14, 15)
)
_ROWS = LIGHT_ROWS + 16


@njit(**KERNEL)
def arrive(step, settings, count, lanes, paths, numbers, lights, triangles, limits, film, queues,
           ends, lost):  # fmt: skip
    """Add the light that rays hit, and sort the lanes that hit a surface into queues.

    limits : (materials, 4) float32 - `footprint.Limits.row` of a fabric, 0 for a surface without
        levels
    ends : (QUEUES materials,) int64 - filled with where each queue ends in `queues.order`; the key
        of a queue is `(3 material + level) 2 + back`, and -1 for a lane that ends
    lost : (1,) float64 - throughput of the lanes that a bound on bounces ends, added to
    """
    ends[:] = 0
    count = whole(count)
    table, dome = lights.table, lights.dome
    block = np.empty(_ROWS * BLOCK, np.float32)
    counters = np.empty(2 * BLOCK, np.uint32)
    for start in range(0, count, BLOCK):
        size = min(BLOCK, count - start)
        _load(start, size, lanes, block)
        meet_lights(table, dome, step == 0, size, block)
        _add_seen(start, size, settings.estimator, lanes, film, block)
        _turn(size, block)
        if settings.level == AUTO_LEVEL:
            _load_levels(start, size, lanes, paths, triangles, limits, counters, block)
            place = np.uint32(2 + NUMBERS_PER_STEP * step + 2)
            _choose_levels(numbers, place, size, counters, block)
        _give_keys(start, size, settings, lanes, triangles, limits, queues, ends, lost, block)
    _sort_lanes(count, queues, ends)


@njit(**PART)
def _load(start, size, lanes, block):
    rays = lanes.rays
    bits = rays.view(np.uint32)
    for x in range(0, size, LANES):
        packet, names = rays[(start + x) >> 4], bits[(start + x) >> 4]
        for row in range(3):
            for lane in range(LANES):
                block[O_X + row * BLOCK + x + lane] = packet[OX + row, lane]
            for lane in range(LANES):
                block[D_X + row * BLOCK + x + lane] = packet[DX + row, lane]
            for lane in range(LANES):
                block[_NORMAL + row * BLOCK + x + lane] = packet[NGX + row, lane]
        for lane in range(LANES):
            missed = names[GEOMETRY, lane] == MISS
            block[REACH + x + lane] = INFINITE_DISTANCE if missed else packet[TFAR, lane]
    before, depth = lanes.rows[LANE_PDF][start:], lanes.tags[1][start:]
    for x in range(size):
        block[BEFORE + x] = before[x]
    for x in range(size):
        block[FIRST + x] = R(1) if depth[x] == 0 else R(0)


@njit(**PART)
def _add_seen(start, size, estimator, lanes, film, block):
    """Add the radiance of lights that the rays passed to their paths."""
    rows, tags = lanes.rows, lanes.tags
    for x in range(size):
        red, green, blue = block[SEEN_R + x], block[SEEN_G + x], block[SEEN_B + x]
        k = start + x
        depth = tags[1, k]
        if red + green + blue <= R(0) or (depth > 0 and estimator == LIGHT_ONLY):
            continue
        path = whole(tags[0, k])
        row = DIRECT if depth <= 1 else INDIRECT
        film[row, path] += red * rows[LANE_BETA, k]
        film[row + 1, path] += green * rows[LANE_BETA + 1, k]
        film[row + 2, path] += blue * rows[LANE_BETA + 2, k]


@njit(**PART)
def _turn(size, block):
    """Dot product of each ray's direction with the geometric normal, which is not normalized."""
    for x in range(size):
        block[_COSINE + x] = (
            block[D_X + x] * block[_NORMAL + x]
            + block[D_Y + x] * block[_NORMAL + BLOCK + x]
            + block[D_Z + x] * block[_NORMAL + 2 * BLOCK + x]
        )


@njit(**PART)
def _load_levels(start, size, lanes, paths, triangles, limits, counters, block):
    """Load what level `auto` needs for each ray that hit a fabric; zeros for the other rays."""
    bits, rows, tags = lanes.rays.view(np.uint32), lanes.rows, lanes.tags
    path_pixel, path_sample = paths.pixel, paths.sample
    records, triangle_material = triangles.records, triangles.material
    for x in range(size):
        k = start + x
        path = whole(tags[0, k])
        counters[x], counters[BLOCK + x] = path_pixel[path], path_sample[path]
        for row in range(4):
            block[_LIMITS + row * BLOCK + x] = R(0)
        for row in range(2):
            block[_STEEP + row * BLOCK + x] = R(0)
        for row in range(3):
            block[_GRAIN + row * BLOCK + x] = R(0)
        block[_WIDTH + x] = R(0)
        if block[REACH + x] >= ENDLESS:
            continue
        triangle = bits[k >> 4, PRIMITIVE, k & 15]
        record, material = records[triangle], whole(triangle_material[triangle])
        for row in range(4):
            block[_LIMITS + row * BLOCK + x] = limits[material, row]
        for row in range(2):
            block[_STEEP + row * BLOCK + x] = record[RATE + row]
        for row in range(3):
            block[_GRAIN + row * BLOCK + x] = record[TANGENTS + row]
        block[_WIDTH + x] = rows[LANE_WIDTH, k] + block[REACH + x] * rows[LANE_SPREAD, k]


@njit(**PART)
def _choose_levels(numbers, place, size, counters, block):
    """Choose a level for each ray from the footprint of its cone and a uniform number."""
    for x in range(size):
        block[_NUMBER + x], _, _, _ = four_numbers(numbers, counters[x], counters[BLOCK + x], place)
    for x in range(size):
        nx, ny, nz = (
            block[_NORMAL + x], block[_NORMAL + BLOCK + x], block[_NORMAL + 2 * BLOCK + x],
        )  # fmt: skip
        square = block[_COSINE + x] * block[_COSINE + x]
        inverse = (nx * nx + ny * ny + nz * nz) / max(square, R(1e-30))
        # The cone's footprint on the surface is longer along the ray than across it.
        a = (
            block[D_X + x] * block[_GRAIN + x]
            + block[D_Y + x] * block[_GRAIN + BLOCK + x]
            + block[D_Z + x] * block[_GRAIN + 2 * BLOCK + x]
        )
        along, flat = a * a * inverse, inverse - R(1)
        width = block[_WIDTH + x]
        extent_u = width * block[_STEEP + x] * np.sqrt(R(1) + along)
        extent_v = width * block[_STEEP + BLOCK + x] * np.sqrt(R(1) + max(flat - along, R(0)))
        far, weave, _ = level_weights(
            R, max(block[_LIMITS + x], R(1e-6)), max(block[_LIMITS + BLOCK + x], R(1e-6)),
            block[_LIMITS + 2 * BLOCK + x], block[_LIMITS + 3 * BLOCK + x], extent_u, extent_v,
        )  # fmt: skip
        level, _ = pick_level(R, far, weave, block[_NUMBER + x])
        block[_LEVEL + x] = R(level)


@njit(**INLINE)
def throughput(rows, k):
    """What lane `k` still carries: the mean of its channels."""
    return R(1 / 3) * (rows[LANE_BETA, k] + rows[LANE_BETA + 1, k] + rows[LANE_BETA + 2, k])


@njit(**PART)
def _give_keys(start, size, settings, lanes, triangles, limits, queues, counts, lost, block):
    bits, tags, keys = lanes.rays.view(np.uint32), lanes.tags, queues.keys
    level, max_depth, triangle_material = settings.level, settings.max_depth, triangles.material
    max_through = settings.max_through
    for x in range(size):
        k = start + x
        if block[REACH + x] >= ENDLESS:
            keys[k] = -1
            continue
        # The ray beyond the last surface only sees lights; it is not shaded.
        if tags[1, k] - tags[2, k] > max_depth or tags[2, k] > max_through:
            keys[k] = -1
            lost[0] += throughput(lanes.rows, k)
            continue
        material = whole(triangle_material[bits[k >> 4, PRIMITIVE, k & 15]])
        queue = FAR_LEVEL
        if limits[material, 0] > R(0):
            queue = int(block[_LEVEL + x]) if level == AUTO_LEVEL else level
        key = (3 * material + queue) * 2 + (1 if block[_COSINE + x] > R(0) else 0)
        keys[k] = key
        counts[key] += 1


@njit(**INLINE)
def _advance(offsets, key):
    place = whole(offsets[key])
    offsets[key] = place + 1
    return place


@njit(**PART)
def _sort_lanes(count, queues, ends):
    """Write the numbers of the lanes that go on to `queues.order`, sorted by queue.

    ends : (queues,) int64 - the length of each queue; on return, where it ends
    """
    keys, order = queues.keys, queues.order
    total = np.int64(0)
    for queue in range(ends.shape[0]):
        length = ends[queue]
        ends[queue] = total
        total += length
    for k in range(count):
        if keys[k] >= 0:
            order[_advance(ends, whole(keys[k]))] = k
