"""Catmull-Clark cages [CatmullClark1978]: their topology, and the rules of their limit surfaces."""

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
"""Refinement levels by the names that usdrecord and usdview use: each level halves the edges, and
`low` is the cage itself."""


def around_faces(counts: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """For each corner of polygons with `counts` corners, (h,): its face, and the next and the
    previous corner of that face."""
    starts = np.cumsum(counts) - counts
    face = np.repeat(np.arange(len(counts)), counts)
    corner = np.arange(len(face))
    first, size = starts[face], counts[face]
    after = np.where(corner + 1 == first + size, first, corner + 1)
    return face, after, np.where(corner == first, first + size - 1, corner - 1)


class Topology:
    """The connectivity of polygons: which corners, edges and points belong together.

    counts : (f,) int, indices : (h,) int - the polygons; count : int - number of points
    face, after, before : (h,) int - for each corner: its face, the next and the previous corner
    edge : (h,) int - the edge from a corner to the next
    forward : (h,) bool - whether that edge starts at the point with the lower number
    ends : (e, 2) int - points of each edge, the lower first
    uses : (e,) int - number of faces at each edge
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
        """(n,) number of faces around each point."""
        return np.bincount(self.indices, minlength=self.count)

    @cached_property
    def borders_at(self) -> NDArray[np.int64]:
        """(n,) number of border edges, those of a single face, at each point."""
        return np.bincount(self.ends[self.uses == 1].ravel(), minlength=self.count)

    @cached_property
    def tangled_edges(self) -> NDArray[np.bool_]:
        """(e,) edges of more than two faces, or of two faces with opposite winding."""
        same_way = np.bincount(self.edge, self.forward, len(self.uses))
        return np.asarray((self.uses > 2) | ((self.uses == 2) & (same_way != 1)))

    @cached_property
    def tangled(self) -> NDArray[np.bool_]:
        """(n,) points whose faces do not form a single fan; OpenSubdiv keeps these points fixed."""
        bad = np.asarray(self.borders_at > 2)
        bad[self.ends[self.tangled_edges].ravel()] = True
        return bad

    def edges_of(self, pairs: NDArray[Any]) -> NDArray[np.int64]:
        """(k,) the edge between each of (k, 2) pairs of points, -1 if there is none."""
        keys = self.ends[:, 0] * self.count + self.ends[:, 1]
        low, high = np.sort(pairs, axis=1).T
        wanted = low.astype(np.int64) * self.count + high
        place = np.minimum(np.searchsorted(keys, wanted), max(len(keys) - 1, 0))
        return np.where(keys[place] == wanted, place, -1) if len(keys) else place - 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Cage:
    """A cage with the rules of its limit surface, as in OpenSubdiv.

    points : (n, 3) float
    crease : (e,) float - sharpness of the topology's edges; sharpness : (n,) float - of its points
    sharp_corners : bool - whether a point of a single face stays fixed
    hidden : (f,) bool - faces that shape the surface but are not drawn
    """

    points: NDArray[np.float64]
    topology: Topology
    crease: NDArray[np.float64]
    sharpness: NDArray[np.float64]
    sharp_corners: bool = True
    hidden: NDArray[np.bool_]

    @cached_property
    def point_sharpness(self) -> NDArray[np.float64]:
        """(n,) sharpness of the points, including the effects of borders and tangled faces."""
        topology = self.topology
        fixed = topology.tangled
        if self.sharp_corners:
            fixed = fixed | (topology.faces_at == 1)
        return np.where(fixed, INFINITE, np.maximum(self.sharpness, self._sharp_meetings))

    @cached_property
    def _sharp_meetings(self) -> NDArray[np.float64]:
        """(n,) sharpness of points where three or more creases soften in the same step.

        Embree keeps such a point fixed until its creases are gone. OpenSubdiv releases the point by
        the fractional sharpness of the last step; both libraries do so for a point's own sharpness.
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
        """(n,) points around which the surface is not a B-spline: all but those shared by four
        quads, or by two quads on the border. Corners count as irregular if they are rounded."""
        top = self.topology
        border = top.borders_at > 0
        usual = top.faces_at == np.where(border, 2, 4)
        if self.sharp_corners:
            usual |= top.faces_at == 1
        usual[top.indices[top.counts[top.face] != 4]] = False
        return ~usual

    def limit(self, values: NDArray[np.float64] | None = None) -> LimitSurface:
        """The limit surface of the points, or of other (n, 3) values at the points."""
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
    """The limit surface of (n, 3) values at the topology's points."""
    sharp = crease > 0
    return LimitSurface(
        values, topology.counts, topology.indices, topology.ends[sharp], crease[sharp], sharpness
    )


def too_crowded(topology: Topology) -> str:
    """The reason why the topology cannot be evaluated, also if more borders are added; else ""."""
    others = np.bincount(topology.indices, topology.counts[topology.face] - 2, topology.count)
    worst = int(np.argmax(np.maximum(topology.faces_at * (MOST_RING // MOST_FACES), others)))
    if topology.faces_at[worst] < MOST_FACES and others[worst] < MOST_RING:
        return ""
    return (
        f"has {topology.faces_at[worst]} faces around point {worst}; "
        f"at most {MOST_FACES - 1} are possible"
    )
