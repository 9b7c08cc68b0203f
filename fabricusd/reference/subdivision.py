"""Catmull-Clark cages [CatmullClark1978] refined to triangles of their limit surface.

Every corner of a cage's face becomes a grid of points on its sub-quad (`embree_subdivision`), and
points that neighbouring faces share are one by the cage's topology, so that there are no cracks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.reference.embree_subdivision import (
    INFINITE,
    MOST_FACES,
    MOST_RING,
    LimitSurface,
)

COMPLEXITIES = {"low": 0, "medium": 1, "high": 2, "veryhigh": 3}
"""Levels by the names of usdrecord and usdview: each halves the edges; `low` is the cage."""

PART = 1 << 15
"""Sub-quads that are evaluated together."""

ASIDE = 1 / 16
"""How far beside a point, of its sub-quad, a normal is looked for that is not to be had there."""


class Topology:
    """Which corners, edges and points of polygons belong together.

    counts : (f,) int, indices : (h,) int - the polygons; count : int - points there are
    face, after, before : (h,) int - of each corner: its face, the next corner and the one before
    edge : (h,) int - the edge from a corner to the next; forward : (h,) bool - from the lower point
    ends : (e, 2) int - points of each edge, the lower first; uses : (e,) int - faces at each edge
    """

    def __init__(self, counts: NDArray[Any], indices: NDArray[Any], count: int) -> None:
        self.counts, self.indices, self.count = counts, indices, count
        starts = np.cumsum(counts) - counts
        self.face = np.repeat(np.arange(len(counts)), counts)
        corner = np.arange(len(indices))
        first, size = starts[self.face], counts[self.face]
        self.after = np.where(corner + 1 == first + size, first, corner + 1)
        self.before = np.where(corner == first, first + size - 1, corner - 1)
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
    def tangled(self) -> NDArray[np.bool_]:
        """(n,) points where the faces are no single fan: OpenSubdiv keeps them where they are."""
        same_way = np.bincount(self.edge, self.forward, len(self.uses))
        wrong = (self.uses > 2) | ((self.uses == 2) & (same_way != 1))
        bad = self.borders_at > 2
        bad[self.ends[wrong].ravel()] = True
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


def _unit(vectors: NDArray[Any] | None) -> NDArray[np.float64]:
    """(k, 3) at length 1; 0 where there is no length."""
    assert vectors is not None
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    good = np.isfinite(length) & (length > 0)
    return np.where(good, vectors / np.where(good, length, 1.0), 0.0)


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


def triangles_at(topology: Topology, level: int) -> int:
    """How many triangles a level makes: each corner's sub-quad is halved `level` - 1 times."""
    return len(topology.indices) * 2 * 4 ** (level - 1)


class Grid:
    """Points of a topology's sub-quads, (r + 1) x (r + 1) each, as one array.

    Point (i, j) of corner h is at h (r + 1)^2 + i (r + 1) + j, its s is i / r and its t is j / r.
    place : (h (r + 1)^2,) int - number of the point there, equal where faces meet
    triangles : (m, 3) int - into the array, in the faces' winding; face : (m,) int
    """

    def __init__(self, topology: Topology, level: int) -> None:
        self.topology = topology
        self.size = 2 ** (level - 1)
        side = self.size + 1
        self.s, self.t = (
            x.ravel() / self.size for x in np.meshgrid(range(side), range(side), indexing="ij")
        )
        i, j = (x.ravel() for x in np.meshgrid(*[range(self.size)] * 2, indexing="ij"))
        a = i * side + j
        b, c, d = a + side, a + side + 1, a + 1
        quads = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3)
        corners = np.arange(len(topology.indices), dtype=np.int32)[:, None, None] * side**2
        self.triangles = (corners + quads.astype(np.int32)).reshape(-1, 3)
        self.face = np.repeat(topology.face, len(quads))
        self.place = self._places(side)

    def _places(self, side: int) -> NDArray[np.int64]:
        """Numbers in turn: the cage's points, those on its edges, on spokes, in faces."""
        top, r = self.topology, self.size
        corners, on_edge = len(top.indices), 2 * r - 1
        spokes = top.count + len(top.uses) * on_edge
        middles = spokes + corners * (r - 1)
        inside = middles + len(top.counts)
        place = np.empty((corners, side, side), np.int32)
        step = np.arange(1, side)

        def along(corner: Any, steps: NDArray[Any]) -> NDArray[np.int64]:
            # `steps` from the corner's point, of 2 r to the next one.
            up = np.where(top.forward[corner][:, None], steps, 2 * r - steps)
            return np.asarray(top.count + top.edge[corner][:, None] * on_edge + up - 1)

        place[:, 0, 0] = top.indices
        place[:, 1:, 0] = along(np.arange(corners), step)
        place[:, 0, 1:] = along(top.before, 2 * r - step)
        spoke = spokes + np.arange(corners)[:, None] * (r - 1) + step[:-1] - 1
        place[:, r, 1:r] = spoke
        place[:, 1:r, r] = spoke[top.before]
        place[:, r, r] = middles + top.face
        own = inside + np.arange(corners * (r - 1) ** 2).reshape(corners, r - 1, r - 1)
        place[:, 1:r, 1:r] = own
        return place.reshape(-1)

    def evaluate(self, surface: LimitSurface) -> NDArray[np.float64]:
        """(k, 3) points of the surface at the whole array."""
        points = np.empty((len(self.place), 3))
        for part, corners, s, t in self._parts():
            points[part] = surface.evaluate(corners, s, t)[0]
        return points

    def with_normals(self, cage: Cage) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """(k, 3) points and unit normals of the cage's surface, from the side of each face.

        A normal is 0 where there is none.
        """
        surface = cage.limit()
        points = np.empty((len(self.place), 3))
        normals = np.empty((len(self.place), 3), np.float32)
        for part, corners, s, t in self._parts():
            points[part], cross = surface.evaluate(corners, s, t, normals=True)
            normals[part] = _unit(cross)
        aside = self._aside(cage).reshape(-1, 2)
        for some in np.array_split(np.flatnonzero(aside.any(axis=1)), 1 + len(aside) // PART):
            corners, at = np.divmod(some, len(self.s))
            near, far = (
                _unit(
                    surface.evaluate(
                        corners,
                        self.s[at] + step * aside[some, 0],
                        self.t[at] + step * aside[some, 1],
                        normals=True,
                    )[1]
                )
                for step in (ASIDE, 2 * ASIDE)
            )
            normals[some] = _unit(2 * near - far)
        self._make_one(normals, aside.any(axis=1) & ~self._creased(cage)[self.place])
        return points, normals

    def _make_one(self, normals: NDArray[np.float32], some: NDArray[np.bool_]) -> None:
        """Give `some` points of the array the mean normal of all that lie at the same place.

        What each of them is off by, as it was looked for on one side, is opposite to the others'.
        """
        place, which = np.unique(self.place[some], return_inverse=True)
        total = [np.bincount(which, x, len(place)) for x in normals[some].T]
        normals[some] = _unit(np.stack(total, axis=1))[which]

    def _creased(self, cage: Cage) -> NDArray[np.bool_]:
        """(places,) where the surface has a normal for each side."""
        top = self.topology
        creased = np.zeros(int(self.place.max(initial=0)) + 1, bool)
        sharp = self._sharp(cage)
        creased[top.ends[sharp].ravel()] = True
        on_edge = 2 * self.size - 1
        creased[top.count : top.count + len(sharp) * on_edge] = np.repeat(sharp, on_edge)
        return creased

    def _sharp(self, cage: Cage) -> NDArray[np.bool_]:
        """(e,) edges between two faces that are sharper than what these triangles can round."""
        return (cage.crease > np.log2(2 * self.size)) & (self.topology.uses > 1)

    def _aside(self, cage: Cage) -> NDArray[np.int8]:
        """(h, (r + 1)^2, 2) direction in s and t in which a normal must be looked for, 0 for none.

        Around irregular points derivatives shrink until nothing is left of them in float32, and at
        a crease there are two normals: there the normal is that of the face's own side.
        """
        top, side = self.topology, self.size + 1
        aside = np.zeros((len(top.indices), side, side, 2), np.int8)
        sharp = self._sharp(cage)
        leaving = sharp[top.edge]
        aside[leaving, 1:, 0, 1] = 1
        aside[leaving[top.before], 0, 1:, 0] = 1
        aside[top.counts[top.face] != 4, -1, -1] = -1
        odd = cage.irregular.copy()
        odd[top.ends[sharp].ravel()] = True
        aside[odd[top.indices], 0, 0] = 1
        return aside.reshape(len(top.indices), side**2, 2)

    def _parts(self) -> Iterator[tuple[slice, NDArray[Any], NDArray[Any], NDArray[Any]]]:
        """Slices of the array, and of each the corners and their s and t."""
        each, total = len(self.s), len(self.topology.indices)
        for begin in range(0, total, PART):
            corners = np.arange(begin, min(begin + PART, total))
            s, t = np.tile(self.s, len(corners)), np.tile(self.t, len(corners))
            part = slice(begin * each, (begin + len(corners)) * each)
            yield part, np.repeat(corners, each), s, t

    def bilinear(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(k, c) at the whole array, of values (h, c) at the corners; edges stay straight."""
        top = self.topology
        total = np.stack([np.bincount(top.face, x, len(top.counts)) for x in values.T], axis=1)
        middle = (total / top.counts[:, None])[top.face][:, None]
        here = values[:, None]
        leaving, arriving = (0.5 * (values + values[x])[:, None] for x in (top.after, top.before))
        s, t = self.s[None, :, None], self.t[None, :, None]
        flat = (1 - t) * ((1 - s) * here + s * leaving) + t * ((1 - s) * arriving + s * middle)
        return np.asarray(flat.reshape(-1, values.shape[1]))
