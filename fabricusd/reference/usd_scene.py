"""A USD stage as a `Scene`: what is visible, where it lies, in metres.

Whatever cannot be read is left out and noted in one line; the rest is rendered.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdGeom, UsdUtils

import fabricusd.schema  # registers the schema
from fabricusd.errors import FabricError, one_line
from fabricusd.fabric import Binding
from fabricusd.reference.fineness import Fineness
from fabricusd.reference.scene import Camera, Scene
from fabricusd.reference.usd_camera import read_camera
from fabricusd.reference.usd_light import is_light, read_light
from fabricusd.reference.usd_material import Materials
from fabricusd.reference.usd_mesh import read_mesh
from fabricusd.schema.access import applies_binding
from fabricusd.schema.source import compose_stage, usd_errors

_PURPOSES = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
_DEEPEST = 8
"""Point instancers inside one another before they are taken for a cycle."""

_OF_PROTOTYPES = Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract
"""Prototypes often lie below an `over`, where nothing else would be seen."""

_DETAIL = 1e-5
"""Size of a mesh over that of the scene below which 32-bit coordinates show."""

_SMALLEST = 1e-6
"""Width of a scene [m] below which its unit must be wrong; 32-bit numbers end at a thousandth."""

assert fabricusd.schema.PLUGIN_PATH


def read_usd_scene(
    path: Path,
    *,
    binding: Binding | None = None,
    camera: str | None = None,
    time_code: float | None = None,
    fineness: Fineness = Fineness(),  # noqa: B008
) -> Scene:
    """Everything visible on the stage at `time_code`; its earliest time where that is None.

    binding : on meshes without a material of their own
    camera : prim path; the first camera on the stage where that is None
    fineness : of subdivision surfaces; its camera is the one that is found
    """
    stage, notes = _open(path)
    # What USD has to say of a prim would be several lines on standard error.
    warnings = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        scene = _Reader(stage, notes, binding, time_code, fineness).read(path, camera)
        for warning in warnings.TakeUncoalescedDiagnostics():
            scene.note(str(path), f"USD: {one_line(warning.commentary, 300)}")
    finally:
        del warnings
    return scene


def _open(path: Path) -> tuple[Usd.Stage, list[str]]:
    with usd_errors(str(path), "read as USD"):
        stage = compose_stage(str(path))
    return stage, [f"{path} {one_line(str(e), 200)}" for e in stage.GetCompositionErrors()]


def as_matrix(matrix: Any) -> NDArray[np.float64]:
    """A Gf matrix, which multiplies rows from the left, as one for columns."""
    return np.array(matrix, np.float64).T


class _Reader:
    def __init__(
        self,
        stage: Usd.Stage,
        notes: list[str],
        binding: Binding | None,
        time_code: float | None,
        fineness: Fineness,
    ) -> None:
        self.stage = stage
        self.fineness = fineness
        self.waiting: list[tuple[Usd.Prim, NDArray[np.float64]]] = []
        self.time = Usd.TimeCode.EarliestTime() if time_code is None else Usd.TimeCode(time_code)
        self.scene = Scene(notes=notes, up_axis=str(UsdGeom.GetStageUpAxis(stage)))
        self.metres = UsdGeom.GetStageMetersPerUnit(stage)
        where = stage.GetRootLayer().GetDisplayName()
        if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
            self.scene.note(where, f"has no metersPerUnit; USD's {self.metres:g} is taken")
        elif not (math.isfinite(self.metres) and self.metres > 0):
            self.scene.note(where, f"has metersPerUnit {self.metres:g}; 0.01 is taken")
            self.metres = 0.01
        self.materials = Materials(self.scene, binding, self.time)
        self.cameras: list[Usd.Prim] = []

    def read(self, path: Path, camera: str | None) -> Scene:
        root = self.stage.GetPseudoRoot()
        self._visit(root, UsdGeom.XformCache(self.time), np.eye(4), ())
        self.scene.camera = self._camera(path, camera)
        # How finely a mesh is refined may depend on the camera.
        self.fineness = replace(self.fineness, camera=self.scene.camera)
        for prim, matrix in self.waiting:
            self._mesh(prim, matrix)
        if not self.scene.meshes:
            self.scene.note(str(path), "holds no visible mesh with faces")
        _note_small_meshes(self.scene)
        return self.scene

    def _visit(
        self,
        root: Usd.Prim,
        cache: UsdGeom.XformCache,
        before: NDArray[np.float64],
        inside: tuple[Sdf.Path, ...],
    ) -> None:
        """Add what is visible under `root`; `before` comes after each prim's own transform, from
        `root`'s parent on."""
        base = root if root.IsPseudoRoot() else root.GetParent()
        for prim in self._visible(root):
            where = str(prim.GetPath())
            if prim.IsA(UsdGeom.Camera):
                self.cameras.append(prim)
                continue
            matrix = before @ as_matrix(cache.ComputeRelativeTransform(prim, base)[0])
            if not np.isfinite(matrix).all():
                self.scene.note(where, "has a transform that is not finite, left out")
            elif prim.IsA(UsdGeom.PointInstancer):
                self._instances(prim, matrix, inside)
            elif prim.IsA(UsdGeom.Mesh):
                self.waiting.append((prim, matrix))
            elif is_light(prim):
                light = read_light(prim, self.time, matrix, self.metres, self.scene)
                if light is not None:
                    self.scene.lights.append(light)
            elif prim.IsA(UsdGeom.Gprim) or prim.GetTypeName() == "Volume":
                self.scene.note(where, f"is a {prim.GetTypeName()}, left out; only meshes are seen")
            elif applies_binding(prim):
                self.scene.note(where, "binds a fabric, left out: only meshes and subsets wear one")

    def _mesh(self, prim: Usd.Prim, matrix: NDArray[np.float64]) -> None:
        if is_light(prim):
            self.scene.note(str(prim.GetPath()), "shines as a light, left out: it is a mesh alone")
        # What is not finite is noted; NumPy would write of it to standard error as well.
        with np.errstate(all="ignore"):
            mesh = read_mesh(
                prim, self.time, matrix, self.metres, self.materials, self.scene, self.fineness
            )
        if mesh is not None:
            self.scene.meshes.append(mesh)

    def _visible(self, root: Usd.Prim) -> Iterator[Usd.Prim]:
        """Prims under `root` in order, without invisible ones and what only serves others."""
        which = Usd.PrimDefaultPredicate if root.IsPseudoRoot() else _OF_PROTOTYPES
        walk = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(which)))
        for prim in walk:
            imageable = UsdGeom.Imageable(prim)
            hidden = imageable and (
                imageable.GetVisibilityAttr().Get(self.time) == UsdGeom.Tokens.invisible
            )
            if hidden or prim.IsA(UsdGeom.PointInstancer):
                walk.PruneChildren()
            # A purpose is handed down only to those that have none of their own.
            if not hidden and not (imageable and imageable.ComputePurpose() not in _PURPOSES):
                yield prim

    def _instances(
        self, prim: Usd.Prim, world: NDArray[np.float64], inside: tuple[Sdf.Path, ...]
    ) -> None:
        """Each instance of a point instancer that lies at `world`: its prototype's prims, moved."""
        where = str(prim.GetPath())
        if len(inside) >= _DEEPEST or prim.GetPath() in inside:
            self.scene.note(where, "instances itself; the inner instances are left out")
            return
        instancer = UsdGeom.PointInstancer(prim)
        indices = instancer.GetProtoIndicesAttr().Get(self.time)
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        if not indices or not targets:
            self.scene.note(where, "has no instances or no prototypes, left out")
            return
        exclude = UsdGeom.PointInstancer.ExcludeProtoXform
        try:
            moves = instancer.ComputeInstanceTransformsAtTime(
                self.time, self.time, exclude, UsdGeom.PointInstancer.IgnoreMask
            )
        except Tf.ErrorException as error:
            self.scene.note(where, f"is left out: {one_line(str(error), 200)}")
            return
        mask = instancer.ComputeMaskAtTime(self.time) or [True] * len(indices)
        if len(moves) != len(indices):
            self.scene.note(where, "has arrays of different lengths, left out")
            return
        cache = UsdGeom.XformCache(self.time)
        for index, move, shown in zip(indices, moves, mask, strict=True):
            root = self.stage.GetPrimAtPath(targets[index]) if 0 <= index < len(targets) else None
            if not shown:
                continue
            if not root or root.IsAbstract():
                self.scene.note(where, f"names prototype {index}, which is no prim to be seen")
                continue
            place = as_matrix(move)
            if not np.isfinite(place).all():
                self.scene.note(where, "has instances whose place is not finite, left out")
                continue
            # The prototype keeps its own transform, not those of its parents.
            self._visit(root, cache, world @ place, (*inside, prim.GetPath()))

    def _camera(self, path: Path, name: str | None) -> Camera | None:
        """The camera `name`, or the first that sees anything; None where there is none."""
        if name is not None:
            prim = self.stage.GetPrimAtPath(name) if Sdf.Path.IsValidPathString(name) else None
            if not prim or not prim.IsA(UsdGeom.Camera):
                known = ", ".join(str(p.GetPath()) for p in self.cameras) or "none"
                raise FabricError(f"{path}:{name}", f"is no camera; the scene's are: {known}")
            found = read_camera(prim, self.time, self.metres, self.scene)
            if found is None:
                raise FabricError(str(path), self.scene.notes[-1])
            return found
        for prim in self.cameras:
            found = read_camera(prim, self.time, self.metres, self.scene)
            if found is not None:
                if len(self.cameras) > 1:
                    self.scene.note(found.path, f"is taken, one of {len(self.cameras)} cameras")
                return found
        return None


def _note_small_meshes(scene: Scene) -> None:
    """One line for each mesh that is lost in the size of its scene."""
    found = [(m, m.points[np.isfinite(m.points).all(axis=1)]) for m in scene.meshes]
    boxes = [(mesh, p.min(axis=0), p.max(axis=0)) for mesh, p in found if len(p)]
    if not boxes:
        return
    low, high = np.min([b[1] for b in boxes], axis=0), np.max([b[2] for b in boxes], axis=0)
    whole = float(np.linalg.norm(high - low))
    if 0 < whole < _SMALLEST:
        scene.note("the scene", f"is {whole:.3g} m wide; is metersPerUnit right?")
    for mesh, low, high in boxes:
        size = float(np.linalg.norm(high - low))
        if 0 < size < _DETAIL * whole:
            scene.note(
                mesh.path,
                f"is {size:.3g} m wide in a scene of {whole:.3g} m; 32-bit coordinates show there",
            )
