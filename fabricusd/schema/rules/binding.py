"""Rules of a WovenBindingAPI."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdLux, UsdShade

from fabricusd.schema.access import (
    applies_binding,
    kind_of,
    lost_targets,
    over_above,
    targets,
    type_of,
    unbinds,
    value,
)
from fabricusd.schema.rules.table import BINDING, Fault, rule


@rule(BINDING)
def binding_names_a_fabric(prim: Usd.Prim) -> Iterator[Fault]:
    """A binding targets exactly one prim, a WovenFabric, or none, which takes the fabric off."""
    name = "fabric:binding"
    found = targets(prim, name)
    if unbinds(prim) or (not found and lost_targets(prim, name)):
        return  # another rule reports a target that is lost
    if len(found) != 1:
        yield name, f"has {len(found)} targets; it must have 1, a WovenFabric prim"
        return
    target = prim.GetStage().GetPrimAtPath(found[0])
    if not target:
        yield name, f"targets {found[0]}, which does not exist; it must be a WovenFabric"
    elif type_of(target) != "WovenFabric":
        yield name, f"targets {found[0]}, {kind_of(target)}; it must be a WovenFabric"


@rule(BINDING, fatal=False)
def bound_fabric_defined(prim: Usd.Prim) -> Iterator[Fault]:
    """No `over` lies above a fabric that is bound: programs that list fabrics would miss it."""
    for path in targets(prim, "fabric:binding")[:1]:
        target = prim.GetStage().GetPrimAtPath(path)
        over = over_above(target) if target and prim.IsDefined() else None
        if over:
            yield (
                "fabric:binding",
                f"targets {path}, which lies below {over.GetPath()}, an over; "
                "every prim above it must be a def",
            )


_WORN = "it must be on a Mesh, a GeomSubset of a mesh's faces, a Material or a prim above meshes"


def place_problem(prim: Usd.Prim) -> str:
    """Why a binding on `prim` has no effect; an empty string if it has one."""
    kind = str(prim.GetTypeName())
    if prim.IsA(UsdGeom.Subset):
        element = UsdGeom.Subset(prim).GetElementTypeAttr().Get()
        if not prim.GetParent().IsA(UsdGeom.Mesh):
            return f"is on a GeomSubset of no mesh; {_WORN}"
        if element not in (UsdGeom.Tokens.face, None):
            return f"is on a GeomSubset of the type '{element}'; {_WORN}"
        return ""
    if not kind or prim.IsA(UsdGeom.Mesh) or prim.IsA(UsdShade.Material):
        return ""
    # Meshes hand nothing down, and nothing below a light or a camera is seen.
    alone = (UsdGeom.Gprim, UsdGeom.Camera, UsdLux.BoundableLightBase, UsdLux.NonboundableLightBase)
    if prim.IsA(UsdGeom.Imageable) and not any(prim.IsA(one) for one in alone):
        return ""
    return f"is on a {kind}; {_WORN}"


@rule(BINDING)
def binding_can_be_worn(prim: Usd.Prim) -> Iterator[Fault]:
    """A binding is on a mesh, a subset of its faces, a material, or a prim above meshes."""
    problem = place_problem(prim)
    if problem:
        yield "fabric:binding", problem


@rule(BINDING, fatal=False)
def subsets_share_no_face(prim: Usd.Prim) -> Iterator[Fault]:
    """No face is in two subsets that wear fabrics of their own."""
    mesh = prim.GetParent()
    if not prim.IsA(UsdGeom.Subset) or not mesh.IsA(UsdGeom.Mesh) or unbinds(prim):
        return
    mine = _faces(prim)
    for other in UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(mesh)):
        if other.GetPrim() == prim:
            return  # the later of two subsets reports the pair
        if applies_binding(other.GetPrim()) and not unbinds(other.GetPrim()):
            both = np.intersect1d(mine, _faces(other.GetPrim()))
            if both.size:
                yield (
                    "indices",
                    f"has {both.size} faces of {other.GetPrim().GetName()}, the first is "
                    f"{both[0]}; a face must be in one subset that wears a fabric",
                )


def _faces(prim: Usd.Prim) -> NDArray[np.int64]:
    """(n,) indices of a subset's faces."""
    indices = UsdGeom.Subset(prim).GetIndicesAttr().Get(Usd.TimeCode.EarliestTime())
    return np.asarray(indices if indices is not None else (), np.int64)


@rule(BINDING)
def binding_uv_set_exists(prim: Usd.Prim) -> Iterator[Fault]:
    """The UV set that a binding names is a primvar of the mesh."""
    mesh = prim.GetParent() if prim.GetTypeName() == "GeomSubset" else prim
    wanted = value(prim, "fabric:binding:uvSet")
    if mesh and mesh.IsA(UsdGeom.Mesh) and wanted and not unbinds(prim):
        primvars = UsdGeom.PrimvarsAPI(mesh)
        if not primvars.FindPrimvarWithInheritance(wanted).HasValue():
            have = [p.GetPrimvarName() for p in primvars.GetPrimvarsWithValues()]
            yield (
                "fabric:binding:uvSet",
                f"is '{wanted}'; it must be a primvar of {mesh.GetPath()}, "
                f"which has {', '.join(have) or 'none'}",
            )


@rule(BINDING)
def threads_per_unit_both(prim: Usd.Prim) -> Iterator[Fault]:
    """Threads per UV unit are given for both axes or for neither."""
    name = "fabric:binding:threadsPerUnit"
    pair = value(prim, name)
    u, v = (float(x) for x in pair) if pair is not None else (0.0, 0.0)
    if (u == 0) != (v == 0):
        yield name, f"is ({u:g}, {v:g}); both must be 0, or both above 0"


@rule(severity="warning")
def binding_api_applied(prim: Usd.Prim) -> Iterator[Fault]:
    """A prim with a fabric:binding relationship has WovenBindingAPI applied."""
    if not prim.HasRelationship("fabric:binding"):
        return
    relationship = prim.GetRelationship("fabric:binding")
    # A stronger layer removes a binding by an empty list of targets.
    name = "fabric:binding"
    bound = targets(prim, name) or not relationship.HasAuthoredTargets()
    if bound and not applies_binding(prim):
        yield "fabric:binding", "is authored, but WovenBindingAPI is not in the prim's apiSchemas"
