"""Catmull-Clark cages [CatmullClark1978] and the rules of their limit surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.surface.embree_subdivision import (
    INFINITE,
    MOST_FACES,
    MOST_RING,
    LimitSurface,
)

COMPLEXITIES = {"low": 0, "medium": 1, "high": 2, "veryhigh": 3}
"""Levels by the names of usdrecord and usdview: each halves the edges; `low` is the cage."""


def around_faces(counts: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """(h,) of each corner of polygons with `counts` corners: its face, the next corner of that and
    the one before."""
    starts = np.cumsum(counts) - counts
    face = np.repeat(np.arange(len(counts)), counts)
    corner = np.arange(len(face))
    first, size = starts[face], counts[face]
    after = np.where(corner + 1 == first + size, first, corner + 1)
    return face, after, np.where(corner == first, first + size - 1, corner - 1)


class Topology:
    """Which corners, edges and points of polygons belong together.

    counts : (f,) int, indices : (h,) int - the polygons; count : int - points there are
    face, after, before : (h,) int - of each corner: its face, the next corner and the one before
    edge : (h,) int - the edge from a corner to the next; forward : (h,) bool - from the lower point
    ends : (e, 2) int - points of each edge, the lower first; uses : (e,) int - faces at each edge
    """

    def __init__(self, counts: NDArray[Any], indices: NDArray[Any], count: int) -> None:
        self.counts, self.indices, self.count = counts, indices, count
        self.face, self.after, self.before = around_faces(counts)
        a, b = indices, indices[self.after]
        self.forward = a < b
        key = np.minimum(a, b).astype(np.int64) * count + np.maximum(a, b)
        keys, self.edge, self.uses = np.unique(key, return_inverse=True, return_counts=True)
        self.ends = np.stack([keys // count, keys % count], axis=1)

    @cached_property
    def faces_at(self) -> NDArray[np.int64]:
        """(n,) faces around each point."""
        return np.bincount(self.indices, minlength=self.count)

    @cached_property
    def borders_at(self) -> NDArray[np.int64]:
        """(n,) edges of only one face at each point."""
        return np.bincount(self.ends[self.uses == 1].ravel(), minlength=self.count)

    @cached_property
    def tangled_edges(self) -> NDArray[np.bool_]:
        """(e,) edges of more than two faces, or of two that wind against each other."""
        same_way = np.bincount(self.edge, self.forward, len(self.uses))
        return np.asarray((self.uses > 2) | ((self.uses == 2) & (same_way != 1)))

    @cached_property
    def tangled(self) -> NDArray[np.bool_]:
        """(n,) points where the faces are no single fan: OpenSubdiv keeps them where they are."""
        bad = np.asarray(self.borders_at > 2)
        bad[self.ends[self.tangled_edges].ravel()] = True
        return bad

    def edges_of(self, pairs: NDArray[Any]) -> NDArray[np.int64]:
        """(k,) the edge between each of (k, 2) points, -1 where there is none."""
        keys = self.ends[:, 0] * self.count + self.ends[:, 1]
        low, high = np.sort(pairs, axis=1).T
        wanted = low.astype(np.int64) * self.count + high
        place = np.minimum(np.searchsorted(keys, wanted), max(len(keys) - 1, 0))
        return np.where(keys[place] == wanted, place, -1) if len(keys) else place - 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Cage:
    """A cage and the rules of its surface, after OpenSubdiv.

    points : (n, 3) float; counts : (f,) int; indices : (h,) int
    crease : (e,) float - sharpness of the topology's edges; sharpness : (n,) float - of points
    sharp_corners : bool - whether a point of a single face stays where it is
    hidden : (f,) bool - faces that shape the surface and are not drawn
    """

    points: NDArray[np.float64]
    topology: Topology
    crease: NDArray[np.float64]
    sharpness: NDArray[np.float64]
    sharp_corners: bool = True
    hidden: NDArray[np.bool_]

    @cached_property
    def point_sharpness(self) -> NDArray[np.float64]:
        """(n,) with what the border and tangled faces add."""
        topology = self.topology
        fixed = topology.tangled
        if self.sharp_corners:
            fixed = fixed | (topology.faces_at == 1)
        return np.where(fixed, INFINITE, np.maximum(self.sharpness, self._sharp_meetings))

    @cached_property
    def _sharp_meetings(self) -> NDArray[np.float64]:
        """(n,) sharpness of points where three or more creases soften in the same step.

        Embree leaves such points where they are until the last of a crease is gone; OpenSubdiv lets
        go of them with the fraction of the last step, as both do by a point's own sharpness.
        """
        found = np.zeros(self.topology.count)
        top = self.topology
        sharp = np.where(top.uses == 1, INFINITE, self.crease)
        some = sharp > 0
        point = top.ends[some].ravel()
        value = np.repeat(np.minimum(sharp[some], INFINITE), 2)
        order = np.lexsort((-value, point))
        point, value = point[order], value[order]
        third = np.flatnonzero(point[2:] == point[:-2])
        third = third[np.r_[True, point[third[1:]] != point[third[:-1]]]] if len(third) else third
        together = np.ceil(value[third]) == np.ceil(value[third + 2])
        third = third[together & (value[third] < INFINITE)]
        found[point[third]] = value[third + 2]
        return found

    @cached_property
    def irregular(self) -> NDArray[np.bool_]:
        """(n,) points around which the surface is no B-spline: not in the middle of four quads, or
        of two at the border; and corners that are rounded."""
        top = self.topology
        border = top.borders_at > 0
        usual = top.faces_at == np.where(border, 2, 4)
        if self.sharp_corners:
            usual |= top.faces_at == 1
        usual[top.indices[top.counts[top.face] != 4]] = False
        return ~usual

    def limit(self, values: NDArray[np.float64] | None = None) -> LimitSurface:
        """The surface of the points, or of other values (n, 3) at them."""
        return limit_of(
            self.points if values is None else values,
            self.topology, self.crease, self.point_sharpness,
        )  # fmt: skip


def limit_of(
    values: NDArray[np.float64],
    topology: Topology,
    crease: NDArray[np.float64],
    sharpness: NDArray[np.float64],
) -> LimitSurface:
    """The limit of values (n, 3) at the topology's points."""
    sharp = crease > 0
    return LimitSurface(
        values, topology.counts, topology.indices, topology.ends[sharp], crease[sharp], sharpness
    )


def too_crowded(topology: Topology) -> str:
    """Why neither the topology nor one with more borders can be evaluated, or an empty string."""
    others = np.bincount(topology.indices, topology.counts[topology.face] - 2, topology.count)
    worst = int(np.argmax(np.maximum(topology.faces_at * (MOST_RING // MOST_FACES), others)))
    if topology.faces_at[worst] < MOST_FACES and others[worst] < MOST_RING:
        return ""
    return f"has {topology.faces_at[worst]} faces around point {worst}; {MOST_FACES - 1} at most"
