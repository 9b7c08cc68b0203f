"""Instances: what a point instancer places, and how much all instances come to.

They are counted before any is placed, and each prototype once: a thousand billion triangles may be
a product of small numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from fabricusd.scene.scene import Scene
from fabricusd.scene.usd.value import array_of, type_problem, value_of

MOST_COPIES = 100_000
"""Instances that a scene may have, those inside others too: some minutes of reading."""

_MOST_NAMED = 10 * MOST_COPIES
"""Instances of one instancer above which nobody asks which of them are hidden."""

MOST_TRIANGLES = 10_000_000
"""Triangles that a scene's instances may have together: some 8 GB when rendered."""

OF_PROTOTYPES = Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract
"""Prototypes often lie below an `over`, where nothing else would be seen."""

_PER_INSTANCE = (
    "positions", "orientations", "orientationsf", "scales", "velocities", "accelerations",
    "angularVelocities", "ids",
)  # fmt: skip
"""Arrays of a point instancer that have one value an instance, or none."""


@dataclass(frozen=True, kw_only=True)
class Count:
    """Instances and triangles; infinite where instances hold themselves."""

    copies: float = 0
    triangles: float = 0

    def __add__(self, other: Count) -> Count:
        return Count(copies=self.copies + other.copies, triangles=self.triangles + other.triangles)

    def times(self, number: int) -> Count:
        """As many in `number` copies, each of which is an instance too."""
        if not number:
            return Count()
        return Count(copies=number * (1 + self.copies), triangles=number * self.triangles)

    @property
    def too_many(self) -> str:
        """What is above its bound, in words; an empty string where nothing is."""
        if self.copies > MOST_COPIES:
            return f"{_told(self.copies)} instances; at most {MOST_COPIES} are placed"
        if self.triangles > MOST_TRIANGLES:
            words = f"{_told(self.triangles)} triangles"
            return f"{words}; instances may have {_told(MOST_TRIANGLES)} together"
        return ""


def _told(number: float) -> str:
    return f"{number:.0f}" if number < 1e6 else f"{number:.3g}"


class Copies:
    """Counts of prims with all that they instance."""

    def __init__(self, stage: Usd.Stage, time: Usd.TimeCode, scene: Scene) -> None:
        self.stage, self.time, self.scene = stage, time, scene
        self._known: dict[Sdf.Path, Count] = {}
        self._open: set[Sdf.Path] = set()

    def below(self, root: Usd.Prim) -> Count:
        """What lies below `root` and itself, an instance's prototype or an instancer's."""
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
                total += self.below(prim).times(1)
            elif prim.IsA(UsdGeom.PointInstancer):
                walk.PruneChildren()
                total += self.of_instancer(UsdGeom.PointInstancer(prim))
            elif prim.IsA(UsdGeom.Mesh):
                total += self._mesh(UsdGeom.Mesh(prim))
        return total

    def of_instancer(self, instancer: UsdGeom.PointInstancer) -> Count:
        """All that a point instancer places, without those that its mask hides."""
        named = value_of(instancer.GetProtoIndicesAttr(), self.time, self.scene)
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        if not named or not targets or array_problem(instancer, self.time):
            return Count()
        if len(named) > _MOST_NAMED:
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
        """Its faces as triangles, before they are refined; what is wrong with them is noted where
        they are read."""
        arrays = []
        for attribute in (mesh.GetFaceVertexIndicesAttr(), mesh.GetFaceVertexCountsAttr()):
            value = attribute.Get(self.time)
            arrays.append(() if value is None or type_problem(attribute, value) else value)
        return Count(triangles=max(len(arrays[0]) - 2 * len(arrays[1]), 0))


def is_invisible(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    """Whether a prim hides itself and all below it."""
    imageable = UsdGeom.Imageable(prim)
    return bool(imageable) and (imageable.GetVisibilityAttr().Get(time) == UsdGeom.Tokens.invisible)


def array_problem(instancer: UsdGeom.PointInstancer, time: Usd.TimeCode) -> str:
    """Why a point instancer's arrays cannot be used together; an empty string where they can."""
    prim = instancer.GetPrim()
    count = len(instancer.GetProtoIndicesAttr().Get(time))
    for name in _PER_INSTANCE:
        attribute = prim.GetAttribute(name)
        value = attribute.Get(time) if attribute else None
        wrong = type_problem(attribute, value)
        if wrong:
            return f"has an array of a wrong type: {name} {wrong}"
        length = 0 if value is None else len(value)
        # USD would read on behind the end of an array that is too short.
        if length != count and (length or name == "positions"):
            return f"has arrays of different lengths, {count} protoIndices and {length} {name}"
    return ""


def shown_instances(
    instancer: UsdGeom.PointInstancer, time: Usd.TimeCode, count: int
) -> NDArray[np.int64]:
    """Numbers of the instances that are neither invisible nor inactive."""
    mask = instancer.ComputeMaskAtTime(time)
    if not mask or len(mask) != count:
        return np.arange(count)
    return np.flatnonzero(np.array(mask, bool))


def placed(
    prim: Usd.Prim, time: Usd.TimeCode, scene: Scene
) -> list[tuple[Usd.Prim, NDArray[np.float64]]]:
    """(prototype, (4, 4) from where the prototype's parent would be to the instancer's space) of
    each instance that is seen; none, with a note, where the instancer makes no sense."""
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
    roots = [prim.GetStage().GetPrimAtPath(target) for target in targets]
    found = []
    for k in shown_instances(instancer, time, len(indices)).tolist():
        number = int(indices[k])
        root = roots[number] if 0 <= number < len(roots) else None
        place = as_matrix(moves[k])
        if not root or root.IsAbstract():
            scene.note(where, f"names prototype {number}, which is no prim to be seen")
        elif not np.isfinite(place).all():
            scene.note(where, "has instances whose place is not finite, left out")
        else:
            # The prototype keeps its own transform, not those of its parents.
            found.append((root, place))
    return found


def as_matrix(matrix: Any) -> NDArray[np.float64]:
    """A Gf matrix, which multiplies rows from the left, as one for columns."""
    return np.array(matrix, np.float64).T
