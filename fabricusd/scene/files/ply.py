"""Reads PLY: polygons of any size, triangle strips, UVs of vertices or of corners, and normals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.files.piece import QUIET, MeshFile, Polygons
from fabricusd.scene.files.ply_body import PlyBody, Table

UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
INDEX_NAMES = ("vertex_indices", "vertex_index")


@QUIET
def read_ply(path: Path) -> MeshFile:
    """Read the file as one piece. Raises FabricError."""
    body = PlyBody(path)
    tables: dict[str, Table] = {}
    for element in body.elements:
        table = body.read(element)
        if element.name in ("vertex", "face", "tristrips"):
            tables.setdefault(element.name, table)
        if "vertex" in tables and ("face" in tables or "tristrips" in tables):
            break
    points, uv, normals = _vertices(body, tables.get("vertex"))
    counts, corners, corner_uv = _faces(body, tables, len(points))
    notes = []
    if (counts < 3).any():
        notes.append(("", f"has {int((counts < 3).sum())} faces below three corners, left out"))
    coordinates, given = corner_uv or (None if uv is None else uv[corners], None)
    polygons = Polygons(
        points=points, counts=counts, corners=corners, uv=coordinates, uv_given=given,
        normals=None if normals is None else normals[corners],
    )  # fmt: skip
    return MeshFile(pieces=polygons.pieces([""], np.zeros(len(counts), np.int64)), notes=notes)


def _vertices(
    body: PlyBody, table: Table | None
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Points, UVs and normals of the vertices."""
    single = {} if table is None else table.single
    if not all(axis in single for axis in "xyz"):
        body.refuse("has no vertices with x, y and z")
    points = np.stack([single[axis] for axis in "xyz"], axis=1)
    uv = next(
        (np.stack([single[a], single[b]], axis=1) for a, b in UV_NAMES
         if a in single and b in single),
        None,
    )  # fmt: skip
    normals = None
    if all(axis in single for axis in ("nx", "ny", "nz")):
        normals = np.stack([single[axis] for axis in ("nx", "ny", "nz")], axis=1)
    return points, uv, normals


def _faces(
    body: PlyBody, tables: dict[str, Table], points: int
) -> tuple[
    NDArray[np.int64], NDArray[np.int64], tuple[NDArray[np.float64], NDArray[np.bool_]] | None
]:
    """The number of corners of each face, the corners' vertices, and the corners' own UVs with a
    mask of the corners that have them."""
    lists = tables["face"].lists if "face" in tables else {}
    name = next((n for n in INDEX_NAMES if n in lists), None)
    if name is None:
        if "tristrips" not in tables:
            return np.zeros(0, np.int64), np.zeros(0, np.int64), None
        counts, named = _strips(tables["tristrips"])
    else:
        counts, named = lists[name]
    whole = (named >= 0) & (named < points) & (named == np.floor(named))
    if not whole.all():
        at = int(np.argmin(whole))
        face = int(np.searchsorted(np.cumsum(counts), at, "right"))
        body.refuse(f"has face {face} with vertex {named[at]:.15g}; there are {points} vertices")
    corners = named.astype(np.int64)
    if name is None or "texcoord" not in lists:
        return counts, corners, None
    lengths, values = lists["texcoord"]
    given = lengths == 2 * counts
    if not given.any():
        return counts, corners, None
    uv = np.zeros((len(corners), 2))
    has = np.repeat(given, counts)
    uv[has] = values[np.repeat(given, lengths)].reshape(-1, 2)
    return counts, corners, (uv, has)


def _strips(table: Table) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The triangles of strips that are separated by -1."""
    found = [np.zeros((0, 3))]
    name = next((n for n in INDEX_NAMES if n in table.lists), None)
    counts, values = table.lists[name] if name else (np.zeros(0, np.int64), np.zeros(0))
    ends = np.cumsum(counts)
    cuts = np.unique(np.concatenate([ends, np.flatnonzero(values == -1), [len(values)]]))
    begin = 0
    for cut in cuts:
        strip = values[begin:cut]
        strip = strip[1:] if len(strip) and strip[0] == -1 else strip
        begin = int(cut)
        if len(strip) >= 3:
            three = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
            three[1::2] = three[1::2][:, [1, 0, 2]]
            a, b, c = three.T
            found.append(three[(a != b) & (b != c) & (a != c)])
    corners = np.concatenate(found)
    return np.full(len(corners), 3, np.int64), corners.ravel()
