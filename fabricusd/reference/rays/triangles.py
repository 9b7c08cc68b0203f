"""The scene's triangles as one record each, so that a hit reads two or three cache lines.

A record holds smooth normals and smooth grain directions at the corners, as [Bisker2011] section
5.3 requires. Weave coordinates are stored as a base inside one repeat plus differences, so that
float32 resolves the position inside a thread however large the UVs are.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.compiled import true_repeat
from fabricusd.scene.scene import FabricSurface, Mesh, Scene
from fabricusd.scene.surface.normals import (
    _add_at,
    _length,
    _parts,
    _same_places,
    _unit,
    group_numbers,
    measured_scale,
    smooth_normals,
)

# Columns of a record. P0 is a corner; E1 and E2 are the edges from it to the other corners. N and T
# are the normals and the directions of increasing u at the three corners. ST holds the coordinates
# at the first corner, D1 and D2 their differences along E1 and E2. HAND is the handedness of
# (u, v, N), and RATE the length of each coordinate's gradient [1/m].
P0, E1, E2, N, T, ST, D1, D2, HAND, RATE = 0, 3, 6, 9, 18, 27, 29, 31, 33, 34
RECORD = 36


class Triangles(NamedTuple):
    """What kernels read of the triangles: records : (m, RECORD) float32; material : (m,) int32."""

    records: NDArray[np.float32]
    material: NDArray[np.int32]


@dataclass(frozen=True)
class Group:
    """Meshes that are instanced together.

    first, count : of their triangles; first_place, places : of their placements
    """

    first: int
    count: int
    first_place: int
    places: int


@dataclass(frozen=True, kw_only=True, eq=False)
class TriangleTables:
    """All triangles of a scene, relative to `centre`; those of instances, relative to the middle of
    their group, behind all others.

    centre : (3,) float64 [m] - subtracted from every point, so that float32 resolves the shape
    points : (n, 3) float32 [m], triangles : (m, 3) uint32 - the geometry for ray tracing
    records : (m, RECORD) float32
    uv : (m, 6) float32 - the mesh's own UV at the corners
    material : (m,) int32
    home : (m, 2) int64 - ends and picks between the corner of the cloth and the repeat in which a
        triangle's weave coordinates begin; (0, 2) if no fabric of the scene has uneven threads
    radius : float [m] - of the scene around `centre`
    groups : of instanced meshes; placements : (k, 3, 4) float32 - from a group's triangles to the
        scene's, both relative to their middle
    """

    centre: NDArray[np.float64]
    points: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    records: NDArray[np.float32]
    uv: NDArray[np.float32]
    material: NDArray[np.int32]
    home: NDArray[np.int64]
    radius: float
    groups: tuple[Group, ...] = ()
    placements: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3, 4), np.float32))


def build_tables(scene: Scene) -> TriangleTables:
    """Build the tables of the scene's meshes; triangles that cannot be traced are left out with a
    note."""
    low, high = scene.bounds()
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        finite = [m.points[np.isfinite(m.points).all(axis=1)] for m in scene.meshes]
        every = np.concatenate([p for p in finite if len(p)] or [np.zeros((1, 3))])
        low, high = every.min(axis=0), every.max(axis=0)
    centre = 0.5 * (low + high)
    kept = [(m, _sound_triangles(scene, m)) for m in scene.meshes if m.placements is None]
    parts = [_mesh_tables(scene, mesh, keep, centre) for mesh, keep in kept if keep.any()]
    groups, placements = _groups(scene, centre, parts)
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
        home=_stack([p[5] for p in parts if p[5] is not None], (0, 2), np.int64),
        radius=float(np.linalg.norm(high - low) / 2),
        groups=groups,
        placements=_stack(placements, (0, 3, 4), np.float32),
    )


def _groups(
    scene: Scene, centre: NDArray[np.float64], parts: list[tuple[Any, ...]]
) -> tuple[tuple[Group, ...], list[NDArray[np.float64]]]:
    """The groups of instanced meshes, whose tables are added to `parts`, and their placements."""
    together: dict[int, list[Mesh]] = {}
    for mesh in scene.meshes:
        if mesh.placements is not None:
            together.setdefault(id(mesh.placements.transforms), []).append(mesh)
    groups, placements = [], []
    first, first_place = sum(len(p[1]) for p in parts), 0
    for meshes in together.values():
        kept = [(mesh, _sound_triangles(scene, mesh)) for mesh in meshes]
        alone = Scene(meshes=[replace(mesh, placements=None) for mesh in meshes])
        middle = 0.5 * np.add(*alone.bounds())
        own = [_mesh_tables(scene, mesh, keep, middle) for mesh, keep in kept if keep.any()]
        if not own or meshes[0].placements is None:
            continue
        parts += own
        moved = meshes[0].placements.transforms.copy()
        moved[:, :, 3] += moved[:, :, :3] @ middle - centre
        placements.append(moved)
        count = sum(len(p[1]) for p in own)
        groups.append(Group(first, count, first_place, len(moved)))
        first, first_place = first + count, first_place + len(moved)
    return tuple(groups), placements


def _stack(parts: list[NDArray[Any]], empty: tuple[int, ...], kind: Any) -> NDArray[Any]:
    if not parts:
        return np.zeros(empty, kind)
    return np.ascontiguousarray(np.concatenate(parts), kind)


def _mesh_tables(
    scene: Scene, mesh: Mesh, keep: NDArray[np.bool_], centre: NDArray[np.float64]
) -> tuple[Any, ...]:
    """Points, triangles, records, UVs and materials of the mesh's triangles that are kept.

    Fills the records column by column, in float32 once the points are centred, so that a million
    triangles fit into a gigabyte together with all temporary arrays.
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
    inside = _inside_repeat(scene, st[:, 0], material)
    records[:, ST : ST + 2] = inside
    home = np.rint(st[:, 0] - inside).astype(np.int64) if _any_uneven(scene) else None
    records[:, D1 : D1 + 2] = d1 = st[:, 1] - st[:, 0]
    records[:, D2 : D2 + 2] = d2 = st[:, 2] - st[:, 0]
    # Gradients of both coordinates over the surface [1/m].
    square = np.maximum(np.einsum("ij,ij->i", area2, area2), np.float32(1e-36))[:, None]
    along, up = np.cross(e2, area2) / square, np.cross(area2, e1) / square
    for axis in range(2):
        gradient = d1[:, axis, None] * along + d2[:, axis, None] * up
        records[:, RATE + axis] = _length(gradient)
    return points, tri, records, uv.astype(np.float32).reshape(-1, 6), material, home


def _sound_triangles(scene: Scene, mesh: Mesh) -> NDArray[np.bool_]:
    """(m,) which triangles have finite corners and an area; adds notes about the others."""
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


def weave_coordinates(
    scene: Scene,
    mesh: Mesh,
    uv: NDArray[np.float64],
    area2: NDArray[Any],
    material: NDArray[np.int32],
) -> NDArray[np.float64]:
    """(m, 3, 2) surface coordinates: threads on a fabric, UV elsewhere.

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
            scene.note(mesh.path, "has no UVs with an area; its fabric has no grain direction")
        st[mine] = surface.binding.weave_coordinates(uv[mine], metres or 1.0)
    return st


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


def _any_uneven(scene: Scene) -> bool:
    """Whether a fabric of the scene has threads that no repeat repeats, on either side."""
    fabrics = [m.binding.fabric for m in scene.materials if isinstance(m, FabricSurface)]
    return any(f.is_uneven or (f.back is not None and f.back.is_uneven) for f in fabrics)


def _grain(
    points: NDArray[Any],
    tri: NDArray[Any],
    e1: NDArray[Any],
    e2: NDArray[Any],
    st: NDArray[np.float64],
    normals: NDArray[Any],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(m, 3, 3) unit directions of increasing u at the corners, and (m,) handedness of (u, v, N).

    Directions are averaged over the triangles that share a point, its coordinates and its
    handedness, so a UV seam across which the grain changes stays a seam. The direction is arbitrary
    where the coordinates have no area.
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
