"""Finds assets whose unit or up axis differs from that of the stage: USD does not convert them.

No note is made where the prim that references an asset scales and turns it accordingly.
"""

from __future__ import annotations

import math

import numpy as np
from pxr import Pcp, Sdf, Tf, Usd, UsdGeom

from fabricusd.scene.scene import Scene
from fabricusd.scene.usd.instances import as_matrix

_DETAIL = 1e-5
"""Ratio of a mesh's size to the scene's below which the steps of 32-bit coordinates are visible."""

_SMALLEST = 1e-6
"""Width of a scene [m] below which its unit must be wrong."""

_ALIKE = 1e-3
"""Relative difference below which two units count as the same."""

_UNITS = (1e-12, 1e16)
"""Smallest and largest unit [m]: a thousandth of a nanometre, and a light-year."""

_AXES = {"Y": np.array([0.0, 1.0, 0.0]), "Z": np.array([0.0, 0.0, 1.0])}
"""The axes that may point up."""

_PLACED = ("Mesh", "Camera", "Points", "BasisCurves", "PointInstancer", "Skeleton")
"""Types of prims whose lengths are in their layer's unit. Lights and others mostly come with one
of these."""


def stage_units(stage: Usd.Stage, scene: Scene) -> tuple[float, str]:
    """(metres in one unit of a stage, its up axis), with a note where either makes no sense."""
    where = stage.GetRootLayer().GetDisplayName()
    metres, up = 0.01, "Y"
    try:
        metres = float(UsdGeom.GetStageMetersPerUnit(stage))
    except Tf.ErrorException:
        scene.note(where, f"has a metersPerUnit that is not a number; {metres:g} is taken")
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        scene.note(where, f"has no metersPerUnit; USD's {metres:g} is taken")
    elif not _UNITS[0] <= metres <= _UNITS[1]:
        accepted = f"from {_UNITS[0]:g} to {_UNITS[1]:g}"
        scene.note(where, f"has metersPerUnit {metres:g}; 0.01 is taken; it must be {accepted}")
        metres = 0.01
    try:
        given = str(UsdGeom.GetStageUpAxis(stage))
    except Tf.ErrorException:
        given = "of another type"
    if given not in _AXES:
        scene.note(where, f"has an upAxis that is {given}; it must be Y or Z; {up} is taken")
        return metres, up
    return metres, given


def note_units(stage: Usd.Stage, metres: float, time: Usd.TimeCode, scene: Scene) -> None:
    """Note each layer that holds geometry and whose unit or up axis differs from the stage's.

    metres : in one unit of the stage
    """
    root = stage.GetRootLayer()
    up = scene.up_axis
    other = {
        layer: words
        for layer in stage.GetUsedLayers()
        if layer != root and layer != stage.GetSessionLayer()
        for words in [_difference(layer, metres, up)]
        if words and _holds_geometry(layer)
    }
    for layer in stage.GetLayerStack(includeSessionLayers=False):
        if layer in other:
            scene.note(layer.GetDisplayName(), f"{other.pop(layer)}; a sublayer is not converted")
    if not other:
        return
    cache = UsdGeom.XformCache(time)
    asked: set[Sdf.Path] = set()
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
        own = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        if own.GetPath() in asked or not (own.HasAuthoredReferences() or own.HasPayload()):
            continue
        asked.add(own.GetPath())
        for layer in _referenced(own):
            if layer in other and not _made_up_for(prim, layer, metres, up, cache):
                words = other.pop(layer)
                scene.note(
                    str(prim.GetPath()),
                    f"references {layer.GetDisplayName()}, which {words}; USD does not convert it",
                )
        if not other:
            return


def _difference(layer: Sdf.Layer, metres: float, up: str) -> str:
    """How a layer's unit and up axis differ from the stage's, or an empty string."""
    found = []
    own = _metres(layer)
    if own is not None and abs(own - metres) > _ALIKE * metres:
        found.append(f"is in units of {own:g} m in a stage of {metres:g} m")
    axis = _up(layer)
    if axis is not None and axis != up:
        found.append(f"has {axis} up in a stage with {up} up")
    return " and ".join(found)


def _metres(layer: Sdf.Layer) -> float | None:
    """Metres in one unit of the layer; None where it states none that makes sense."""
    given = layer.pseudoRoot.GetInfo("metersPerUnit") if _says(layer, "metersPerUnit") else None
    return given if isinstance(given, float) and math.isfinite(given) and given > 0 else None


def _up(layer: Sdf.Layer) -> str | None:
    given = layer.pseudoRoot.GetInfo("upAxis") if _says(layer, "upAxis") else None
    return str(given) if given in ("Y", "Z") else None


def _says(layer: Sdf.Layer, name: str) -> bool:
    return bool(layer.pseudoRoot.HasInfo(name))


def _holds_geometry(layer: Sdf.Layer) -> bool:
    """Whether a layer defines anything that has a size; a layer of fabrics alone does not."""
    found: list[Sdf.Path] = []

    def look(path: Sdf.Path) -> None:
        if not found and path.IsPrimPath() and layer.GetPrimAtPath(path).typeName in _PLACED:
            found.append(path)

    layer.Traverse(Sdf.Path.absoluteRootPath, look)
    return bool(found)


def _referenced(prim: Usd.Prim) -> list[Sdf.Layer]:
    """Root layers of the references and payloads of `prim` itself."""
    query = Usd.PrimCompositionQuery(prim)
    return [
        arc.GetTargetLayer()
        for arc in query.GetCompositionArcs()
        if arc.GetArcType() in (Pcp.ArcTypeReference, Pcp.ArcTypePayload) and not arc.IsAncestral()
    ]


def _made_up_for(
    prim: Usd.Prim, layer: Sdf.Layer, metres: float, up: str, cache: UsdGeom.XformCache
) -> bool:
    """Whether the prim's transform converts the layer's content to the stage's unit and up axis."""
    if any("unitsResolve" in str(name) for name in prim.GetPropertyNames()):
        return True
    matrix = as_matrix(cache.GetLocalToWorldTransform(prim))[:3, :3]
    size = abs(float(np.linalg.det(matrix))) ** (1 / 3)
    if not (math.isfinite(size) and size > 0):
        return False
    wanted = math.log((_metres(layer) or metres) / metres)
    # A scale nearer to the ratio of the units than to 1 is taken as a conversion.
    if abs(math.log(size) - wanted) > 0.5 * abs(wanted) + _ALIKE and abs(wanted) > _ALIKE:
        return False
    turned = matrix @ _AXES[_up(layer) or up]
    return float(turned @ _AXES[up]) > 0.5 * float(np.linalg.norm(turned))


def note_small_meshes(scene: Scene) -> None:
    """Note each mesh that is too small for the size of its scene."""
    found = [(m, m.points[np.isfinite(m.points).all(axis=1)]) for m in scene.meshes]
    boxes = [(mesh, p.min(axis=0), p.max(axis=0)) for mesh, p in found if len(p)]
    if not boxes:
        return
    low, high = scene.bounds()
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
