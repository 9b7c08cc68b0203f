"""Rules of a WovenBindingAPI."""

from __future__ import annotations

from collections.abc import Iterator

from pxr import Usd, UsdGeom

from fabricusd.schema.access import (
    applies_binding,
    kind_of,
    lost_targets,
    over_above,
    targets,
    type_of,
    value,
)
from fabricusd.schema.rules.table import BINDING, Fault, rule


@rule(BINDING)
def binding_names_a_fabric(prim: Usd.Prim) -> Iterator[Fault]:
    """A binding targets exactly one prim, a WovenFabric."""
    name = "fabric:binding"
    found = targets(prim, name)
    if not found and lost_targets(prim, name):
        return  # another rule tells why
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


@rule(BINDING)
def binding_on_mesh_or_subset(prim: Usd.Prim) -> Iterator[Fault]:
    """Only a mesh, or a subset of its faces, has a binding."""
    if prim.GetTypeName() not in ("Mesh", "GeomSubset"):
        yield "fabric:binding", f"is on {kind_of(prim)}; it must be on a Mesh or a GeomSubset"


@rule(BINDING)
def binding_uv_set_exists(prim: Usd.Prim) -> Iterator[Fault]:
    """The UV set that a binding names is a primvar of the mesh."""
    mesh = prim.GetParent() if prim.GetTypeName() == "GeomSubset" else prim
    wanted = value(prim, "fabric:binding:uvSet")
    if mesh and mesh.IsA(UsdGeom.Mesh) and wanted:
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
