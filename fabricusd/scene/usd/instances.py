"""Instances: what a point instancer places, and how many triangles all instances have together.

Instances are counted before any is placed, and each prototype is counted once: small numbers may
multiply to a thousand billion triangles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from fabricusd.scene.scene import Scene
from fabricusd.scene.usd.value import array_of, type_problem, value_of

MOST_COPIES = 100_000
"""Most copies, and most native instances, in a scene, including those inside others: reading takes
some minutes."""

MOST_PLACED = 10_000_000
"""Most instances in a scene that are not copied."""

_MOST_NAMED = 10
"""Instances of one instancer over the most that are placed, above which hidden ones are not looked
for."""

MOST_TRIANGLES = 10_000_000
"""Most triangles of all copies together: some 8 GB when rendered."""

OF_PROTOTYPES = Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract
"""Which prims of a prototype are read: it often lies below an `over`, whose prims are undefined."""

_PER_INSTANCE = (
    "positions", "orientations", "orientationsf", "scales", "velocities", "accelerations",
    "angularVelocities", "ids",
)  # fmt: skip
"""Arrays of a point instancer that hold one value for each instance, or are empty."""


@dataclass(frozen=True, kw_only=True)
class Count:
    """Numbers of instances and triangles; infinite where an instance contains itself.

    walked : native instances whose prims are visited one by one, once for all that an instancer
        places
    """

    copies: float = 0
    triangles: float = 0
    walked: float = 0

    def __add__(self, other: Count) -> Count:
        return Count(
            copies=self.copies + other.copies,
            triangles=self.triangles + other.triangles,
            walked=self.walked + other.walked,
        )

    def times(self, number: int) -> Count:
        """The count of `number` copies that an instancer places, each of which is an instance."""
        if not number:
            return Count()
        return Count(
            copies=number * (1 + self.copies),
            triangles=number * self.triangles,
            walked=self.walked,
        )

    def native(self) -> Count:
        """The count of one native instance of this."""
        one = self.times(1)
        return replace(one, walked=one.walked + 1)

    def too_many(self, *, instanced: bool) -> str:
        """Which count exceeds its bound, in words; an empty string where none does.

        instanced : whether instances are placed, or copied
        """
        most = MOST_PLACED if instanced else MOST_COPIES
        if self.copies > most:
            return f"{_told(self.copies)} instances; at most {_told(most)} are placed"
        if instanced:
            if self.walked > MOST_COPIES:
                words = f"{_told(self.walked)} native instances"
                return f"{words}; at most {MOST_COPIES} are placed"
            return ""
        if self.triangles > MOST_TRIANGLES:
            words = f"{_told(self.triangles)} triangles"
            return f"{words}; instances may have {_told(MOST_TRIANGLES)} together"
        return ""


def _told(number: float) -> str:
    return f"{number:.0f}" if number < 1e6 else f"{number:.3g}"


class Copies:
    """Counts prims together with everything that they instance."""

    def __init__(
        self, stage: Usd.Stage, time: Usd.TimeCode, scene: Scene, *, instanced: bool
    ) -> None:
        self.stage, self.time, self.scene = stage, time, scene
        self._most_named = _MOST_NAMED * (MOST_PLACED if instanced else MOST_COPIES)
        self._known: dict[Sdf.Path, Count] = {}
        self._open: set[Sdf.Path] = set()

    def below(self, root: Usd.Prim) -> Count:
        """The count of `root` and all below it, the prototype of an instance or of an instancer."""
        if root.IsInstanceProxy():
            root = root.GetPrimInPrototype()
        if root.IsInstance():
            root = root.GetPrototype()
        path = root.GetPath()
        if path in self._open:
            return Count(copies=math.inf, triangles=math.inf)
        if path not in self._known:
            self._open.add(path)
            self._known[path] = self._counted(root)
            self._open.remove(path)
        return self._known[path]

    def _counted(self, root: Usd.Prim) -> Count:
        total = Count()
        walk = iter(Usd.PrimRange(root, OF_PROTOTYPES))
        for prim in walk:
            if is_invisible(prim, self.time):
                walk.PruneChildren()
            elif prim.IsInstance() and prim != root:
                total += self.below(prim).native()
            elif prim.IsA(UsdGeom.PointInstancer):
                walk.PruneChildren()
                total += self.of_instancer(UsdGeom.PointInstancer(prim))
            elif prim.IsA(UsdGeom.Mesh):
                total += self._mesh(UsdGeom.Mesh(prim))
        return total

    def of_instancer(self, instancer: UsdGeom.PointInstancer) -> Count:
        """The count of all that a point instancer places, without what its mask hides."""
        named = value_of(instancer.GetProtoIndicesAttr(), self.time, self.scene)
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        if not named or not targets or array_problem(instancer, self.time):
            return Count()
        if len(named) > self._most_named:
            return Count(copies=len(named))
        indices = np.array(named, np.int64)
        shown = shown_instances(instancer, self.time, len(indices))
        numbers, times = np.unique(indices[shown], return_counts=True)
        total = Count()
        for number, count in zip(numbers.tolist(), times.tolist(), strict=True):
            root = self.stage.GetPrimAtPath(targets[number]) if 0 <= number < len(targets) else None
            total += (self.below(root) if root else Count()).times(count)
        return total

    def _mesh(self, mesh: UsdGeom.Mesh) -> Count:
        """The count of a mesh's triangles before refinement; faults are noted when it is read."""
        arrays = []
        for attribute in (mesh.GetFaceVertexIndicesAttr(), mesh.GetFaceVertexCountsAttr()):
            value = attribute.Get(self.time)
            arrays.append(() if value is None or type_problem(attribute, value) else value)
        return Count(triangles=max(len(arrays[0]) - 2 * len(arrays[1]), 0))


def is_invisible(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    """Whether a prim hides itself and all prims below it."""
    imageable = UsdGeom.Imageable(prim)
    return bool(imageable) and (imageable.GetVisibilityAttr().Get(time) == UsdGeom.Tokens.invisible)


def array_problem(instancer: UsdGeom.PointInstancer, time: Usd.TimeCode) -> str:
    """Why a point instancer's arrays do not fit together; an empty string where they do."""
    prim = instancer.GetPrim()
    count = len(instancer.GetProtoIndicesAttr().Get(time))
    for name in _PER_INSTANCE:
        attribute = prim.GetAttribute(name)
        value = attribute.Get(time) if attribute else None
        wrong = type_problem(attribute, value)
        if wrong:
            return f"has an array of a wrong type: {name} {wrong}"
        length = 0 if value is None else len(value)
        # USD would read past the end of an array that is too short.
        if length != count and (length or name == "positions"):
            return f"has arrays of different lengths, {count} protoIndices and {length} {name}"
    return ""


def shown_instances(
    instancer: UsdGeom.PointInstancer, time: Usd.TimeCode, count: int
) -> NDArray[np.int64]:
    """Indices of the instances that are neither invisible nor inactive."""
    mask = instancer.ComputeMaskAtTime(time)
    if not mask or len(mask) != count:
        return np.arange(count)
    return np.flatnonzero(np.array(mask, bool))


def placed(
    prim: Usd.Prim, time: Usd.TimeCode, scene: Scene
) -> list[tuple[Usd.Prim, NDArray[np.int64], NDArray[np.float64]]]:
    """(prototype, numbers of its visible instances, their matrices) of each prototype; none, with a
    note, where the instancer makes no sense.

    The (n, 4, 4) matrices lead from the space of the prototype's parent to that of the instancer.
    """
    where = str(prim.GetPath())
    instancer = UsdGeom.PointInstancer(prim)
    indices = array_of(instancer.GetProtoIndicesAttr(), time, scene, np.int64)
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    if not len(indices) or not targets:
        scene.note(where, "has no instances or no prototypes, left out")
        return []
    problem = array_problem(instancer, time)
    if problem:
        scene.note(where, f"{problem}, left out")
        return []
    exclude = UsdGeom.PointInstancer.ExcludeProtoXform
    moves = instancer.ComputeInstanceTransformsAtTime(
        time, time, exclude, UsdGeom.PointInstancer.IgnoreMask
    )
    if len(moves) != len(indices):
        scene.note(where, "has arrays of different lengths, left out")
        return []
    # Gf matrices transform row vectors.
    places = np.array(moves, np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
    shown = shown_instances(instancer, time, len(indices))
    finite = np.isfinite(places[shown]).all(axis=(1, 2))
    if not finite.all():
        scene.note(where, "has instances whose place is not finite, left out")
        shown = shown[finite]
    found = []
    for number in np.unique(indices[shown]).tolist():
        known = 0 <= number < len(targets)
        root = prim.GetStage().GetPrimAtPath(targets[number]) if known else None
        if not root or root.IsAbstract():
            scene.note(where, f"names prototype {number}, which is not a prim that can be seen")
            continue
        own = shown[indices[shown] == number]
        # A prototype keeps its own transform, but not those of its parents.
        found.append((root, own, places[own]))
    return found


def as_matrix(matrix: Any) -> NDArray[np.float64]:
    """A Gf matrix, which transforms row vectors, as a NumPy matrix for column vectors."""
    return np.array(matrix, np.float64).T
