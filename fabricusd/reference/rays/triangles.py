"""Triangles as one record each: what a hit needs, gathered from two or three cache lines.

Smooth normals and smooth grain directions at the corners, as [Bisker2011] section 5.3 asks; weave
coordinates kept as a base inside one repeat plus differences, so that float32 does not lose the
place inside a thread however large the UVs are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.scene.scene import FabricSurface, Mesh, Scene

# Columns of a record. P0 is a corner, E1 and E2 go from it to the others, N and T are the normals
# and the directions of growing u at the three corners, ST the coordinates at the first corner and
# D1, D2 their differences along E1 and E2. RATE is both coordinates' steepness [1/m].
P0, E1, E2, N, T, ST, D1, D2, HAND, RATE = 0, 3, 6, 9, 18, 27, 29, 31, 33, 34
RECORD = 36

PART = 1 << 16
"""Triangles that are worked on together."""

SAME = 2e-6
"""Side of the cells, over a mesh's extent, in which points count as one place. Single precision
moves a point by a twentieth of it."""

CREASE = math.radians(40.0)
"""Below it, two faces around a point are one smooth surface: a fold of up to 80 degrees."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TriangleTables:
    """All triangles of a scene, around `centre`.

    centre : (3,) float64 [m] - subtracted from every point, so that float32 is spent on the shape
    points : (n, 3) float32 [m], triangles : (m, 3) uint32 - what rays are traced against
    records : (m, RECORD) float32
    uv : (m, 6) float32 - the mesh's own UV at the corners
    material : (m,) int32
    radius : float [m] - of the scene around `centre`
    """

    centre: NDArray[np.float64]
    points: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    records: NDArray[np.float32]
    uv: NDArray[np.float32]
    material: NDArray[np.int32]
    radius: float


def build_tables(scene: Scene) -> TriangleTables:
    """Gather the scene's meshes; triangles that cannot be traced are dropped and noted."""
    low, high = scene.bounds()
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        finite = [m.points[np.isfinite(m.points).all(axis=1)] for m in scene.meshes]
        every = np.concatenate([p for p in finite if len(p)] or [np.zeros((1, 3))])
        low, high = every.min(axis=0), every.max(axis=0)
    centre = 0.5 * (low + high)
    kept = [(mesh, _sound_triangles(scene, mesh)) for mesh in scene.meshes]
    parts = [_mesh_tables(scene, mesh, keep, centre) for mesh, keep in kept if keep.any()]
    counts = np.cumsum([0] + [len(p[0]) for p in parts])
    return TriangleTables(
        centre=centre,
        points=_stack([p[0] for p in parts], (0, 3), np.float32),
        triangles=_stack(
            [p[1] + c for p, c in zip(parts, counts, strict=False)], (0, 3), np.uint32
        ),
        records=_stack([p[2] for p in parts], (0, RECORD), np.float32),
        uv=_stack([p[3] for p in parts], (0, 6), np.float32),
        material=_stack([p[4] for p in parts], (0,), np.int32),
        radius=float(np.linalg.norm(high - low) / 2),
    )


def _stack(parts: list[NDArray[Any]], empty: tuple[int, ...], kind: Any) -> NDArray[Any]:
    if not parts:
        return np.zeros(empty, kind)
    return np.ascontiguousarray(np.concatenate(parts), kind)


def _mesh_tables(
    scene: Scene, mesh: Mesh, keep: NDArray[np.bool_], centre: NDArray[np.float64]
) -> tuple[Any, ...]:
    """Points, triangles, records, UV and materials of one mesh's triangles to keep.

    Written column by column, in float32 once the points are centred: a million triangles are
    meant to fit into a gigabyte with all that is done to them.
    """
    tri = np.asarray(mesh.triangles, np.int32)[keep]
    material = np.asarray(mesh.material, np.int32)[keep]
    finite = np.where(np.isfinite(mesh.points), mesh.points, 0.0)
    points = (finite - centre).astype(np.float32)
    records = np.zeros((len(tri), RECORD), np.float32)
    corner = points[tri[:, 0]]
    e1, e2 = points[tri[:, 1]] - corner, points[tri[:, 2]] - corner
    records[:, P0 : P0 + 3], records[:, E1 : E1 + 3], records[:, E2 : E2 + 3] = corner, e1, e2
    del corner
    area2 = np.cross(e1, e2)
    if mesh.normals is not None:
        normals = _unit(np.asarray(mesh.normals, np.float32)[keep], area2[:, None])
    elif mesh.smooth:
        normals = smooth_normals(points, tri)
    else:
        normals = np.repeat(_unit(area2, area2)[:, None], 3, axis=1)
    records[:, N : N + 9] = normals.reshape(-1, 9)
    uv = np.zeros((len(tri), 3, 2)) if mesh.uv is None else np.asarray(mesh.uv, np.float64)[keep]
    np.nan_to_num(uv, copy=False, nan=0.0, posinf=0.0, neginf=0.0)
    st = weave_coordinates(scene, mesh, uv, area2, material)
    tangents, records[:, HAND] = _grain(points, tri, e1, e2, st, normals)
    records[:, T : T + 9] = tangents.reshape(-1, 9)
    del normals, tangents
    records[:, ST : ST + 2] = _inside_repeat(scene, st[:, 0], material)
    records[:, D1 : D1 + 2] = d1 = st[:, 1] - st[:, 0]
    records[:, D2 : D2 + 2] = d2 = st[:, 2] - st[:, 0]
    # Gradients of both coordinates over the surface: coordinates per metre.
    square = np.maximum(np.einsum("ij,ij->i", area2, area2), np.float32(1e-36))[:, None]
    along, up = np.cross(e2, area2) / square, np.cross(area2, e1) / square
    for axis in range(2):
        gradient = d1[:, axis, None] * along + d2[:, axis, None] * up
        records[:, RATE + axis] = _length(gradient)
    return points, tri, records, uv.astype(np.float32).reshape(-1, 6), material


def _sound_triangles(scene: Scene, mesh: Mesh) -> NDArray[np.bool_]:
    """Which triangles have finite corners and an area; the others are noted."""
    tri = np.asarray(mesh.triangles)
    if not len(tri):
        return np.zeros(0, bool)
    finite = np.asarray(np.isfinite(mesh.points).all(axis=1))
    whole = finite[tri].all(axis=1)
    if not whole.all():
        scene.note(
            mesh.path,
            f"has {int((~finite).sum())} points that are not finite; "
            f"{int((~whole).sum())} triangles are left out",
        )
    points = np.where(finite[:, None], mesh.points, 0.0)
    solid = np.zeros(len(tri), bool)
    for part in _parts(len(tri)):
        p = points[tri[part]]
        longest = np.max(_length(p - np.roll(p, 1, axis=1)), axis=1)
        area2 = _length(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))
        solid[part] = area2 > 1e-10 * longest**2
    if (whole & ~solid).any():
        scene.note(mesh.path, f"has {int((whole & ~solid).sum())} triangles without area, left out")
    return np.asarray(whole & solid)


def _unit(v: NDArray[Any], instead: NDArray[Any]) -> NDArray[Any]:
    """`v` at length 1, and `instead` at length 1 where `v` has none or is not finite."""
    length = _length(v)[..., None]
    good = np.isfinite(length) & (length > 1e-12)
    if good.all():
        return np.asarray(v / length)
    other = instead / np.maximum(_length(instead)[..., None], 1e-30)
    return np.where(good, v / np.where(good, length, 1.0), other)


def _length(v: NDArray[Any]) -> NDArray[Any]:
    """Length along the last axis, in a third of the time of `numpy.linalg.norm`."""
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", v, v)))


def _parts(count: int) -> list[slice]:
    """Slices of at most PART triangles, so that what is computed on the way stays small."""
    return [slice(k, min(k + PART, count)) for k in range(0, count, PART)]


def smooth_normals(points: NDArray[Any], tri: NDArray[Any]) -> NDArray[np.float32]:
    """(m, 3, 3) unit normals at the corners: faces around a point, weighted by their angle there.

    Points at one place are one point, so a seam of the UVs is no crease. Where the faces around a
    point do not make one smooth surface, as along the edge of a box or the rim of a cylinder, each
    corner averages the faces that it can be reached from without crossing a crease.
    """
    place = _same_places(points)
    total = np.zeros((int(place.max(initial=0)) + 1, 3))
    for part in _parts(len(tri)):
        corners, shared = points[tri[part]], place[tri[part]]
        face = _face_normals(corners)
        for k in range(3):
            _add_at(total, shared[:, k], _angle_at(corners, k)[:, None] * face)
    normals = np.empty((len(tri), 3, 3), np.float32)
    creased = np.zeros(len(total), bool)
    for part in _parts(len(tri)):
        face, shared = _face_normals(points[tri[part]]), place[tri[part]]
        normals[part] = mean = _unit(total[shared], face[:, None])
        cosine = np.einsum("mkc,mc->mk", mean, face)
        creased[shared[cosine < math.cos(CREASE)]] = True
    if creased.any():
        corners = np.argwhere(creased[place[tri]])
        normals[corners[:, 0], corners[:, 1]] = _between_creases(points, tri, place, corners)
    return normals


def _between_creases(
    points: NDArray[Any], tri: NDArray[Any], place: NDArray[np.int64], corners: NDArray[np.int64]
) -> NDArray[Any]:
    """(k, 3) unit normals at `corners`, (k, 2) rows of triangle and corner number.

    All corners at a place must be given. Two of them are one surface where their triangles share an
    edge and are folded there by less than twice CREASE.
    """
    which, k = corners.T
    shape = points[tri[which]]
    face = _face_normals(shape)
    here = place[tri[which, k]]
    group = np.arange(len(which))
    edges = [(here, place[tri[which, (k + step) % 3]]) for step in (1, 2)]
    edge = group_numbers(*(np.concatenate(ends) for ends in zip(*edges, strict=True)))
    order = np.argsort(edge, kind="stable")
    one, other = order[:-1], order[1:]
    both = edge[one] == edge[other]
    one, other = one[both] % len(which), other[both] % len(which)
    smooth = np.einsum("ij,ij->i", face[one], face[other]) > math.cos(2 * CREASE)
    one, other = one[smooth], other[smooth]
    while (group[one] != group[other]).any():
        # The smaller number passes to the neighbour, and to whatever has the neighbour's number.
        least = np.minimum(group[one], group[other])
        for end in (one, other):
            np.minimum.at(group, group[end], least)
        group = group[group]
    angle = np.empty(len(which))
    for corner in range(3):
        mine = k == corner
        angle[mine] = _angle_at(shape[mine], corner)
    total = np.zeros((len(which), 3))
    _add_at(total, group, angle[:, None] * face)
    return _unit(total[group], face)


def _angle_at(corners: NDArray[Any], k: int) -> NDArray[Any]:
    """(n,) angle [rad] at corner `k` of triangles with (n, 3, 3) corners."""
    a = corners[:, (k + 1) % 3] - corners[:, k]
    b = corners[:, (k + 2) % 3] - corners[:, k]
    return np.arctan2(_length(np.cross(a, b)), np.einsum("ij,ij->i", a, b))


def _add_at(total: NDArray[Any], index: NDArray[np.int64], vectors: NDArray[Any]) -> None:
    """`total[index] += vectors`, (n, 3), also where an index occurs often."""
    for axis in range(3):
        total[:, axis] += np.bincount(index, vectors[:, axis], len(total))


def _face_normals(corners: NDArray[Any]) -> NDArray[Any]:
    """(n, 3, 3) corners -> (n, 3) unit normals."""
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return _unit(face, face)


def _same_places(points: NDArray[Any]) -> NDArray[np.int64]:
    """(n,) number of each point's place; points within a few millionths of the extent share one.

    Two grids of cells, the second shifted by half a cell: coincident points that rounding puts on
    either side of a border in one of them lie in one cell of the other.
    """
    extent = float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0
    at = (points - points.min(axis=0, initial=np.inf)) / max(extent * SAME, 1e-12)
    place, shifted = (
        group_numbers(*np.floor(at + shift).astype(np.int64).T) for shift in (0.5, 1.0)
    )
    while True:
        joined = _smallest_of_each(shifted, place)
        joined = _smallest_of_each(place, joined)
        if np.array_equal(joined, place):
            return place
        place = joined


def _smallest_of_each(group: NDArray[np.int64], value: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) for each entry the smallest `value` of those in its `group`."""
    smallest = np.full(int(group.max(initial=-1)) + 1, np.iinfo(np.int64).max)
    np.minimum.at(smallest, group, value)
    return smallest[group]


def group_numbers(*columns: NDArray[Any]) -> NDArray[np.int64]:
    """(n,) a number for each entry, equal exactly where all of the integer `columns` are."""
    key = np.zeros(len(columns[0]), np.int64)
    size = 1
    for column in columns:
        low = int(column.min(initial=0))
        span = int(column.max(initial=0)) - low + 1
        if size * span >= 1 << 63:
            known, key = np.unique(key, return_inverse=True)
            size = len(known)
        key = key * span + (column - low)
        size *= span
    return np.unique(key, return_inverse=True)[1].reshape(-1)


def weave_coordinates(
    scene: Scene,
    mesh: Mesh,
    uv: NDArray[np.float64],
    area2: NDArray[Any],
    material: NDArray[np.int32],
) -> NDArray[np.float64]:
    """(m, 3, 2) coordinates for the surface: threads where it is a fabric, UV elsewhere.

    area2 : (m, 3) - cross products of two edges [m2]
    """
    st = uv.copy()
    for index in np.unique(material):
        surface = scene.materials[index]
        if not isinstance(surface, FabricSurface):
            continue
        mine = material == index
        metres = measured_scale(uv[mine], area2[mine])
        if not metres > 0:
            scene.note(mesh.path, "has no UVs with an area; its fabric lies without a grain")
        st[mine] = surface.binding.weave_coordinates(uv[mine], metres or 1.0)
    return st


def measured_scale(uv: NDArray[np.float64], area2: NDArray[Any]) -> float:
    """Metres of cloth per UV unit, by area; 0 where the UVs have none."""
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    flat = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
    solid = np.linalg.norm(area2, axis=1).sum(dtype=np.float64)
    return float(np.sqrt(solid / flat)) if flat > 0 else 0.0


def _inside_repeat(
    scene: Scene, st: NDArray[np.float64], material: NDArray[np.int32]
) -> NDArray[np.float64]:
    """`st` reduced modulo each fabric's repeat, in float64."""
    base = st.copy()
    for index in np.unique(material):
        surface = scene.materials[index]
        if isinstance(surface, FabricSurface):
            mine = material == index
            base[mine] = np.mod(st[mine], np.array(true_repeat(surface.binding.fabric), np.float64))
    return base


def _grain(
    points: NDArray[Any],
    tri: NDArray[Any],
    e1: NDArray[Any],
    e2: NDArray[Any],
    st: NDArray[np.float64],
    normals: NDArray[Any],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(m, 3, 3) unit directions of growing u at the corners, and (m,) handedness of (u, v, N).

    Averaged over the triangles that share a point, its u direction and its handedness; a seam of
    the UVs with another grain stays a seam. Any direction where the coordinates have no area.
    """
    along = np.empty((len(tri), 3), np.float32)
    hand = np.empty(len(tri), np.float32)
    cells = np.empty((len(tri), 3, 2), np.int32)
    low = st.min(axis=(0, 1), initial=np.inf)
    scale = max(float(np.ptp(st)) * 1e-6, 1e-12)
    for part in _parts(len(tri)):
        d1, d2 = st[part, 1] - st[part, 0], st[part, 2] - st[part, 0]
        det = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
        direction = (e1[part] * d2[:, 1:] - e2[part] * d1[:, 1:]) * np.sign(det)[:, None]
        face = np.cross(e1[part], e2[part])
        steep = np.abs(face[:, :1]) < 0.7 * _length(face)[:, None]
        helper = np.where(steep, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        along[part] = _unit(direction, np.cross(np.cross(face, helper), face))
        hand[part] = np.where(det < 0, -1.0, 1.0)
        cells[part] = np.round((st[part] - low) / scale)
    # Corners share a grain when place, coordinates and handedness agree there.
    place = _same_places(points)[tri].ravel()
    left = np.repeat(hand < 0, 3)
    group = group_numbers(place, cells[..., 0].ravel(), cells[..., 1].ravel(), left).reshape(-1, 3)
    del cells, place, left
    total = np.zeros((int(group.max(initial=0)) + 1, 3), np.float32)
    for part in _parts(len(tri)):
        weighted = along[part] * _length(np.cross(e1[part], e2[part]))[:, None]
        for k in range(3):
            _add_at(total, group[part, k], weighted)
    tangents = np.empty((len(tri), 3, 3), np.float32)
    for part in _parts(len(tri)):
        mean, own = _unit(total[group[part]], along[part, None]), normals[part]
        flat = mean - own * np.einsum("mij,mij->mi", mean, own)[..., None]
        tangents[part] = _unit(flat, along[part, None])
    return tangents, hand
