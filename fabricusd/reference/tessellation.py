"""A polygon mesh as triangles, and its primvars at their corners: as it is, or refined."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fabricusd.reference.face_varying import face_varying
from fabricusd.reference.limit_grid import Grid
from fabricusd.reference.polygons import triangulate
from fabricusd.reference.subdivision import Cage

CONSTANT, UNIFORM, VARYING, VERTEX, FACE_VARYING = (
    "constant", "uniform", "varying", "vertex", "faceVarying",
)  # fmt: skip


class Tessellation(Protocol):
    """Triangles of a mesh in its own space.

    faces : (m,) int - the mesh's face that each triangle is part of
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
        """(m, 3, c) a primvar's values at the triangles' corners; None where there are too few.

        values : (k, c) float; c is 2 where a surface is refined
        indices : which value each element has, as an indexed primvar says; None for one after the
        other
        """


def _elements(
    values: NDArray[np.float64], indices: NDArray[Any] | None, pick: NDArray[Any]
) -> NDArray[np.float64] | None:
    """The values of the elements `pick`, None where there is no such element or value."""
    for numbers in () if indices is None else (indices,):
        if pick.size and int(pick.max()) >= len(numbers):
            return None
        pick = numbers[pick]
    if pick.size and not 0 <= int(pick.min()) <= int(pick.max()) < len(values):
        return None
    return np.asarray(values[pick])


class CageTessellation:
    """The polygons themselves, cut into triangles."""

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
    """A cage, how it came from a mesh's faces, and how face-varying values follow it.

    face : (f,) int - the mesh's face that each of the cage's is part of
    corner : (h,) int - the mesh's corner that each of the cage's is
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
        """As `Tessellation` says; `vertex` values follow the surface, `varying` ones its cage."""
        own = self._refinement
        top = own.cage.topology
        values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
        if interpolation == FACE_VARYING:
            there = _elements(values, indices, own.corner)
            if there is None:
                return None
            keys = _shared(there) if indices is None else indices[own.corner]
            found = face_varying(own.cage, self._grid, there, keys, own.rule)
        elif interpolation in (VERTEX, VARYING):
            there = _elements(values, indices, np.arange(top.count))
            if there is None:
                return None
            if interpolation == VARYING:
                return np.asarray(self._grid.bilinear(there[top.indices])[self._at])
            deep = np.zeros((len(there), 3))
            deep[:, :2] = there
            found = self._grid.evaluate(own.cage.limit(deep), self._grid.place)[:, :2]
        else:
            pick = self.faces if interpolation == UNIFORM else np.zeros_like(self.faces)
            return _elements(values, indices, np.repeat(pick[:, None], 3, axis=1))
        return np.asarray(found[self._at])


def _shared(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """(h,) numbers, equal where the values are: what is not indexed is shared where it is equal."""
    return np.unique(values, axis=0, return_inverse=True)[1].reshape(-1)
