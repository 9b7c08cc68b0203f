"""The state of one batch of paths: float32 structures of arrays, reused from batch to batch.

A *path* is one sample of one pixel and keeps its index in the batch. A *lane* is the live ray of a
path; every step packs the lanes again, in the same order as the packets of `embree`. A *hit* is a
lane whose ray hit a surface; hits are sorted by material, level and side.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance import levels
from fabricusd.reference.rays.embree import aligned_empty, new_packets

# Rows of `Hits.rows`.
# FRONT, BACK: origins of new rays on the viewer's side and on the other side.
# N, U, V: the surface frame in world space. WO, WI, GO: directions in that frame, towards the
#     viewer, towards the chosen light, and the sampled direction.
# PLACE: UV or weave coordinates. FOOTPRINT: width of the ray's cone in these coordinates.
# SIDE: 1 on the front, -1 on the back. BETA: the path's throughput.
# WIDTH, SPREAD: of the ray's cone. BEFORE: pdf with which the ray that arrived was sampled.
# TO_LIGHT, DISTANCE: world direction and distance to the light. LIGHT: radiance over pdf.
# F: f times cosine towards the light [1/sr]. F_PDF: the surface's own pdf of that direction.
# WEIGHT: f times cosine over the pdf of GO. GO_PDF: that pdf; 0 ends the path, a negative value
#     lets it go straight on. KEEP: the chance of not going straight on, which GO_PDF includes.
# CHANCE: four uniform numbers; the last decides whether the path goes straight on and then whether
#     it ends. THREAD: the thread's number, -1 where there is none.
# CORNERS: the hit's barycentric coordinates.
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

# Rows of `Hits.tags`. DEPTH: all bounces of the path so far. THROUGH: those of them at translucent
# cloth.
PATH, DEPTH, PRIMITIVE, MATERIAL, LEVEL, THROUGH = range(6)

# Rows of `Lanes.rows`: throughput, pdf of the ray's direction (negative if light sampling does not
# compete with it), width and spread of the ray's cone.
LANE_BETA, LANE_PDF, LANE_WIDTH, LANE_SPREAD = 0, 3, 4, 5

# Rows of `Wave.film`, with one column per path: direct and indirect radiance, whether a surface was
# hit, and the properties of the first surface.
(DIRECT, INDIRECT, ALPHA, ALBEDO, NORMAL, DEPTH_Z, UV, THREAD_ID, TANGENT, LIT, UNLIT, AT_LEVEL) = (
    0, 3, 6, 7, 10, 13, 14, 16, 17, 20, 21, 22,
)  # fmt: skip
FILM_ROWS = 23
BEAUTY_ROWS = 7
"""Rows that every picture needs; the others are kept only if an AOV needs them."""

FAR_LEVEL, WEAVE_LEVEL, THREAD_LEVEL = levels.FAR, levels.WEAVE, levels.THREAD

BLOCK = 128
"""Number of lanes or hits that a stage processes at once: few enough for all rows of a block to
stay close to the first-level cache."""

ROW_PADDING = 80
"""Numbers of padding after each row: five cache lines, coprime to a cache's number of sets."""


class Lanes(NamedTuple):
    """The live rays of a batch.

    rays : (packets, ROWS, 16) float32 - as `embree` traces them
    rows : (6, n) float32 - rows LANE_BETA to LANE_SPREAD
    tags : (3, n) int32 - the lane's path, its depth, and its bounces at translucent cloth
    """

    rays: NDArray[np.float32]
    rows: NDArray[np.float32]
    tags: NDArray[np.int32]


class Paths(NamedTuple):
    """What selects the random numbers of each path: pixel, sample : (n,) uint32."""

    pixel: NDArray[np.uint32]
    sample: NDArray[np.uint32]


class Queues(NamedTuple):
    """The lanes that hit a surface, sorted by material, level and side.

    keys : (n,) int32 - number of each lane's queue, -1 for a lane that ends
    order : (n,) int32 - the other lanes, in the order of their queues
    """

    keys: NDArray[np.int32]
    order: NDArray[np.int32]


class Hits(NamedTuple):
    """The hits of a batch.

    rows : (HIT_ROWS, n) float32 - rows FRONT to CORNERS
    tags : (6, n) int32 - rows PATH to THROUGH
    """

    rows: NDArray[np.float32]
    tags: NDArray[np.int32]


class ShadowRays(NamedTuple):
    """The shadow rays of a batch.

    rays : (packets, ROWS, 16) float32 - as `embree` traces them
    light : (4, n) float32 - the radiance that an unblocked ray adds, and the ray's length [m]
    path : (n,) int32 - p for direct light of path p, -p - 1 for its indirect light
    """

    rays: NDArray[np.float32]
    light: NDArray[np.float32]
    path: NDArray[np.int32]


class Wave:
    """The buffers of one worker, for up to `capacity` paths.

    carried : the triangles that rays hit, see `placed.to_world`; None in a scene without instances
    """

    def __init__(self, capacity: int, *, aovs: bool) -> None:
        self.capacity = capacity
        # Rows at a distance of a power of two would all map to the same few cache lines.
        row = capacity + ROW_PADDING
        self.lanes, self.next_lanes = (
            Lanes(new_packets(capacity), aligned_empty((6, row)), aligned_empty((3, row), np.int32))
            for _ in range(2)
        )
        self.paths = Paths(*(aligned_empty((capacity,), np.uint32) for _ in range(2)))
        self.queues = Queues(*(aligned_empty((capacity,), np.int32) for _ in range(2)))
        self.hits = Hits(aligned_empty((HIT_ROWS, row)), aligned_empty((6, row), np.int32))
        self.shadows = ShadowRays(
            new_packets(capacity), aligned_empty((4, row)), aligned_empty((capacity,), np.int32)
        )
        self.film = aligned_empty((FILM_ROWS if aovs else BEAUTY_ROWS, row))
        self.aovs = aovs
        self.scratch: Any = None
        self.carried: Any = None

    def swap(self) -> None:
        """Make the rays that the last step spawned the current rays."""
        self.lanes, self.next_lanes = self.next_lanes, self.lanes
