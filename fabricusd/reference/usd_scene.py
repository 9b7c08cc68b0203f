"""A USD stage as a `Scene`: what is visible, where it lies, in metres.

Whatever cannot be read is left out and noted in one line; the rest is rendered.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdGeom

import fabricusd.schema  # registers the schema, before the first stage is opened
from fabricusd.errors import FabricError
from fabricusd.fabric import Binding
from fabricusd.reference.scene import Camera, Scene
from fabricusd.reference.usd_light import is_light, read_light
from fabricusd.reference.usd_material import Materials
from fabricusd.reference.usd_mesh import read_mesh

_PURPOSES = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
_DEEPEST = 8
"""Point instancers inside one another before they are taken for a cycle."""

_SOLIDS = ("Cube", "Sphere", "Cylinder", "Cone", "Capsule", "Plane", "BasisCurves", "NurbsPatch")

assert fabricusd.schema.PLUGIN_PATH


def read_usd_scene(
    path: Path,
    *,
    binding: Binding | None = None,
    camera: str | None = None,
    time_code: float | None = None,
    level: int = 0,
) -> Scene:
    """Everything visible on the stage at `time_code`; its earliest time where that is None.

    binding : on meshes without a material of their own
    camera : prim path; the first camera on the stage where that is None
    level : how often the edges of subdivision surfaces are halved; 0 for their cages
    """
    stage, notes = _open(path)
    return _Reader(stage, notes, binding, time_code, level).read(path, camera)


def _open(path: Path) -> tuple[Usd.Stage, list[str]]:
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise FabricError(str(path), f"cannot be read as USD: {_one_line(str(error))}") from error
    notes = [f"{path} {_one_line(str(e))}" for e in stage.GetCompositionErrors()]
    return stage, notes


def _one_line(text: str) -> str:
    words = " ".join(text.split())
    return words if len(words) <= 200 else words[:197] + "..."


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
        level: int,
    ) -> None:
        self.stage = stage
        self.level = level
        self.time = Usd.TimeCode.EarliestTime() if time_code is None else Usd.TimeCode(time_code)
        self.metres = UsdGeom.GetStageMetersPerUnit(stage)
        self.scene = Scene(notes=notes, up_axis=str(UsdGeom.GetStageUpAxis(stage)))
        self.materials = Materials(self.scene, binding, self.time)
        self.cameras: list[Usd.Prim] = []

    def read(self, path: Path, camera: str | None) -> Scene:
        root = self.stage.GetPseudoRoot()
        self._visit(root, UsdGeom.XformCache(self.time), np.eye(4), 0, ())
        self.scene.camera = self._camera(path, camera)
        if not self.scene.meshes:
            self.scene.note(str(path), "holds no visible mesh with faces")
        return self.scene

    def _visit(
        self,
        root: Usd.Prim,
        cache: UsdGeom.XformCache,
        before: NDArray[np.float64],
        depth: int,
        inside: tuple[Sdf.Path, ...],
    ) -> None:
        """Add what is visible under `root`; `before` comes after each prim's own transform."""
        for prim in self._visible(root):
            if prim.IsA(UsdGeom.PointInstancer):
                self._instances(prim, cache, before, depth, inside)
                continue
            if prim.IsA(UsdGeom.Camera):
                self.cameras.append(prim)
                continue
            matrix = before @ as_matrix(cache.GetLocalToWorldTransform(prim))
            if prim.IsA(UsdGeom.Mesh):
                mesh = read_mesh(
                    prim, self.time, matrix, self.metres, self.materials, self.scene, self.level
                )
                if mesh is not None:
                    self.scene.meshes.append(mesh)
            elif is_light(prim):
                light = read_light(prim, self.time, matrix, self.metres, self.scene)
                if light is not None:
                    self.scene.lights.append(light)
            elif prim.GetTypeName() in _SOLIDS:
                self.scene.note(
                    str(prim.GetPath()),
                    f"is a {prim.GetTypeName()}, left out; only meshes are seen",
                )

    def _visible(self, root: Usd.Prim) -> Iterator[Usd.Prim]:
        """Prims under `root` in order, without invisible ones and what only serves others."""
        walk = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
        for prim in walk:
            imageable = UsdGeom.Imageable(prim)
            if imageable:
                hidden = imageable.GetVisibilityAttr().Get(self.time) == UsdGeom.Tokens.invisible
                if hidden or imageable.ComputePurpose() not in _PURPOSES:
                    walk.PruneChildren()
                    continue
            if prim.IsA(UsdGeom.PointInstancer):
                walk.PruneChildren()
            yield prim

    def _instances(
        self,
        prim: Usd.Prim,
        cache: UsdGeom.XformCache,
        before: NDArray[np.float64],
        depth: int,
        inside: tuple[Sdf.Path, ...],
    ) -> None:
        """Each instance of a point instancer: its prototype's prims, moved."""
        where = str(prim.GetPath())
        if depth >= _DEEPEST or prim.GetPath() in inside:
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
            self.scene.note(where, f"is left out: {_one_line(str(error))}")
            return
        mask = instancer.ComputeMaskAtTime(self.time) or [True] * len(indices)
        world = before @ as_matrix(cache.GetLocalToWorldTransform(prim))
        if len(moves) != len(indices):
            self.scene.note(where, "has arrays of different lengths, left out")
            return
        for index, move, shown in zip(indices, moves, mask, strict=True):
            root = self.stage.GetPrimAtPath(targets[index]) if 0 <= index < len(targets) else None
            if not root or not shown:
                if shown:
                    self.scene.note(where, f"names prototype {index}, which is no prim")
                continue
            # The prototype keeps its own transform, not those of its parents.
            local = UsdGeom.XformCache(self.time)
            parent = np.linalg.inv(as_matrix(local.GetParentToWorldTransform(root)))
            self._visit(
                root, local, world @ as_matrix(move) @ parent, depth + 1,
                (*inside, prim.GetPath()),
            )  # fmt: skip

    def _camera(self, path: Path, name: str | None) -> Camera | None:
        if name is not None:
            prim = self.stage.GetPrimAtPath(name) if Sdf.Path.IsValidPathString(name) else None
            if not prim or not prim.IsA(UsdGeom.Camera):
                known = ", ".join(str(p.GetPath()) for p in self.cameras) or "none"
                raise FabricError(f"{path}:{name}", f"is no camera; the scene's are: {known}")
        elif self.cameras:
            prim = self.cameras[0]
            if len(self.cameras) > 1:
                self.scene.note(
                    str(prim.GetPath()), f"is taken, the first of {len(self.cameras)} cameras"
                )
        else:
            return None
        return _read_camera(prim, self.time, self.metres)


def _read_camera(prim: Usd.Prim, time: Usd.TimeCode, metres: float) -> Camera:
    camera = UsdGeom.Camera(prim)

    def value(attribute: Any) -> float:
        return float(attribute.Get(time))

    frame = as_matrix(UsdGeom.XformCache(time).GetLocalToWorldTransform(prim))
    frame[:3, 3] *= metres
    lengths = np.linalg.norm(frame[:3, :3], axis=0)
    frame[:3, :3] /= np.maximum(lengths, 1e-30)
    # A camera's lengths on film are in tenths of a scene unit, whatever that is.
    film = 0.1 * metres
    orthographic = camera.GetProjectionAttr().Get(time) == UsdGeom.Tokens.orthographic
    near, far = camera.GetClippingRangeAttr().Get(time)
    return Camera(
        path=str(prim.GetPath()),
        frame=frame,
        focal_length=value(camera.GetFocalLengthAttr()) * film,
        aperture=(
            value(camera.GetHorizontalApertureAttr()) * film,
            value(camera.GetVerticalApertureAttr()) * film,
        ),
        aperture_offset=(
            value(camera.GetHorizontalApertureOffsetAttr()) * film,
            value(camera.GetVerticalApertureOffsetAttr()) * film,
        ),
        f_stop=value(camera.GetFStopAttr()),
        focus_distance=value(camera.GetFocusDistanceAttr()) * metres,
        orthographic=orthographic,
        clipping=(near * metres, far * metres),
        exposure=value(camera.GetExposureAttr()),
    )
