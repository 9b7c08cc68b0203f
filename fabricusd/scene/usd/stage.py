"""Reads a USD stage as a `Scene`: all that is visible, in world space and metres.

What cannot be read is left out, with a note of one line; everything else is rendered.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdGeom, UsdUtils

import fabricusd.schema  # registers the schema
from fabricusd.errors import FabricError, did_you_mean, one_line
from fabricusd.fabric import Binding
from fabricusd.scene.scene import Camera, Scene
from fabricusd.scene.surface.fineness import Fineness
from fabricusd.scene.usd.camera import read_camera
from fabricusd.scene.usd.instances import (
    OF_PROTOTYPES,
    Copies,
    Count,
    as_matrix,
    is_invisible,
    placed,
)
from fabricusd.scene.usd.light import is_light, read_light
from fabricusd.scene.usd.material import Materials
from fabricusd.scene.usd.placed_meshes import Meshes, Waiting, left_out
from fabricusd.scene.usd.units import note_small_meshes, note_units, stage_units
from fabricusd.scene.usd.value import note_types
from fabricusd.scene.usd.worn import names_fabric
from fabricusd.schema.rules.binding import place_problem
from fabricusd.schema.source import compose_stage, usd_errors

_PURPOSES = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
_DEEPEST = 8
"""Most point instancers inside one another; deeper ones are taken for a cycle."""

_READ_BY_USD = "xformOp.*|visibility|purpose|invisibleIds|exposure(:.*)?"
"""Attributes that USD's own functions read, and no reader here: transforms and the like."""

assert fabricusd.schema.PLUGIN_PATH


def read_usd_scene(
    path: Path,
    *,
    binding: Binding | None = None,
    camera: str | None = None,
    time_code: float | None = None,
    fineness: Fineness = Fineness(),  # noqa: B008
    instanced: bool = False,
) -> Scene:
    """Everything that is visible on the stage at `time_code`, or at its earliest time for None.

    binding : the fabric of meshes without a material of their own
    camera : path of the camera's prim, or its name where no other camera has it; None takes the
        first camera on the stage
    fineness : of subdivision surfaces; its camera is set to the one that is found
    instanced : whether meshes that instances share are read once, with their placements
    """
    stage, notes = _open(path)
    # USD would print several lines about a prim to standard error.
    warnings = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        # Notes tell of values that are not finite; NumPy would warn of them as well.
        with np.errstate(all="ignore"):
            reader = _Reader(stage, notes, binding, time_code, fineness, instanced=instanced)
            scene = reader.read(path, camera)
        for warning in warnings.TakeUncoalescedDiagnostics():
            scene.note(str(path), f"USD: {one_line(warning.commentary, 300)}")
    finally:
        del warnings
    return scene


def _open(path: Path) -> tuple[Usd.Stage, list[str]]:
    with usd_errors(str(path), "read as USD"):
        stage = compose_stage(str(path))
    return stage, [f"{path} {one_line(str(e), 200)}" for e in stage.GetCompositionErrors()]


class _Reader:
    def __init__(
        self,
        stage: Usd.Stage,
        notes: list[str],
        binding: Binding | None,
        time_code: float | None,
        fineness: Fineness,
        *,
        instanced: bool,
    ) -> None:
        self.stage = stage
        self.fineness = fineness
        self.instanced = instanced
        self.waiting: list[Waiting] = []
        self.time = Usd.TimeCode.EarliestTime() if time_code is None else Usd.TimeCode(time_code)
        self.scene = Scene(notes=notes)
        self.metres, self.scene.up_axis = stage_units(stage, self.scene)
        self.materials = Materials(self.scene, binding, self.time)
        self.copies = Copies(stage, self.time, self.scene, instanced=instanced)
        self.placed, self.refused = Count(), 0
        self.cameras: list[Usd.Prim] = []

    def read(self, path: Path, camera: str | None) -> Scene:
        root = self.stage.GetPseudoRoot()
        self._visit(root, UsdGeom.XformCache(self.time), np.eye(4)[None], ())
        self.scene.camera = self._camera(path, camera)
        # The camera may decide how finely a mesh is refined.
        fineness = replace(self.fineness, camera=self.scene.camera)
        meshes = Meshes(self.materials, self.scene, self.time, self.metres, fineness)
        meshes.add(self.waiting, instanced=self.instanced)
        self.one_sided = meshes.one_sided
        if not self.scene.meshes:
            self.scene.note(str(path), "holds no visible mesh with faces")
        self._note_the_whole()
        return self.scene

    def _note_the_whole(self) -> None:
        """Add the notes that tell of all prims together."""
        note_units(self.stage, self.metres, self.time, self.scene)
        if self.one_sided:
            first, count = self.one_sided[0], len(self.one_sided)
            others = f" and {count - 1} more have" if count > 1 else " has"
            self.scene.note(f"{first}{others}", "doubleSided = false; both sides are rendered")
        if self.refused > 1:
            self.scene.note("the scene", f"has {self.refused - 1} more prims left out for that")
        note_small_meshes(self.scene)

    def _visit(
        self,
        root: Usd.Prim,
        cache: UsdGeom.XformCache,
        before: NDArray[np.float64],
        inside: tuple[Sdf.Path, ...],
    ) -> None:
        """Add all that is visible under `root`.

        before : (k, 4, 4) - from its parent to the world, for each time that it is placed
        """
        base = root if root.IsPseudoRoot() else root.GetParent()
        for prim in self._visible(root, bool(inside)):
            note_types(prim, _READ_BY_USD, self.time, self.scene)
            try:
                own = as_matrix(cache.ComputeRelativeTransform(prim, base)[0])
                self._add(Waiting(prim=prim, own=own, base=base, before=before), inside)
            except Tf.ErrorException as error:
                left_out(prim, error, self.scene)

    def _add(self, one: Waiting, inside: tuple[Sdf.Path, ...]) -> None:
        """Add one visible prim of any type."""
        prim, where = one.prim, str(one.prim.GetPath())
        # A mesh tells of its own subsets.
        of_mesh = prim.IsA(UsdGeom.Subset) and prim.GetParent().IsA(UsdGeom.Mesh)
        if not of_mesh and names_fabric(prim):
            problem = place_problem(prim)
            if problem:
                self.scene.note(where, f"binds a fabric, left out: fabric:binding {problem}")
        if prim.IsA(UsdGeom.Camera):
            self.cameras.append(prim)
        elif not np.isfinite(one.own).all():
            self.scene.note(where, "has a transform that is not finite, left out")
        elif prim.IsA(UsdGeom.PointInstancer):
            self._instances(prim, one.matrices, inside)
        elif prim.IsA(UsdGeom.Mesh):
            self.waiting.append(one)
        elif is_light(prim):
            for matrix in one.matrices:
                light = read_light(prim, self.time, matrix, self.metres, self.scene)
                if light is not None:
                    self.scene.lights.append(light)
        elif prim.IsA(UsdGeom.Gprim) or prim.GetTypeName() == "Volume":
            self.scene.note(where, f"is a {prim.GetTypeName()}, left out; only meshes are rendered")

    def _visible(self, root: Usd.Prim, inside: bool) -> Iterator[Usd.Prim]:
        """The prims under `root` in order, without invisible ones, guides and proxies.

        inside : whether they belong to an instance, which has been counted with all that it holds
        """
        which = Usd.PrimDefaultPredicate if root.IsPseudoRoot() else OF_PROTOTYPES
        walk = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(which)))
        for prim in walk:
            hidden = is_invisible(prim, self.time)
            if hidden or prim.IsA(UsdGeom.PointInstancer):
                walk.PruneChildren()
            elif not (inside or self._has_room_for(prim)):
                walk.PruneChildren()
                continue
            imageable = UsdGeom.Imageable(prim)
            # A prim inherits a purpose only where it has none of its own.
            if not hidden and not (imageable and imageable.ComputePurpose() not in _PURPOSES):
                yield prim

    def _has_room_for(self, prim: Usd.Prim) -> bool:
        """False for a native instance that, with inner ones, would exceed the bounds."""
        if not prim.IsInstance() or prim.IsInstanceProxy():
            return True
        return self._can_place(prim, self.copies.below(prim).native())

    def _can_place(self, prim: Usd.Prim, count: Count) -> bool:
        """Whether so many more instances stay within the bounds; a note tells where they do not."""
        if math.isinf(count.copies):
            self.scene.note(str(prim.GetPath()), "instances itself, left out")
            return False
        total = self.placed + count
        too_many = total.too_many(instanced=self.instanced)
        if too_many:
            if not self.refused:
                self.scene.note(str(prim.GetPath()), f"is left out: it leads to {too_many}")
            self.refused += 1
            return False
        self.placed = total
        return True

    def _instances(
        self, prim: Usd.Prim, world: NDArray[np.float64], inside: tuple[Sdf.Path, ...]
    ) -> None:
        """Add the prims of each instance of a point instancer that lies at each of `world`."""
        if len(inside) >= _DEEPEST or prim.GetPath() in inside:
            self.scene.note(str(prim.GetPath()), "instances itself, left out")
            return
        if not inside and not prim.IsInstanceProxy():
            count = self.copies.of_instancer(UsdGeom.PointInstancer(prim))
            if not self._can_place(prim, count):
                return
        cache = UsdGeom.XformCache(self.time)
        found, within = placed(prim, self.time, self.scene), (*inside, prim.GetPath())
        if self.instanced:
            for root, _, places in found:
                every = (world[:, None] @ places).reshape(-1, 4, 4)
                self._visit(root, cache, every, within)
            return
        # Copies come in the order of the instances.
        one_by_one = [
            (number, root, place)
            for root, numbers, places in found
            for number, place in zip(numbers.tolist(), places, strict=True)
        ]
        for _, root, place in sorted(one_by_one, key=lambda one: one[0]):
            self._visit(root, cache, world @ place, within)

    def _camera_prim(self, path: Path, name: str) -> Usd.Prim:
        """The camera at the path `name`, or the only camera whose prim has that name."""
        prim = self.stage.GetPrimAtPath(name) if Sdf.Path.IsValidPathString(name) else None
        if prim and not prim.IsPseudoRoot() and prim.IsA(UsdGeom.Camera):
            return prim
        namesakes = [camera for camera in self.cameras if camera.GetName() == name]
        if len(namesakes) == 1:
            return namesakes[0]
        paths = [str(camera.GetPath()) for camera in self.cameras]
        if namesakes:
            several = ", ".join(str(camera.GetPath()) for camera in namesakes)
            raise FabricError(
                f"{path}:{name}", f"is the name of {len(namesakes)} cameras; give a path: {several}"
            )
        names = [camera.GetName() for camera in self.cameras]
        hint = did_you_mean(name, paths if "/" in name else names)
        raise FabricError(
            f"{path}:{name}", f"is not a camera{hint}; cameras are: {', '.join(paths) or 'none'}"
        )

    def _camera(self, path: Path, name: str | None) -> Camera | None:
        """The camera `name`, or the first camera that sees anything; None where there is none."""
        if name is not None:
            prim = self._camera_prim(path, name)
            found = self._read_camera(prim)
            if found is None:
                own = [n for n in self.scene.notes if n.startswith(f"{prim.GetPath()} ")]
                raise FabricError(str(path), own[-1] if own else f"{name} sees nothing")
            return found
        for prim in self.cameras:
            found = self._read_camera(prim)
            if found is not None:
                if len(self.cameras) > 1:
                    self.scene.note(found.path, f"is taken, one of {len(self.cameras)} cameras")
                return found
        return None

    def _read_camera(self, prim: Usd.Prim) -> Camera | None:
        try:
            return read_camera(prim, self.time, self.metres, self.scene)
        except Tf.ErrorException as error:
            left_out(prim, error, self.scene)
            return None
