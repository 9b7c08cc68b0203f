"""The result of every mesh file reader: pieces as stored in the file, before units and fabrics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.surface.polygons import triangulate

QUIET = np.errstate(all="ignore")
"""Silences numpy's warnings in readers: values that are not finite or too large are read as they
are, and the code that uses them judges them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """Triangles that share a name in the file; lengths are in the file's unit.

    name : str - '' if the file gives no name
    points : (n, 3) float64
    triangles : (m, 3) int32 - counter-clockwise seen from the front
    uv : (m, 3, 2) float64 or None - at the corners, v upwards
    textured : (m,) bool or None - which triangles have UVs; None if all have
    normals : (m, 3, 3) float or None - at the corners; zeros where the file gives none
    """

    name: str
    points: NDArray[np.float64]
    triangles: NDArray[Any]
    uv: NDArray[np.float64] | None = None
    textured: NDArray[np.bool_] | None = None
    normals: NDArray[Any] | None = None


@dataclass(frozen=True, kw_only=True)
class MeshFile:
    """The pieces of one file, with notes about what was left out: (name of a piece or '', note)."""

    pieces: list[Piece]
    notes: list[tuple[str, str]] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True, eq=False)
class Polygons:
    """Faces with any number of corners, and the values at their corners.

    points : (n, 3) float64
    counts : (f,) int - number of corners of each face; corners : (c,) int - the corners' points
    uv, normals : (c, 2) and (c, 3) float, or None
    uv_given, normal_given : (c,) bool or None - which corners have a value; None if all have
    """

    points: NDArray[np.float64]
    counts: NDArray[np.int64]
    corners: NDArray[np.int64]
    uv: NDArray[np.float64] | None = None
    uv_given: NDArray[np.bool_] | None = None
    normals: NDArray[np.float64] | None = None
    normal_given: NDArray[np.bool_] | None = None

    def pieces(self, names: Sequence[str], piece: NDArray[np.int64]) -> list[Piece]:
        """Make one piece for each of `names` that has triangles.

        piece : (f,) int - index into `names` for each face

        A face counts as lacking UVs or normals if any of its corners lacks them.
        """
        face, at = triangulate(self.points, self.counts, self.corners)
        begins = np.concatenate([[0], np.cumsum(self.counts)])
        textured = _of_faces(self.uv_given, begins)
        smooth = _of_faces(self.normal_given, begins)
        of = piece[face]
        order = np.argsort(of, kind="stable") if len(names) > 1 else slice(None)
        face, at, of = face[order], at[order], of[order]
        found = []
        for k in np.unique(of):
            mine = slice(*np.searchsorted(of, [k, k + 1]))
            corners = at[mine]
            used, triangles = renumbered(self.corners[corners], len(self.points))
            uv = None if self.uv is None else self.uv[corners]
            has_uv = None if textured is None else textured[face[mine]]
            if has_uv is not None and uv is not None:
                uv = np.where(has_uv[:, None, None], uv, 0.0) if has_uv.any() else None
            normals = None if self.normals is None else self.normals[corners]
            if normals is not None and smooth is not None:
                normals = np.where(smooth[face[mine]][:, None, None], normals, 0.0)
            found.append(
                Piece(
                    name=names[k],
                    points=self.points[used],
                    triangles=triangles,
                    uv=uv,
                    textured=None if uv is None or has_uv is None or has_uv.all() else has_uv,
                    normals=normals,
                )
            )
        return found


def renumbered(
    triangles: NDArray[np.int64], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """The numbers of the points, out of `count`, that the triangles use, and the triangles
    renumbered to index them."""
    if count > 8 * triangles.size:
        used, numbers = np.unique(triangles, return_inverse=True)
        return used, numbers.reshape(-1, 3).astype(np.int32)
    is_used = np.zeros(count, bool)
    is_used[triangles] = True
    number = np.cumsum(is_used, dtype=np.int32) - np.int32(1)
    return np.flatnonzero(is_used), number[triangles]


def _of_faces(
    given: NDArray[np.bool_] | None, begins: NDArray[np.int64]
) -> NDArray[np.bool_] | None:
    """(f,) which faces have a value at all corners; None if all corners have one."""
    if given is None or given.all():
        return None
    total = np.concatenate([[0], np.cumsum(given)])
    return np.asarray(total[begins[1:]] - total[begins[:-1]] == np.diff(begins))


def unique_names(names: Sequence[str]) -> list[str]:
    """The names in the same order, with `_2`, `_3` and so on appended to repeated ones."""
    taken: set[str] = set(names)
    seen: dict[str, int] = {}
    found = []
    for name in names:
        count = seen.get(name, 0) + 1
        new = name
        while count > 1:
            new = f"{name}_{count}"
            if new not in taken:
                break
            count += 1
        seen[name] = count
        taken.add(new)
        found.append(new)
    return found
