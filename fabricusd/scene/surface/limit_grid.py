"""Tessellates a cage's limit surface into a grid of points on each sub-quad.

Each corner of a cage's face owns a sub-quad (`embree_subdivision`), which becomes a grid of points.
Points that neighbouring faces share are identified by the cage's topology, so there are no cracks.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.surface.embree_subdivision import LimitSurface
from fabricusd.scene.surface.subdivision import Cage, Topology

PART = 1 << 17
"""Number of points that are evaluated at once."""

ASIDE = 1 / 16
"""Where a point has no usable normal, the normal is evaluated this far beside it, as a fraction of
the sub-quad's side."""


def triangles_at(topology: Topology, level: int) -> int:
    """The number of triangles at a level: each corner's sub-quad is halved `level` - 1 times."""
    return len(topology.indices) * 2 * 4 ** (level - 1)


class Grid:
    """The points of a topology's sub-quads, (r + 1) x (r + 1) each, as one array.

    Point (i, j) of corner h is at h (r + 1)^2 + i (r + 1) + j; its s is i / r, its t is j / r.

    place : (h (r + 1)^2,) int - number of the point at each index, as `places` gives it
    triangles : (m, 3) int - indices into the array, in the faces' winding
    face : (m,) int - the face of each triangle
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
        self.place = places(topology, self.size)

    def evaluate(self, surface: LimitSurface, place: NDArray[Any]) -> NDArray[np.float64]:
        """(k, 3) points of the surface for the whole array; equal where `place` is equal."""
        return self._once(surface, place)[0][place]

    def with_normals(self, cage: Cage) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """(k, 3) points and unit normals of the cage's surface, each taken on its own face's side.

        A normal is 0 where the surface has none.
        """
        surface = cage.limit()
        points, one = self._once(surface, self.place, normals=True)
        assert one is not None
        normals = one[self.place]
        aside = self._aside(cage).reshape(-1, 2)
        some = np.flatnonzero(aside.any(axis=1))
        near, far = (self._beside(surface, some, aside, ASIDE * step) for step in (1, 2))
        normals[some] = _unit(2 * near - far)
        self._make_one(normals, aside.any(axis=1) & ~self._creased(cage)[self.place])
        return points[self.place], normals

    def _once(
        self, surface: LimitSurface, place: NDArray[Any], *, normals: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float32] | None]:
        """(places, 3) points of the surface, and unit normals if requested."""
        source = np.full(int(place.max(initial=0)) + 1, -1, np.int32)
        source[place] = np.arange(len(place), dtype=np.int32)
        points = np.zeros((len(source), 3))
        units = np.zeros((len(source), 3), np.float32) if normals else None
        # Go face by face: Embree prepares a face once for all consecutive points on it.
        for part in _parts(np.sort(source[source >= 0])):
            corners, at = np.divmod(part, len(self.s))
            found = surface.evaluate(corners, self.s[at], self.t[at], normals=normals)
            points[place[part]] = found[0]
            if units is not None:
                units[place[part]] = _unit(found[1])
        return points, units

    def _beside(
        self, surface: LimitSurface, some: NDArray[Any], aside: NDArray[np.int8], step: float
    ) -> NDArray[np.float32]:
        """(n, 3) unit normals of the surface a small step beside `some` points of the array."""
        units = np.empty((len(some), 3), np.float32)
        for where in _parts(np.arange(len(some))):
            part = some[where]
            corners, at = np.divmod(part, len(self.s))
            s, t = self.s[at] + step * aside[part, 0], self.t[at] + step * aside[part, 1]
            units[where] = _unit(surface.evaluate(corners, s, t, normals=True)[1])
        return units

    def _make_one(self, normals: NDArray[np.float32], some: NDArray[np.bool_]) -> None:
        """Give `some` points of the array the mean normal of all those at the same place.

        Each normal was evaluated to one side of the place, and these errors cancel in the mean.
        """
        place, which = np.unique(self.place[some], return_inverse=True)
        total = [np.bincount(which, x, len(place)) for x in normals[some].T]
        normals[some] = _unit(np.stack(total, axis=1))[which]

    def _creased(self, cage: Cage) -> NDArray[np.bool_]:
        """(places,) where the surface has a different normal on each side."""
        top = self.topology
        creased = np.zeros(int(self.place.max(initial=0)) + 1, bool)
        edges, points = self._sharp(cage)
        creased[: top.count] = points
        on_edge = 2 * self.size - 1
        creased[top.count : top.count + len(edges) * on_edge] = np.repeat(edges, on_edge)
        return creased

    def _sharp(self, cage: Cage) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(e,) edges and (n,) points that are too sharp for these triangles to round."""
        top, most = self.topology, np.log2(2 * self.size)
        edges = ((cage.crease > most) & (top.uses > 1)) | top.tangled_edges
        points = cage.point_sharpness > most
        points[top.ends[edges].ravel()] = True
        return edges, points

    def _aside(self, cage: Cage) -> NDArray[np.int8]:
        """(h, (r + 1)^2, 2) direction in s and t of the step to where a normal exists; 0 for none.

        At irregular points the derivatives vanish in float32, and at a crease there are two normals
        of which the one on the face's own side is needed.
        """
        top, side = self.topology, self.size + 1
        aside = np.zeros((len(top.indices), side, side, 2), np.int8)
        edges, points = self._sharp(cage)
        leaving = edges[top.edge]
        aside[leaving, 1:, 0, 1] = 1
        aside[leaving[top.before], 0, 1:, 0] = 1
        aside[top.counts[top.face] != 4, -1, -1] = -1
        aside[(points | cage.irregular)[top.indices], 0, 0] = 1
        return aside.reshape(len(top.indices), side**2, 2)

    def bilinear(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(k, c) values for the whole array, bilinear in (h, c) values at the corners."""
        top = self.topology
        total = np.stack([np.bincount(top.face, x, len(top.counts)) for x in values.T], axis=1)
        middle = (total / top.counts[:, None])[top.face][:, None]
        here = values[:, None]
        leaving, arriving = (0.5 * (values + values[x])[:, None] for x in (top.after, top.before))
        s, t = self.s[None, :, None], self.t[None, :, None]
        flat = (1 - t) * ((1 - s) * here + s * leaving) + t * ((1 - s) * arriving + s * middle)
        return np.asarray(flat.reshape(-1, values.shape[1]))


def places(topology: Topology, size: int) -> NDArray[np.int32]:
    """(h (r + 1)^2,) numbers of the points of a grid with r = `size`, equal where faces meet.

    The numbers run through the topology's points, then the points on its edges, on the spokes from
    edges to the middles of faces, and inside faces.
    """
    top, r, side = topology, size, size + 1
    corners, on_edge = len(top.indices), 2 * r - 1
    spokes = top.count + len(top.uses) * on_edge
    middles = spokes + corners * (r - 1)
    inside = middles + len(top.counts)
    place = np.empty((corners, side, side), np.int32)
    step = np.arange(1, side)

    def along(corner: Any, steps: NDArray[Any]) -> NDArray[np.int64]:
        # `steps` counts from the corner's point; the next corner is 2 r steps away.
        up = np.where(top.forward[corner][:, None], steps, 2 * r - steps)
        return np.asarray(top.count + top.edge[corner][:, None] * on_edge + up - 1)

    place[:, 0, 0] = top.indices
    place[:, 1:, 0] = along(np.arange(corners), step)
    place[:, 0, 1:] = along(top.before, 2 * r - step)
    spoke = spokes + np.arange(corners)[:, None] * (r - 1) + step[:-1] - 1
    place[:, r, 1:r] = spoke
    place[:, 1:r, r] = spoke[top.before]
    place[:, r, r] = middles + top.face
    place[:, 1:r, 1:r] = inside + np.arange(corners * (r - 1) ** 2).reshape(corners, r - 1, r - 1)
    return place.reshape(-1)


def _parts(numbers: NDArray[Any]) -> Iterator[NDArray[Any]]:
    for begin in range(0, len(numbers), PART):
        yield numbers[begin : begin + PART]


def _unit(vectors: NDArray[Any] | None) -> NDArray[np.float64]:
    """(k, 3) the vectors normalized; 0 for vectors of length 0."""
    assert vectors is not None
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    good = np.isfinite(length) & (length > 0)
    return np.where(good, vectors / np.where(good, length, 1.0), 0.0)
