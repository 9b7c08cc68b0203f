"""Collect what is baked: the UV layout of each mesh, and how each fabric lies on it.

A mesh that occurs several times is baked once: its copies share a garment, see `copies`. Meshes
that cannot be baked are refused here, before any texel is computed.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.scattering.models import translucent
from fabricusd.bake.layout.copies import are_copies, topology
from fabricusd.bake.names import different_names, file_stem
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding, Fabric
from fabricusd.scene.scene import FabricSurface, Mesh, Scene
from fabricusd.scene.surface.normals import smooth_normals
from fabricusd.schema.names import prim_name

FIRST_TILE, LAST_TILE = 1001, 1109
"""UDIM numbers that are baked: ten columns and eleven rows, without the last row's last column."""

PART = 1 << 16
"""Triangles that are processed together."""

NOT_BAKED = ("weave", "back", "documentation")
"""Fields of a fabric that are digested separately or do not affect a texture. The back does where
light comes through the cloth."""

GREATEST = 1e9
"""Largest point [m] or UV that is accepted: beyond it, float64 cannot resolve a thread."""

FARTHEST = (-8.0, 32.0)
"""UVs are clamped to this range, which exceeds the tiles that are baked by a tile or more on each
side."""

OFFSET = 16
"""Added to a tile's column and row so that both lie from 0 to 63."""

FLATTEST = 1e-14
"""Twice the area in UV [units^2] below which a triangle counts as degenerate: 1e-7 squared."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lay:
    """How a fabric lies in UV: threads = matrix @ uv + offset, both float64.

    matrix : (2, 2), offset : (2,)
    """

    fabric: Fabric
    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]

    @property
    def along(self) -> NDArray[np.float64]:
        """(2, 2) unit directions in UV along which U and V of the weave increase, as columns."""
        columns = np.linalg.inv(self.matrix)
        return np.asarray(columns / np.linalg.norm(columns, axis=0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Garment:
    """The triangles of a mesh that wear fabrics, in UV, and how the fabrics lie on them.

    points : (n, 3) float64 [m], triangles : (m, 3) int
    normals : (m, 3, 3) float32 - unit normals at the corners
    uv : (m, 3, 2) float64
    lays : how each fabric lies on the mesh; lay : (m,) int - index of each triangle's lay
    mirrored : (m,) bool - True if the triangle's UVs run clockwise
    copies : paths of all prims that share the garment
    own_uv : False if the UVs are not those of the scene
    """

    name: str
    points: NDArray[np.float64]
    triangles: NDArray[Any]
    normals: NDArray[np.float32]
    uv: NDArray[np.float64]
    lays: tuple[Lay, ...]
    lay: NDArray[np.int32]
    mirrored: NDArray[np.bool_]
    copies: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())
    own_uv: bool = True

    @property
    def fingerprint(self) -> str:
        """A digest that changes if anything that is baked changes."""
        digest = hashlib.sha256()
        for array in (self.uv, self.lay, self.points, self.triangles):
            digest.update(np.ascontiguousarray(array).data)
        for lay in self.lays:
            # Not repr(lay.fabric): numpy prints the weave differently depending on other imports.
            cloth = lay.fabric
            parts = [getattr(cloth, f.name) for f in fields(cloth) if f.name not in NOT_BAKED]
            if translucent(cloth):
                parts.append(cloth.back)
            words = (parts, cloth.weave.cells.shape, lay.matrix.tolist(), lay.offset.tolist())
            digest.update(repr(words).encode())
            digest.update(np.ascontiguousarray(cloth.weave.cells).data)
        return digest.hexdigest()


def twice_areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) normals of triangles with corners (n, 3, 3); their length is twice the area."""
    edges = corners[:, 1:] - corners[:, :1]
    return np.asarray(np.cross(edges[:, 0], edges[:, 1]), np.float64)


def parts_of(count: int) -> list[slice]:
    """Return slices of at most PART triangles, which keep temporary arrays small."""
    return [slice(k, min(k + PART, count)) for k in range(0, count, PART)]


def metres_per_uv(
    points: NDArray[np.float64],
    tri: NDArray[Any],
    uv: NDArray[np.float64],
    mine: NDArray[np.bool_],
) -> float:
    """Return the metres of cloth per UV unit, by area, of the triangles in the mask `mine` (m,).

    0 if the triangles have no area.
    """
    flat = solid = 0.0
    for part in parts_of(len(tri)):
        chosen = mine[part]
        flat += float(np.abs(signed_area(uv[part][chosen])).sum())
        twice = twice_areas(points[tri[part][chosen]])
        solid += float(np.linalg.norm(twice, axis=1).sum())
    return math.sqrt(solid / flat) if flat > 0 else 0.0


def lay_of(binding: Binding, metres_per_uv: float) -> Lay:
    """Return the affine map that `Binding.weave_coordinates` evaluates."""
    base, u, v = binding.weave_coordinates(
        np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), metres_per_uv
    )
    return Lay(fabric=binding.fabric, matrix=np.stack((u - base, v - base), axis=1), offset=base)


def garments(
    scene: Scene,
    mesh: str | None = None,
    make: Callable[[Scene, Mesh], Garment | None] | None = None,
    *,
    turned: bool = True,
) -> list[Garment]:
    """Return a garment for each distinct mesh of `scene` that wears a fabric, or for `mesh` alone.

    make : converts a mesh to a garment, or to None if it wears no fabric; `garment_of` by default
    turned : whether a rotated mesh shares the garment of the original

    Raises FabricError if a mesh has no UVs, UVs without area, or points or UVs that are not finite,
    or if no mesh wears a fabric.
    """
    known = [m.path for m in scene.meshes]
    if mesh is not None and mesh not in known:
        raise FabricError(mesh, f"is not a mesh of the scene; it must be one of {', '.join(known)}")
    found: list[Garment] = []
    alike: dict[str, list[tuple[Mesh, int]]] = {}
    for one in scene.meshes:
        if mesh is not None and one.path != mesh:
            continue
        others = alike.setdefault(topology(one), [])
        number = next((k for other, k in others if are_copies(other, one, turned=turned)), None)
        if number is not None:
            first = found[number]
            found[number] = replace(first, copies=(*first.copies, one.path))
            continue
        made = (make or garment_of)(scene, one)
        if made is not None:
            others.append((one, len(found)))
            found.append(made)
    if not found:
        raise FabricError(
            mesh or "the scene", "wears no fabric; bind one, or give one with --fabric"
        )
    return _with_fabric_names(_with_names(found))


def _with_names(found: list[Garment]) -> list[Garment]:
    """Give the garments short, distinct names for files and prims."""
    tails = [one.copies[0].replace(":", "/").rstrip("/").rsplit("/", 1)[-1] for one in found]
    names = different_names([file_stem(tail) for tail in tails])
    return [replace(one, name=name) for one, name in zip(found, names, strict=True)]


def _with_fabric_names(found: list[Garment]) -> list[Garment]:
    """Give distinct fabrics distinct names, since files and looks find them by name."""
    cloths: list[Fabric] = []
    for one in found:
        cloths += [lay.fabric for lay in one.lays if lay.fabric not in cloths]
    wanted = [file_stem(prim_name(cloth.name), "Fabric") for cloth in cloths]
    names = different_names(wanted)

    def named(lay: Lay) -> Lay:
        cloth = lay.fabric
        name = names[cloths.index(cloth)]
        return lay if name == cloth.name else replace(lay, fabric=replace(cloth, name=name))

    return [replace(one, lays=tuple(named(lay) for lay in one.lays)) for one in found]


def garment_of(scene: Scene, mesh: Mesh) -> Garment | None:
    """Return a mesh in its own UVs, or None if it wears no fabric; raises as `garments` does."""
    material = np.asarray(mesh.material)
    fabrics = [int(k) for k in np.unique(material) if isinstance(scene.materials[k], FabricSurface)]
    if not fabrics and any(n.startswith(f"{mesh.path} has no UVs") for n in scene.notes):
        raise missing_uv(mesh.path)
    if not fabrics:
        return None
    if mesh.uv is None:
        raise missing_uv(mesh.path)
    worn = np.isin(material, fabrics)
    tri, uv = np.asarray(mesh.triangles), np.asarray(mesh.uv, np.float64)
    normals = mesh.normals
    if not worn.all():
        tri, uv, material = tri[worn], uv[worn], material[worn]
        normals = normals[worn] if normals is not None else None
    check_shape(mesh.path, mesh.points, tri, uv)
    turn = signed_area(uv)
    flat = np.abs(turn) < FLATTEST
    if flat.all():
        raise FabricError(mesh.path, "has UVs of zero area; unwrap it, or use --unwrap")
    lays, lay = [], np.zeros(len(tri), np.int32)
    for number, index in enumerate(fabrics):
        surface = scene.materials[index]
        assert isinstance(surface, FabricSurface)
        mine = material == index
        lays.append(lay_of(surface.binding, metres_per_uv(mesh.points, tri, uv, mine)))
        lay[mine] = number
    if normals is None:
        normals = smooth_normals(mesh.points, tri)
    normals = np.asarray(normals, np.float32)
    notes = []
    if flat.any():
        notes.append(f"{mesh.path} has {int(flat.sum())} triangles of zero area in UV, left out")
        keep = ~flat
        tri, uv, normals, lay, turn = tri[keep], uv[keep], normals[keep], lay[keep], turn[keep]
    return Garment(
        name="",
        points=mesh.points,
        triangles=tri,
        normals=normals,
        uv=uv,
        lays=tuple(lays),
        lay=lay,
        mirrored=turn < 0,
        copies=(mesh.path,),
        notes=tuple(notes),
    )


def fitted(garment: Garment) -> Garment:
    """Translate and uniformly scale a garment's UVs into the unit square.

    The fabric keeps its place on the mesh. Half a percent of the square remains free on each side.
    """
    low, high = garment.uv.min(axis=(0, 1)), garment.uv.max(axis=(0, 1))
    span = float((high - low).max()) / 0.99
    low = 0.5 * (low + high) - 0.5 * span
    lays = tuple(
        Lay(fabric=one.fabric, matrix=one.matrix * span, offset=one.offset + one.matrix @ low)
        for one in garment.lays
    )
    return replace(garment, uv=(garment.uv - low) / span, lays=lays, own_uv=False)


def missing_uv(path: str) -> FabricError:
    """Return the error for a mesh without UVs."""
    return FabricError(
        path, "has no UVs for its fabric; unwrap it, or use --unwrap with the axis of the warp"
    )


def signed_area(uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m,) twice the areas of triangles in UV (m, 3, 2), negative if the UVs run clockwise."""
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def check_shape(
    where: str, points: NDArray[np.float64], tri: NDArray[Any], uv: NDArray[np.float64]
) -> None:
    """Raise FabricError, with a count, for points or UVs that are not finite or out of bounds."""
    point = np.asarray(~(np.abs(points) <= GREATEST).all(axis=1))
    for noun, bad in (
        ("points", point[tri].any(axis=1)),
        ("UVs", ~(np.abs(uv) <= GREATEST).all(axis=(1, 2))),
    ):
        if bad.any():
            raise FabricError(
                where,
                f"has {int(bad.sum())} of {len(tri)} triangles with {noun} that are not finite or "
                f"beyond {GREATEST:g}, starting with triangle {int(np.argmax(bad))}; they must be "
                f"finite and at most {GREATEST:g} in magnitude",
            )


def tiles_of(garment: Garment, udim: bool) -> dict[int, tuple[int, int]]:
    """Return the (column, row) of each tile that the UVs reach, by UDIM number.

    A border at exactly 1.0 belongs to the tile before it. Without `udim` all UVs must lie in the
    first tile.
    """
    found: set[tuple[int, int]] = set()
    # UVs far outside all tiles are clamped, since integers might not hold their tile numbers.
    a, b, c = (garment.uv[:, k] for k in range(3))
    low = np.asarray(np.minimum(np.minimum(a, b), c)).clip(*FARTHEST)
    high = np.asarray(np.maximum(np.maximum(a, b), c)).clip(*FARTHEST)
    first = np.floor(low + 1e-9).astype(np.int64)
    last = np.maximum(np.ceil(high - 1e-9).astype(np.int64) - 1, first)
    # Pack each triangle's range of tiles into one integer: unique integers are found much faster
    # than unique rows of four.
    ends = np.concatenate((first, last), axis=1) + OFFSET
    for number in np.unique(ends @ np.array([1 << 18, 1 << 12, 1 << 6, 1])).tolist():
        ax, ay, bx, by = (((number >> shift) & 63) - OFFSET for shift in (18, 12, 6, 0))
        found |= {(x, y) for x in range(ax, bx + 1) for y in range(ay, by + 1)}
    outside = sorted(
        t for t in found if not (0 <= t[0] < 10 and 0 <= t[1] and _tile(t) <= LAST_TILE)
    )
    low, high = garment.uv.min(axis=(0, 1)), garment.uv.max(axis=(0, 1))
    reach = f"has UVs from ({low[0]:.6g}, {low[1]:.6g}) to ({high[0]:.6g}, {high[1]:.6g})"
    if outside:
        raise FabricError(
            garment.copies[0],
            f"{reach}; they must lie in tiles {FIRST_TILE} to {LAST_TILE}, which end at u = 10; "
            "--fit moves them into the unit square",
        )
    if not udim and found != {(0, 0)}:
        raise FabricError(
            garment.copies[0],
            f"{reach}, in {len(found)} tiles; they must lie from 0 to 1: bake UDIM tiles with "
            "--udim, or move them into the unit square with --fit",
        )
    return {_tile(t): t for t in sorted(found, key=_tile)}


def _tile(place: tuple[int, int]) -> int:
    return FIRST_TILE + place[0] + 10 * place[1]


def threads_per_uv(garment: Garment) -> float:
    """Return the largest number of threads along one UV unit, over all lays."""
    return max(float(np.linalg.norm(lay.matrix, axis=1).max()) for lay in garment.lays)


def resolution_for(garments: Sequence[Garment], texels_per_thread: float) -> int:
    """Return the power of two with at least that many texels for the thinnest thread."""
    if not 0.0 < texels_per_thread < math.inf:
        raise FabricError(
            "--texels-per-thread", f"is {texels_per_thread!r}; it must be a number above 0"
        )
    need = max(threads_per_uv(g) for g in garments) * texels_per_thread
    return 1 << max(6, math.ceil(math.log2(min(need, 1e300))))
