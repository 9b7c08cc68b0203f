"""Turns a polygon mesh into triangles, as it is or refined, with primvars at their corners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.surface.face_varying import face_varying
from fabricusd.scene.surface.limit_grid import Grid
from fabricusd.scene.surface.polygons import triangulate
from fabricusd.scene.surface.subdivision import Cage

CONSTANT, UNIFORM, VARYING, VERTEX, FACE_VARYING = (
    "constant", "uniform", "varying", "vertex", "faceVarying",
)  # fmt: skip


class Tessellation(Protocol):
    """The triangles of a mesh in its own space.

    faces : (m,) int - the mesh's face to which each triangle belongs
    points : (n, 3) float64, triangles : (m, 3) int, counter-clockwise seen from the front
    normals : (m, 3, 3) float64 or None - at the corners, towards the front
    """

    faces: NDArray[np.int64]
    points: NDArray[np.float64]
    triangles: NDArray[np.int64]
    normals: NDArray[np.floating] | None

    def spread(
        self, values: NDArray[np.float64], interpolation: str, indices: NDArray[Any] | None = None
    ) -> NDArray[np.float64] | None:
        """(m, 3, c) a primvar's values at the triangles' corners; None if there are too few values.

        values : (k, c) float; c is 2 for a refined surface
        indices : the indices of an indexed primvar; None if the values are in the elements' order
        """


def _elements(
    values: NDArray[np.float64], indices: NDArray[Any] | None, pick: NDArray[Any]
) -> NDArray[np.float64] | None:
    """The values of the elements `pick`; None if an element or its value does not exist."""
    for numbers in () if indices is None else (indices,):
        if pick.size and int(pick.max()) >= len(numbers):
            return None
        pick = numbers[pick]
    if pick.size and not 0 <= int(pick.min()) <= int(pick.max()) < len(values):
        return None
    return np.asarray(values[pick])


class CageTessellation:
    """The mesh's own polygons, cut into triangles."""

    normals: NDArray[np.floating] | None = None

    def __init__(
        self,
        points: NDArray[np.float64],
        counts: NDArray[Any],
        indices: NDArray[Any],
        *,
        hidden: NDArray[np.bool_],
        reverse: bool,
    ) -> None:
        faces, corners = triangulate(points, counts, indices)
        shown = ~hidden[faces]
        self.faces, corners = faces[shown], corners[shown]
        self._corners = corners[:, ::-1] if reverse else corners
        self.points, self.triangles = points, indices[self._corners]

    def spread(
        self, values: NDArray[np.float64], interpolation: str, indices: NDArray[Any] | None = None
    ) -> NDArray[np.float64] | None:
        """As `Tessellation` says."""
        if interpolation == FACE_VARYING:
            pick = self._corners
        elif interpolation in (VERTEX, VARYING):
            pick = self.triangles
        elif interpolation == UNIFORM:
            pick = np.repeat(self.faces[:, None], 3, axis=1)
        else:
            pick = np.zeros_like(self._corners)
        return _elements(values, indices, pick)


@dataclass(frozen=True, kw_only=True, eq=False)
class Refinement:
    """A cage, its relation to the mesh's faces, and the rule for face-varying values.

    face : (f,) int - the mesh's face to which each face of the cage belongs
    corner : (h,) int - the mesh's corner that corresponds to each corner of the cage
    rule : str - one of `face_varying.RULES`
    """

    cage: Cage
    face: NDArray[np.int64]
    corner: NDArray[np.int64]
    rule: str


class RefinedTessellation:
    """Triangles whose corners lie on the limit surface, with its normals."""

    def __init__(
        self, refinement: Refinement, level: int, *, left_handed: bool, reverse: bool
    ) -> None:
        self._refinement = refinement
        cage = refinement.cage
        self._grid = grid = Grid(cage.topology, level)
        shown = ~cage.hidden[grid.face]
        faces, at = grid.face, grid.triangles
        if not shown.all():
            faces, at = faces[shown], at[shown]
        self._cage_face = faces
        self.faces = refinement.face[faces]
        self._at = at[:, ::-1] if reverse else at
        limit, normals = grid.with_normals(cage)
        number = grid.place[self._at]
        used = np.zeros(int(grid.place.max(initial=0)) + 1, bool)
        used[number] = True
        points = np.empty((len(used), 3))
        points[grid.place] = limit
        self.points = points[used]
        self.triangles = (np.cumsum(used, dtype=np.int32) - np.int32(1))[number]
        self.normals = (-normals if left_handed else normals)[self._at]

    def spread(
        self, values: NDArray[np.float64], interpolation: str, indices: NDArray[Any] | None = None
    ) -> NDArray[np.float64] | None:
        """As `Tessellation` says; `vertex` values follow the surface, `varying` ones the cage."""
        top = self._refinement.cage.topology
        if interpolation in (CONSTANT, UNIFORM):
            pick = self.faces if interpolation == UNIFORM else np.zeros_like(self.faces)
            return _elements(values, indices, np.repeat(pick[:, None], 3, axis=1))
        varies = interpolation == FACE_VARYING
        pick = self._refinement.corner if varies else np.arange(top.count)
        there = _elements(values, indices, pick)
        if there is None:
            return None
        broken = ~np.asarray(np.isfinite(there).all(axis=1))
        there = np.where(broken[:, None], 0.0, there)
        keys = None if indices is None else indices[pick]
        found = self._interpolated(there, interpolation, keys)[self._at]
        if broken.any():
            corners = broken if varies else broken[top.indices]
            faces = np.bincount(top.face, corners, len(top.counts)) > 0
            found[faces[self._cage_face]] = np.nan
        return np.asarray(found)

    def _interpolated(
        self, values: NDArray[np.float64], interpolation: str, keys: NDArray[Any] | None
    ) -> NDArray[np.float64]:
        """(k, 2) values at the grid's points, from (h, 2) values at corners or (n, 2) at points."""
        own = self._refinement
        if interpolation == FACE_VARYING:
            shared = _shared(values) if keys is None else keys
            return face_varying(own.cage, self._grid, values, shared, own.rule)
        if interpolation == VARYING:
            return self._grid.bilinear(values[own.cage.topology.indices])
        deep = np.zeros((len(values), 3))
        deep[:, :2] = values
        return self._grid.evaluate(own.cage.limit(deep), self._grid.place)[:, :2]


def _shared(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """(h,) numbers that are equal for equal values: values without indices are shared if equal."""
    return np.unique(values, axis=0, return_inverse=True)[1].reshape(-1)
