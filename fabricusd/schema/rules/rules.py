"""The rules of a well-formed fabric: one small function each, over composed values.

To add a rule: write a function here, decorate it, add a bad sample named after its fault to
`tests/schema/bad/`, run `make schema`. `fabricusd check`, `schema.read` and USD's own validation
framework (`fabricusd.schema.validators`) run the same table. A rule sees one prim and yields
`(property name, problem)`; a problem reads on from the place: "is 0.8; it must be at least 1".
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdShade

from fabricusd.errors import FabricError
from fabricusd.fabric import describe_limits, within_limits
from fabricusd.schema import attributes, weave_rows
from fabricusd.schema.access import (
    allowed_tokens,
    applies_binding,
    definitions,
    lost_targets,
    next_targets,
    over_above,
    targets,
    unbinds,
    value,
)
from fabricusd.schema.attributes import Attribute
from fabricusd.schema.rules.table import (
    BINDING,
    FABRIC,
    RULES,
    THREAD,
    Fault,
    Rule,
    applies,
    kinds,
    rule,
    run,
)

__all__ = ["RULES", "Rule", "applies", "kinds", "run", "thread_prims"]

PRESENT = Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract
"""Prims whose opinions count, defined or not."""

# ---- any of the three ---------------------------------------------------------------------------


@rule(FABRIC, THREAD, BINDING)
def property_type_matches(prim: Usd.Prim) -> Iterator[Fault]:
    """Every property has the type that the schema gives it, in every layer."""
    for definition in definitions(prim):
        for name, wanted in definition.items():
            wants_attribute = isinstance(wanted, Sdf.AttributeSpec)
            for spec in prim.GetProperty(name).GetPropertyStack():
                where = f"in {spec.layer.GetDisplayName()}"
                if isinstance(spec, Sdf.AttributeSpec) != wants_attribute:
                    wrong, right = "a relationship", "an attribute"
                    if not wants_attribute:
                        wrong, right = right, wrong
                    yield name, f"is {wrong}, {where}; it must be {right}"
                elif wants_attribute and spec.typeName != wanted.typeName:
                    yield name, f"is of type {spec.typeName}, {where}; it must be {wanted.typeName}"


@rule(FABRIC, THREAD, BINDING)
def value_at_rest(prim: Usd.Prim) -> Iterator[Fault]:
    """Every attribute has a value of its own at the default time, which is what is read."""
    for definition in definitions(prim):
        for name, wanted in definition.items():
            attribute = prim.GetAttribute(name)
            if not attribute or not isinstance(wanted, Sdf.AttributeSpec):
                continue
            at_rest = attribute.GetResolveInfo(Usd.TimeCode.Default())
            if attribute.HasAuthoredConnections():
                yield name, "is connected to another attribute; it must have a value instead"
            elif attribute.GetResolveInfo().HasAuthoredValue() and not at_rest.HasAuthoredValue():
                yield name, "has values in time but none at rest; it must have a default value"
            elif at_rest.ValueIsBlocked():
                yield name, "is blocked with None; it must have a value"


@rule(FABRIC, THREAD, BINDING, severity="warning")
def property_known(prim: Usd.Prim) -> Iterator[Fault]:
    """Every property in the fabric: and thread: namespaces is in the schema."""
    known = {name for definition in definitions(prim) for name in definition}
    for name in prim.GetAuthoredPropertyNames():
        if name.startswith(("fabric:", "thread:")) and name not in known:
            yield name, f"is not in the schema of {prim.GetTypeName()}; it is not read"


@rule(FABRIC, BINDING)
def targets_kept(prim: Usd.Prim) -> Iterator[Fault]:
    """Every target of a relationship lies inside what a reference brings along."""
    for definition in definitions(prim):
        for name, wanted in definition.items():
            if isinstance(wanted, Sdf.RelationshipSpec):
                for path, layer in lost_targets(prim, name):
                    yield (
                        name,
                        f"loses its target {path} of {layer}, which is outside of what is "
                        "referenced; it must be below the referenced prim, or be named anew here",
                    )


@rule(FABRIC, THREAD, BINDING, severity="warning", undefined=True)
def below_defs_alone(prim: Usd.Prim) -> Iterator[Fault]:
    """A fabric, a thread of a library and what wears a fabric lie below no `over`."""
    above = prim.GetParent()
    while above and above.GetTypeName() != "WovenFabric":
        above = above.GetParent()
    over = over_above(prim)
    # The threads and the back of a fabric are told with it.
    if over and not above and prim.HasDefiningSpecifier():
        yield "", f"is not defined, as {over.GetPath()} is an over; it must lie below defs alone"


def _numbers(prim: Usd.Prim) -> tuple[Attribute, ...]:
    if prim.GetTypeName() == "WovenThread":
        return attributes.THREAD
    if prim.GetTypeName() == "WovenFabric":
        sets = (attributes.thread_set("warp"), attributes.thread_set("weft"))
        return (*attributes.FABRIC, *sets[0], *sets[1])
    return attributes.BINDING


@rule(FABRIC, THREAD, BINDING)
def number_in_range(prim: Usd.Prim) -> Iterator[Fault]:
    """Every number is finite and inside its range."""
    for entry in _numbers(prim):
        held = value(prim, entry.name)
        if entry.sentinel is not None and held == entry.sentinel:
            continue
        for number in tuple(held) if hasattr(held, "__len__") else (held,):
            # Compared in SI, where the bounds are; told in the file's unit.
            if not within_limits(number * entry.scale, entry.limits):
                accepted = describe_limits(entry.limits, 1.0 / entry.scale, entry.unit)
                if entry.sentinel is not None:
                    accepted += f", or {entry.sentinel:g} to derive it"
                yield entry.name, f"is {number:g}; it must be {accepted or 'finite'}"
                break


@rule(FABRIC, THREAD)
def model_allowed(prim: Usd.Prim) -> Iterator[Fault]:
    """The scattering model is an allowed token."""
    name = "fabric:model" if prim.GetTypeName() == "WovenFabric" else "thread:model"
    # USD stores any token; the allowed ones are advice to user interfaces.
    allowed, token = allowed_tokens(prim, name), value(prim, name)
    if token not in allowed:
        yield name, f"is '{token}'; it must be one of {', '.join(allowed)}"


# ---- Fabric -------------------------------------------------------------------------------------


def thread_prims(prim: Usd.Prim) -> list[Usd.Prim]:
    """The fabric's thread prims in index order; an invalid prim where a target is missing."""
    relationship = prim.GetRelationship("fabric:threads")
    if relationship and relationship.HasAuthoredTargets():
        return [prim.GetStage().GetPrimAtPath(path) for path in targets(prim, "fabric:threads")]
    # An instance shows its children to those who ask for them alone; below an over none is defined.
    children = prim.GetFilteredChildren(Usd.TraverseInstanceProxies(PRESENT))
    return [c for c in children if c.HasDefiningSpecifier() and c.GetTypeName() == "WovenThread"]


def _forwarding_cycle(relationship: Usd.Relationship) -> list[str]:
    """The chain of relationships that leads back to itself, [] where there is none."""
    stage = relationship.GetStage()

    def follow(path: Sdf.Path, chain: list[Sdf.Path]) -> list[Sdf.Path]:
        if path in chain:
            return [*chain, path]
        forwarded = stage.GetRelationshipAtPath(path) if path.IsPropertyPath() else None
        if not forwarded:
            return []
        for target in next_targets(forwarded):
            found = follow(target, [*chain, path])
            if found:
                return found
        return []

    return [str(path) for path in follow(relationship.GetPath(), [])]


@rule(FABRIC)
def relationship_acyclic(prim: Usd.Prim) -> Iterator[Fault]:
    """No relationship of a fabric leads back to itself, nor a fabric to itself as its back."""
    for name in ("fabric:threads", "fabric:back"):
        relationship = prim.GetRelationship(name)
        if not relationship:
            continue
        cycle = _forwarding_cycle(relationship)
        if cycle:
            yield name, f"leads in a circle, {' -> '.join(cycle)}; it must end at a prim"
        elif prim.GetPath() in targets(prim, name):
            yield name, f"targets {prim.GetPath()}, its own prim; it must target another"


@rule(FABRIC)
def threads_exist(prim: Usd.Prim) -> Iterator[Fault]:
    """A fabric has at least one thread, and every target of its thread list is a WovenThread."""
    if not thread_prims(prim) and not lost_targets(prim, "fabric:threads"):
        yield "fabric:threads", "names no thread; it must name at least one WovenThread prim"
    for path in targets(prim, "fabric:threads"):
        target = prim.GetStage().GetPrimAtPath(path)
        if not target:
            yield "fabric:threads", f"targets {path}, which is no prim; it must be one"
        elif target.GetTypeName() != "WovenThread" and target != prim:
            kind = target.GetTypeName() or "an untyped prim"
            yield "fabric:threads", f"targets {path}, {kind}; it must be a WovenThread"


@rule(FABRIC)
def thread_indices_in_range(prim: Usd.Prim) -> Iterator[Fault]:
    """Every index in the warp and weft sequences counts a thread."""
    count = len(thread_prims(prim))
    for which in ("warp", "weft"):
        name = f"fabric:{which}:threads"
        sequence = np.asarray(value(prim, name) or (), dtype=np.int64)
        if sequence.size == 0:
            yield name, "is empty; it must name at least one thread"
            continue
        wrong = np.flatnonzero((sequence < 0) | (sequence >= count))
        if wrong.size and count:
            yield (
                name,
                f"[{wrong[0]}] is {sequence[wrong[0]]}; it must be from 0 to {count - 1}, "
                f"the fabric has {count} thread{'s' if count > 1 else ''}",
            )


@rule(FABRIC)
def coverage_at_most_one(prim: Usd.Prim) -> Iterator[Fault]:
    """Authored coverages of warp and weft add up to at most 1."""
    values = [value(prim, f"fabric:{w}:coverage") for w in ("warp", "weft")]
    total = sum(v for v in values if v is not None and math.isfinite(v) and v > 0)
    if total > 1.0 + 1e-9:
        yield "fabric:weft:coverage", f"and the warp's add up to {total:g}; it must be at most 1"


@rule(FABRIC)
def weave_is_a_grid(prim: Usd.Prim) -> Iterator[Fault]:
    """The weave has at least one row, rows of one length, and no character but 0 and 1."""
    problem = weave_rows.fault(value(prim, "fabric:weave:rows") or ())
    if problem:
        yield "fabric:weave:rows", problem


@rule(FABRIC)
def back_is_a_fabric(prim: Usd.Prim) -> Iterator[Fault]:
    """The back, where there is one, is one WovenFabric prim."""
    found = targets(prim, "fabric:back")
    if len(found) > 1:
        yield "fabric:back", f"has {len(found)} targets; it must have at most 1"
    for path in found[:1]:
        target = prim.GetStage().GetPrimAtPath(path)
        if not target:
            yield "fabric:back", f"targets {path}, which is no prim; it must be a WovenFabric"
        elif target.GetTypeName() != "WovenFabric":
            kind = target.GetTypeName() or "an untyped prim"
            yield "fabric:back", f"targets {path}, {kind}; it must be a WovenFabric"


@rule(FABRIC, severity="warning")
def threads_used(prim: Usd.Prim) -> Iterator[Fault]:
    """Every thread of a fabric is in its warp or its weft."""
    used: set[int] = set()
    for which in ("warp", "weft"):
        used.update(value(prim, f"fabric:{which}:threads") or ())
    for index, thread in enumerate(thread_prims(prim)):
        if thread and index not in used:
            yield "fabric:threads", f"[{index}], {thread.GetName()}, is in neither warp nor weft"


@rule(FABRIC, severity="warning")
def albedo_is_safe(prim: Usd.Prim) -> Iterator[Fault]:
    """In no view does the fabric send back more light than it gets."""
    from fabricusd.appearance.albedo import QUICK, WORST_VIEWS, albedo_by_view, safe_albedo
    from fabricusd.appearance.scattering.models import model_of
    from fabricusd.schema.read import read_side

    try:
        fabric = read_side(prim)
    except FabricError:
        return  # another rule tells why
    worst = float(albedo_by_view(fabric, np.radians(WORST_VIEWS), QUICK).max())
    if worst > 1.0:
        safe = safe_albedo(fabric, QUICK)
        yield (
            "fabric:threads",
            f"send back {worst:.3g} of the light in the worst view; thread:albedo must be lower, "
            f"white is safe up to {safe:.2g}, or fabric:model conserving",
        )
    for name, thread in fabric.threads.items():
        most = model_of(fabric, thread).most_albedo
        if max(thread.albedo) > most:
            yield (
                "fabric:threads",
                f"{name} has an albedo above {most:g}, which {fabric.model_of(thread)} takes as "
                f"{most:g}",
            )


# ---- WovenThread -------------------------------------------------------------------------------


@rule(THREAD)
def curve_points_match(prim: Usd.Prim) -> Iterator[Fault]:
    """A curve has as many positions as angles, and at least two."""
    positions = value(prim, "thread:curve:positions") or ()
    angles = value(prim, "thread:curve:angles") or ()
    if len(positions) != len(angles):
        yield (
            "thread:curve:angles",
            f"has {len(angles)} numbers and thread:curve:positions {len(positions)}; "
            "they must be as many",
        )
    elif len(positions) < 2:
        yield "thread:curve:positions", f"has {len(positions)} numbers; it must have at least 2"


@rule(THREAD)
def curve_positions_rise(prim: Usd.Prim) -> Iterator[Fault]:
    """A curve's positions are finite, never decrease, and span a length above 0."""
    name = "thread:curve:positions"
    positions = list(value(prim, name) or [])
    for k, x in enumerate(positions):
        if not math.isfinite(x):
            yield name, f"[{k}] is {x:g}; it must be finite"
            return
        if k and x < positions[k - 1]:
            yield name, f"[{k}] is {x:g}; it must be at least {positions[k - 1]:g}, the one before"
            return
    if len(positions) > 1 and positions[0] == positions[-1]:
        yield name, f"starts and ends at {positions[0]:g}; it must span a length above 0"


@rule(THREAD)
def curve_angles_in_range(prim: Usd.Prim) -> Iterator[Fault]:
    """A curve's angles are from -90 to 90 degrees."""
    name = "thread:curve:angles"
    for k, x in enumerate(value(prim, name) or ()):
        if not (math.isfinite(x) and -90.0 <= x <= 90.0):
            yield name, f"[{k}] is {x:g}; it must be from -90 to 90 degrees"
            return


# ---- WovenBindingAPI ---------------------------------------------------------------------------


@rule(BINDING)
def binding_names_a_fabric(prim: Usd.Prim) -> Iterator[Fault]:
    """A binding targets exactly one prim, a WovenFabric, or none to take the fabric off."""
    name = "fabric:binding"
    found = targets(prim, name)
    if unbinds(prim) or (not found and lost_targets(prim, name)):
        return  # of a target that is lost another rule tells why
    if len(found) != 1:
        yield name, f"has {len(found)} targets; it must have 1, a WovenFabric prim"
        return
    target = prim.GetStage().GetPrimAtPath(found[0])
    if not target:
        yield name, f"targets {found[0]}, which is no prim; it must be a WovenFabric"
    elif target.GetTypeName() != "WovenFabric":
        kind = target.GetTypeName() or "an untyped prim"
        yield name, f"targets {found[0]}, {kind}; it must be a WovenFabric"


@rule(BINDING, fatal=False)
def bound_fabric_defined(prim: Usd.Prim) -> Iterator[Fault]:
    """A fabric that is bound lies below no `over`, where programs that list fabrics miss it."""
    for path in targets(prim, "fabric:binding")[:1]:
        target = prim.GetStage().GetPrimAtPath(path)
        over = over_above(target) if target and prim.IsDefined() else None
        if over:
            yield (
                "fabric:binding",
                f"targets {path}, which is not defined, as {over.GetPath()} is an over; "
                "it must lie below defs alone",
            )


_WORN = "it must be on a Mesh, a GeomSubset of a mesh's faces, a Material or a prim above meshes"


def place_problem(prim: Usd.Prim) -> str:
    """Why a binding on `prim` has no effect, an empty string where it has one."""
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
    # Meshes hand nothing down, and what is below a light or a camera is not seen.
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
    """A face is in one of the subsets that wear fabrics of their own, not in two."""
    mesh = prim.GetParent()
    if not prim.IsA(UsdGeom.Subset) or not mesh.IsA(UsdGeom.Mesh) or unbinds(prim):
        return
    mine = _faces(prim)
    for other in UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(mesh)):
        if other.GetPrim() == prim:
            return  # a pair is told once, by the later of the two
        if applies_binding(other.GetPrim()) and not unbinds(other.GetPrim()):
            both = np.intersect1d(mine, _faces(other.GetPrim()))
            if both.size:
                yield (
                    "indices",
                    f"has {both.size} faces of {other.GetPrim().GetName()}, the first is "
                    f"{both[0]}; a face must be in one subset that wears a fabric",
                )


def _faces(prim: Usd.Prim) -> NDArray[np.int64]:
    """(n,) numbers of a subset's faces."""
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
    # A stronger layer unbinds a fabric by leaving no target.
    name = "fabric:binding"
    bound = targets(prim, name) or not relationship.HasAuthoredTargets()
    if bound and not applies_binding(prim):
        yield "fabric:binding", "is authored, but WovenBindingAPI is not in the prim's apiSchemas"
