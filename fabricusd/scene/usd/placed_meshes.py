"""Places the meshes of a stage: those that instances share once, all others each where it stands.

What an instance does not share with the others, it has for itself: another fabric or material, the
pose of its own skeleton, a shape that an uneven scale gave it, or the size that a fabric without a
stated scale is measured by.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdGeom

from fabricusd.scene.placements import Placements
from fabricusd.scene.scene import FabricSurface, Mesh, Scene
from fabricusd.scene.surface.fineness import Fineness
from fabricusd.scene.surface.normals import group_numbers
from fabricusd.scene.usd.instances import MOST_COPIES, MOST_TRIANGLES, as_matrix
from fabricusd.scene.usd.light import is_light
from fabricusd.scene.usd.material import Materials
from fabricusd.scene.usd.mesh import FARTHEST, Placed, is_mirrored, read_mesh
from fabricusd.scene.usd.skeleton import Pose, Skeletons
from fabricusd.scene.usd.value import usd_words, value_of

_FLAT = 1e-6
"""Determinant of a transform over the cube of its norm below which it is not inverted."""

_ALIKE = 1e-5
"""Relative difference in stretch, and in size, of two instances that count as the same."""

MOST_SHAPED = 3_000_000
"""Most corners of all meshes together that are made of one mesh for instances of other shapes."""

_TOGETHER = 1e-9
"""Difference of two meshes' placements, relative to their extent, that is rounding."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Waiting:
    """A prim and its places; a mesh waits until the camera is known.

    own : (4, 4) - from the prim to the parent of `base`'s space
    base, before : a prim, and the (k, 4, 4) matrices that take it and all below it to the world
    """

    prim: Usd.Prim
    own: NDArray[np.float64]
    base: Usd.Prim
    before: NDArray[np.float64]

    @property
    def matrices(self) -> NDArray[np.float64]:
        """(k, 4, 4) from the prim to the world."""
        return np.asarray(self.before @ self.own)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Standing:
    """A mesh that is read once, and all the places where it stands.

    prims : of each place's path, the first of which is read; path_of : (k,) - of each place
    matrices : (k, 4, 4) - from its points to the world; mirrored : whether the first place mirrors
    """

    prims: list[Usd.Prim]
    path_of: NDArray[np.int32]
    matrices: NDArray[np.float64]
    mirrored: bool
    pose: Pose | None

    def part(self, chosen: NDArray[np.int64]) -> _Standing:
        """Some of the places, given by their numbers."""
        used, path_of = np.unique(self.path_of[chosen], return_inverse=True)
        prims = [self.prims[number] for number in used.tolist()]
        # The prim of the first place is the one that is read.
        first = int(path_of[0])
        prims[0], prims[first] = prims[first], prims[0]
        path_of = np.where(path_of == first, 0, np.where(path_of == 0, first, path_of))
        flips = is_mirrored(self.matrices[0]) != is_mirrored(self.matrices[chosen[0]])
        return replace(
            self, prims=prims, path_of=path_of.astype(np.int32), matrices=self.matrices[chosen],
            mirrored=self.mirrored != flips,
        )  # fmt: skip


class Meshes:
    """Adds meshes to a scene.

    metres : in one scene unit; one_sided : paths of those that are authored as one-sided
    """

    def __init__(
        self,
        materials: Materials,
        scene: Scene,
        time: Usd.TimeCode,
        metres: float,
        fineness: Fineness,
    ) -> None:
        self.materials, self.scene, self.time = materials, scene, time
        self.metres, self.fineness = metres, fineness
        self.skeletons = Skeletons(time, scene)
        self.one_sided: list[str] = []
        self._transforms: dict[Hashable, list[NDArray[np.float64]]] = {}
        self._read_once: set[Sdf.Path] = set()
        self._copied = (0, 0)

    def add(self, waiting: list[Waiting], *, instanced: bool) -> None:
        """Add the meshes of `waiting`; those that are alike once, if they are to be instanced."""
        alike: dict[Hashable, list[Waiting]] = {}
        for k, one in enumerate(waiting):
            try:
                key = self._key(one) if instanced else k
                alike.setdefault(key, []).append(one)
            except Tf.ErrorException as error:
                left_out(one.prim, error, self.scene)
        for together in alike.values():
            try:
                self._add_alike(together)
            except Tf.ErrorException as error:
                left_out(together[0].prim, error, self.scene)

    def _key(self, one: Waiting) -> Hashable:
        """What two prims have in common that are one mesh at several places."""
        prim = one.prim
        if not prim.IsInstanceProxy() or self.skeletons.pose(prim) is not None:
            return prim.GetPath()
        return _source(prim), self.materials.look(prim)

    def _add_alike(self, together: list[Waiting]) -> None:
        standing = self._standing(together)
        if standing is None:
            return
        if len(standing.matrices) == 1:
            if not self._is_full(standing.prims[0]):
                self._add_one(standing)
            return
        for chosen in self._parts(standing):
            if self._is_full(standing.prims[0]):
                return
            part = standing.part(chosen)
            if len(chosen) > 1:
                self._add_shared(part)
            else:
                self._add_one(part)

    def _is_full(self, prim: Usd.Prim) -> bool:
        """Whether no further copy of a mesh has room, with a note."""
        copies, triangles = self._copied
        if _source(prim) not in self._read_once:
            return False
        if copies < MOST_COPIES and triangles < MOST_TRIANGLES:
            return False
        words = f"{copies} of them have {triangles:.3g} triangles"
        self.scene.note(str(prim.GetPath()), f"has copies of instances that are left out: {words}")
        return True

    def _standing(self, together: list[Waiting]) -> _Standing | None:
        """All places of prims that are alike; None, with a note, where a skeleton has no place."""
        first = together[0]
        pose = self.skeletons.pose(first.prim)
        stacks = []
        for one in together:
            matrices = one.matrices
            if pose is not None and pose.skeleton is not None:
                matrices = one.before @ self._relative(pose.skeleton, one.base)
                if not np.isfinite(matrices).all():
                    where = str(one.prim.GetPath())
                    self.scene.note(where, "has a skeleton whose place is not finite, left out")
                    return None
            stacks.append(matrices)
        counts = [len(stack) for stack in stacks]
        return _Standing(
            prims=[one.prim for one in together],
            path_of=np.repeat(np.arange(len(stacks), dtype=np.int32), counts),
            matrices=np.concatenate(stacks) if len(stacks) > 1 else stacks[0],
            mirrored=is_mirrored(first.before[0] @ first.own),
            pose=pose,
        )

    def _relative(self, prim: Usd.Prim, base: Usd.Prim) -> NDArray[np.float64]:
        """(4, 4) from a skeleton to `base`, or to the world where it does not lie below `base`."""
        cache = UsdGeom.XformCache(self.time)
        if not prim.GetPath().HasPrefix(base.GetPath()):
            return as_matrix(cache.GetLocalToWorldTransform(prim))
        return as_matrix(cache.ComputeRelativeTransform(prim, base)[0])

    def _parts(self, standing: _Standing) -> Iterator[NDArray[np.int64]]:
        """The numbers of the places that share one mesh, for each such mesh."""
        linear = standing.matrices[:, :3, :3]
        size = np.linalg.norm(linear, axis=(1, 2))
        solid = np.abs(np.linalg.det(linear)) > _FLAT * size**3
        prim = standing.prims[0]
        # The weave of a fabric without a stated scale depends on the mesh's size and shape; smooth
        # normals and grain, on its shape.
        measured = self._is_measured(prim)
        same = _alike(linear, size, sized=measured)
        if not measured and (int(same.max()) + 1) * _corner_count(prim, self.time) > MOST_SHAPED:
            where = str(prim.GetPath())
            self.scene.note(where, "is smoothed before its instances stretch it: they are too many")
            same = np.zeros_like(same)
        group = np.where(solid, same, -1)
        order = np.argsort(group, kind="stable")
        starts = np.flatnonzero(np.diff(group[order], prepend=-2))
        for chosen in np.split(order, starts[1:]):
            if group[chosen[0]] >= 0:
                yield chosen
            else:
                yield from chosen[:, None]

    def _is_measured(self, prim: Usd.Prim) -> bool:
        """Whether a fabric of the mesh is as large as its UVs are on the mesh."""
        for number in self.materials.worn(prim):
            surface = self.scene.materials[number]
            if isinstance(surface, FabricSurface):
                binding = surface.binding
                if not (binding.threads_per_uv[0] or binding.metres_per_uv):
                    return True
        return False

    def _add_one(self, standing: _Standing) -> None:
        """Add a mesh at the first of its places."""
        mesh = self._read(standing)
        if mesh is not None:
            self.scene.meshes.append(mesh)

    def _add_shared(self, standing: _Standing) -> None:
        mesh = self._read(standing)
        if mesh is None:
            return
        matrices = standing.matrices
        transforms = (matrices @ np.linalg.inv(matrices[0]))[:, :3]
        transforms[:, :, 3] *= self.metres
        transforms[0] = np.eye(4)[:3]
        points = mesh.points[np.isfinite(mesh.points).all(axis=1)]
        reach = np.abs(transforms[:, :, :3]) @ np.abs(points).max(axis=0, initial=0.0)
        near = (reach + np.abs(transforms[:, :, 3]) < FARTHEST).all(axis=1)
        path_of = standing.path_of
        if not near.all():
            words = f"has {int((~near).sum())} instances beyond {FARTHEST:g} m, left out"
            self.scene.note(mesh.path, words)
            transforms, path_of = transforms[near], path_of[near]
        placements = Placements(
            transforms=self._known(transforms),
            paths=tuple(str(prim.GetPath()) for prim in standing.prims),
            path_of=path_of,
        )
        self.scene.meshes.append(replace(mesh, placements=placements))

    def _known(self, transforms: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same transforms as those of meshes that stand together with this one."""
        extent = np.abs(transforms).max(initial=1.0)
        last = np.round(transforms[-1:] / extent, 6) + 0.0
        alike = self._transforms.setdefault((len(transforms), last.tobytes()), [])
        for other in alike:
            if np.abs(other - transforms).max(initial=0.0) < _TOGETHER * extent:
                return other
        alike.append(transforms)
        return transforms

    def _read(self, standing: _Standing) -> Mesh | None:
        """The mesh at the first of its places; None, with a note, where it has no faces."""
        prim = standing.prims[0]
        where = str(prim.GetPath())
        if is_light(prim):
            self.scene.note(
                where, "is a light as well, which is left out: it is rendered as a mesh"
            )
        mesh = read_mesh(
            Placed(
                prim=prim, matrix=standing.matrices[0], mirrored=standing.mirrored,
                pose=standing.pose, places=standing.matrices,
            ),
            self.time, self.metres, self.materials, self.scene, self.fineness,
        )  # fmt: skip
        if mesh is None:
            return None
        if _source(prim) in self._read_once:
            copies, triangles = self._copied
            self._copied = copies + 1, triangles + len(mesh.triangles)
        self._read_once.add(_source(prim))
        sides = UsdGeom.Mesh(prim).GetDoubleSidedAttr()
        if sides.HasAuthoredValue() and value_of(sides, self.time, self.scene) is False:
            self.one_sided.append(where)
        return mesh


def _alike(
    linear: NDArray[np.float64], size: NDArray[np.float64], *, sized: bool
) -> NDArray[np.int64]:
    """(k,) equal numbers for transforms that differ by a rotation or mirror, and, unless `sized`,
    by an even scale."""
    size = np.maximum(size, 1e-300)[:, None]
    stretch = (np.swapaxes(linear, 1, 2) @ linear).reshape(-1, 9) / size**2
    columns = stretch[:, [0, 1, 2, 4, 5, 8]]
    if sized:
        columns = np.concatenate((columns, np.log(size)), axis=1)
    if np.ptp(columns, axis=0).max() < _ALIKE:
        return np.zeros(len(columns), np.int64)
    return group_numbers(*np.round(columns / _ALIKE).astype(np.int64).T)


def _source(prim: Usd.Prim) -> Sdf.Path:
    """The path of the prim that holds a mesh, for an instance that of its prototype."""
    own = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
    return own.GetPath()


def _corner_count(prim: Usd.Prim, time: Usd.TimeCode) -> int:
    indices = UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get(time)
    return 0 if indices is None else len(indices)


def left_out(prim: Usd.Prim, error: Tf.ErrorException, scene: Scene) -> None:
    """Note that USD cannot read a prim."""
    scene.note(str(prim.GetPath()), f"is left out: {usd_words(error)}")
