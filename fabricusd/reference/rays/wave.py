"""The arrays of one batch of paths: structure of arrays, float32, reused from batch to batch.

A *path* is one sample of one pixel and keeps its place in the batch. A *lane* is a live ray of a
path; lanes are packed anew at every step, in step with the packets of `embree`. A *hit* is a lane
that met a surface; hits are sorted by what has to be evaluated there.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fabricusd.appearance import levels
from fabricusd.reference.rays.embree import aligned_empty, new_packets

# Rows of `Wave.hits`. FRONT and BACK are where rays leave on the viewer's side and on the other;
# N, U, V the surface frame in the world; WO, WI, GO directions in that frame: to the viewer, to
# the chosen light, and the sampled one. PLACE is UV or weave coordinates, FOOTPRINT the width of
# the ray's cone in those, SIDE 1 on the front and -1 on the back. LIGHT is radiance over pdf; F is
# f times cosine [1/sr] towards the light and F_PDF the surface's own pdf of that direction. WEIGHT
# is f times cosine over the pdf of GO. A GO_PDF of 0 ends the path, below 0 lets it go straight
# on; KEEP is the chance of not going straight on, and GO_PDF includes it. CHANCE has four uniform
# numbers, of which the last decides on going on and then on ending. THREAD is -1 where there is
# none; CORNERS the hit's barycentric coordinates.
(FRONT, BACK, N, U, V, WO, PLACE, FOOTPRINT, SIDE, BETA, WIDTH, SPREAD, BEFORE) = (
    0, 3, 6, 9, 12, 15, 18, 20, 21, 22, 25, 26, 27,
)  # fmt: skip
(
    WI, TO_LIGHT, DISTANCE, LIGHT, LIGHT_PDF, F, F_PDF, GO, WEIGHT, GO_PDF, CHANCE, KEEP, THREAD,
    CORNERS,
) = (
    28, 31, 34, 35, 38, 39, 42, 43, 46, 49, 50, 54, 55, 56,
)  # fmt: skip
HIT_ROWS = 58

# Rows of `Wave.tags`.
PATH, DEPTH, PRIMITIVE, MATERIAL, LEVEL = range(5)

# Rows of `Wave.lanes`: throughput, pdf of the ray's direction (below 0: nothing else samples it),
# width and spread of its cone.
LANE_BETA, LANE_PDF, LANE_WIDTH, LANE_SPREAD = 0, 3, 4, 5

# Rows of `Wave.film`, one column a path: radiance in two parts, whether the cloth was met, and the
# first surface's properties.
(DIRECT, INDIRECT, ALPHA, ALBEDO, NORMAL, DEPTH_Z, UV, THREAD_ID, TANGENT, LIT, UNLIT, AT_LEVEL) = (
    0, 3, 6, 7, 10, 13, 14, 16, 17, 20, 21, 22,
)  # fmt: skip
FILM_ROWS = 23
BEAUTY_ROWS = 7
"""Rows that every picture needs; the rest only where an AOV asks for them."""

FAR_LEVEL, WEAVE_LEVEL, THREAD_LEVEL = levels.FAR, levels.WEAVE, levels.THREAD

ROW_PADDING = 80
"""Numbers between rows: five cache lines, prime to the number of a cache's sets."""


class Wave:
    """Buffers for up to `capacity` paths, owned by one worker."""

    def __init__(self, capacity: int, *, aovs: bool) -> None:
        self.capacity = capacity
        self.rays = new_packets(capacity)
        self.shadow_rays = new_packets(capacity)
        self.next_rays = new_packets(capacity)
        # Rows a power of two apart would all fall into the same few lines of a cache.
        row = capacity + ROW_PADDING
        self.lanes = aligned_empty((6, row))
        self.next_lanes = aligned_empty((6, row))
        self.lane_tags = aligned_empty((2, row), np.int32)
        self.next_tags = aligned_empty((2, row), np.int32)
        self.hits = aligned_empty((HIT_ROWS, row))
        self.tags = aligned_empty((5, row), np.int32)
        self.keys = aligned_empty((capacity,), np.int32)
        self.order = aligned_empty((capacity,), np.int32)
        self.path_pixel = aligned_empty((capacity,), np.uint32)
        self.path_sample = aligned_empty((capacity,), np.uint32)
        self.shadow = aligned_empty((4, row))
        self.shadow_path = aligned_empty((capacity,), np.int32)
        self.film = aligned_empty((FILM_ROWS if aovs else BEAUTY_ROWS, row))
        self.scratch: Any = None

    def swap(self) -> None:
        """Make what the last step spawned the rays of the next one."""
        self.rays, self.next_rays = self.next_rays, self.rays
        self.lanes, self.next_lanes = self.next_lanes, self.lanes
        self.lane_tags, self.next_tags = self.next_tags, self.lane_tags
