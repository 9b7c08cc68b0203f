"""Read prims in the schema's terms, whether or not USD knows the schema.

USD builds its table of prim definitions once, when the first definition is asked for. A program
that uses a stage before it imports fabricusd registers the schema too late for that table: USD then
leaves WovenBindingAPI out of a prim's applied schemas, and attributes have no fallbacks. The
functions here read the authored opinions and the schema's own layer instead, so that both orders
give one answer.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

from pxr import Pcp, Sdf, Usd

from fabricusd.schema.plugin import FOLDER

BINDING_API = "WovenBindingAPI"
TYPES = ("WovenFabric", "WovenThread")

BACK = "fabric:back"

EARLIER_NAMES = {
    "Fabric": "WovenFabric",
    "FabricThread": "WovenThread",
    "FabricBindingAPI": BINDING_API,
}
"""The names that the types had before they had a prefix. Where another plugin defines a type of one
of these names, the name means that plugin's type."""


PRESENT = Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract
"""Prims whose opinions count, defined or not."""


@cache
def _schema() -> Sdf.Layer:
    return Sdf.Layer.FindOrOpen(str(FOLDER / "fabricusd" / "generatedSchema.usda"))


@cache
def definition(name: str) -> dict[str, Sdf.PropertySpec]:
    """The properties of "WovenFabric", "WovenThread" or "WovenBindingAPI" by name."""
    return {spec.name: spec for spec in _schema().GetPrimAtPath(f"/{name}").properties}


def type_of(prim: Usd.Prim) -> str:
    """Return the name of a prim's type, with an earlier name replaced; "" for an untyped prim.

    An earlier name is replaced where USD knows no type of that name, and where the prim's
    properties, its children or its parent show that the prim belongs to a fabric.
    """
    name = str(prim.GetTypeName())
    if name not in EARLIER_NAMES or _is_known(name):
        return name
    namespace = "fabric:" if name == "Fabric" else "thread:"
    if any(each.startswith(namespace) for each in prim.GetAuthoredPropertyNames()):
        return EARLIER_NAMES[name]
    # A fabric or a thread that is left at its fallbacks has no property.
    if name == "Fabric":
        children = prim.GetFilteredChildren(Usd.TraverseInstanceProxies(PRESENT))
        ours = any(child.GetTypeName() in ("FabricThread", "WovenThread") for child in children)
    else:
        ours = prim.GetParent().GetTypeName() in ("Fabric", "WovenFabric")
    return EARLIER_NAMES[name] if ours else name


@cache
def _is_known(name: str) -> bool:
    """Whether USD, or a plugin that it has, defines a schema of that name."""
    return not Usd.SchemaRegistry.GetTypeFromSchemaTypeName(name).isUnknown


def earlier_names(prim: Usd.Prim) -> Iterator[str]:
    """Yield the earlier names that a prim has as its type and among its applied schemas."""
    name = str(prim.GetTypeName())
    if name in EARLIER_NAMES and type_of(prim) != name:
        yield name
    if _applies_earlier_binding(prim):
        yield "FabricBindingAPI"


def kind_of(prim: Usd.Prim) -> str:
    """A prim's type for messages."""
    return str(prim.GetTypeName()) or "an untyped prim"


def definitions(prim: Usd.Prim) -> Iterator[dict[str, Sdf.PropertySpec]]:
    """Yield the definitions of a prim's type and of its binding, applied or only authored."""
    type_name = type_of(prim)
    if type_name in TYPES:
        yield definition(type_name)
    if applies_binding(prim) or prim.HasRelationship("fabric:binding"):
        yield definition(BINDING_API)


def applies_binding(prim: Usd.Prim) -> bool:
    """Whether WovenBindingAPI is applied to a prim, under that name or its earlier one."""
    if _authors_api(prim, BINDING_API):
        return True
    # Another schema may build it in, which USD knows only where it knows ours.
    return BINDING_API in prim.GetAppliedSchemas() or _applies_earlier_binding(prim)


def remove_binding(prim: Usd.Prim) -> None:
    """Take WovenBindingAPI off a prim, under either name."""
    if _applies_earlier_binding(prim):
        prim.RemoveAppliedSchema("FabricBindingAPI")
    prim.RemoveAppliedSchema(BINDING_API)


def _applies_earlier_binding(prim: Usd.Prim) -> bool:
    return (
        _authors_api(prim, "FabricBindingAPI")
        and not _is_known("FabricBindingAPI")
        and bool(prim.HasRelationship("fabric:binding"))
    )


def _authors_api(prim: Usd.Prim, name: str) -> bool:
    authored = prim.GetMetadata("apiSchemas")
    return authored is not None and name in authored.GetAppliedItems()


@cache
def _fallbacks() -> dict[str, Any]:
    names = (*TYPES, BINDING_API)
    specs = [spec for name in names for spec in definition(name).values()]
    return {spec.name: spec.default for spec in specs if isinstance(spec, Sdf.AttributeSpec)}


def value(prim: Usd.Prim, name: str) -> Any:
    """Return an attribute's value at the default time, or the schema's fallback if it has none."""
    attribute = prim.GetAttribute(name)
    found = attribute.Get() if attribute else None
    return _fallbacks()[name] if found is None else found


def is_authored(attribute: Usd.Attribute, *, at_rest: bool) -> bool:
    """Whether a layer gives an attribute a value: at the default time, or at any."""
    # `ResolveInfo.HasAuthoredValue` is younger than the oldest USD that this runs with.
    info = (
        attribute.GetResolveInfo(Usd.TimeCode.Default()) if at_rest else attribute.GetResolveInfo()
    )
    return info.GetSource() not in (Usd.ResolveInfoSourceNone, Usd.ResolveInfoSourceFallback)


def varies(attribute: Usd.Attribute) -> bool:
    """Whether an attribute has values in time: samples, clips, or a spline, where USD has them."""
    has_spline = getattr(attribute, "HasSpline", lambda: False)
    return bool(attribute.GetNumTimeSamples() or has_spline())


def allowed_tokens(prim: Usd.Prim, name: str) -> tuple[str, ...]:
    """Return the tokens that the schema allows for an attribute of a prim."""
    return tuple(definition(type_of(prim))[name].GetInfo("allowedTokens") or ())


def targets(prim: Usd.Prim, name: str) -> list[Sdf.Path]:
    """Return the prims that a relationship leads to, through other relationships; [] for none."""
    relationship = prim.GetRelationship(name)
    return list(relationship.GetForwardedTargets()) if _has_targets(relationship) else []


def next_targets(relationship: Usd.Relationship) -> list[Sdf.Path]:
    """Return a relationship's own targets: prims, or relationships that lead on."""
    return list(relationship.GetTargets()) if _has_targets(relationship) else []


def _has_targets(relationship: Usd.Relationship) -> bool:
    """Whether to ask USD for targets. USD warns of each target that it drops; so does a rule."""
    if not relationship:
        return False
    kept, lost = _by_fate(relationship.GetPrim(), relationship.GetName())
    return bool(kept) or not lost


def thread_prims(prim: Usd.Prim) -> list[Usd.Prim]:
    """Return a fabric's thread prims in index order, an invalid prim where a target is missing."""
    relationship = prim.GetRelationship("fabric:threads")
    if relationship and relationship.HasAuthoredTargets():
        return [prim.GetStage().GetPrimAtPath(path) for path in targets(prim, "fabric:threads")]
    # Plain GetChildren returns no children of an instance, and none below an over.
    children = prim.GetFilteredChildren(Usd.TraverseInstanceProxies(PRESENT))
    return [c for c in children if c.HasDefiningSpecifier() and type_of(c) == "WovenThread"]


def lost_targets(prim: Usd.Prim, name: str) -> list[tuple[Sdf.Path, str]]:
    """Return the targets that composition drops, with the layers that author them.

    A reference brings only what lies below the referenced prim. A target outside of it has no path
    on the stage.
    """
    return _by_fate(prim, name)[1]


def _by_fate(prim: Usd.Prim, name: str) -> tuple[list[Sdf.Path], list[tuple[Sdf.Path, str]]]:
    """Return a relationship's authored targets: those that composition keeps, and the others."""
    kept: list[Sdf.Path] = []
    lost: list[tuple[Sdf.Path, str]] = []
    source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
    index = source.GetPrimIndex()
    if not index.IsValid():
        return kept, lost
    for node in _nodes(index.rootNode):
        if not node.CanContributeSpecs():
            continue
        for layer in node.layerStack.layers:
            spec = layer.GetPropertyAtPath(node.path.AppendProperty(name))
            if not isinstance(spec, Sdf.RelationshipSpec):
                continue
            edit = spec.GetInfo("targetPaths")
            added = edit.prependedItems + edit.appendedItems + edit.addedItems
            for path in edit.explicitItems if edit.isExplicit else added:
                if node.mapToRoot.MapSourceToTarget(path.GetPrimPath()).isEmpty:
                    lost.append((path, layer.GetDisplayName()))
                else:
                    kept.append(path)
            if edit.isExplicit:
                # An explicit list hides those of weaker layers.
                return kept, lost
    return kept, lost


def _nodes(node: Pcp.NodeRef) -> Iterator[Pcp.NodeRef]:
    """A prim index's nodes, from strong to weak."""
    yield node
    for child in node.children:
        yield from _nodes(child)


def over_above(prim: Usd.Prim) -> Usd.Prim | None:
    """Return the uppermost `over` above a prim, because of which USD holds it for undefined."""
    for path in prim.GetPath().GetPrefixes():
        above = prim.GetStage().GetPrimAtPath(path)
        if above and not above.HasDefiningSpecifier():
            return above
    return None
