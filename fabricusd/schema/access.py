"""What a prim says in the schema's terms, whether USD knows the schema or not.

USD builds its table of prim definitions once, when the first one is asked for. In a program that
used a stage before it imported fabricusd, the schema comes too late for that table: USD then leaves
WovenBindingAPI out of a prim's applied schemas, and attributes have no fallbacks. Everything here
reads the authored opinions and the schema's own layer instead, so both orders give one answer.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

from pxr import Pcp, Sdf, Usd

from fabricusd.schema.plugin import FOLDER

BINDING_API = "WovenBindingAPI"
TYPES = ("WovenFabric", "WovenThread")


@cache
def _schema() -> Sdf.Layer:
    return Sdf.Layer.FindOrOpen(str(FOLDER / "fabricusd" / "generatedSchema.usda"))


@cache
def definition(name: str) -> dict[str, Sdf.PropertySpec]:
    """The properties of "WovenFabric", "WovenThread" or "WovenBindingAPI" by name."""
    return {spec.name: spec for spec in _schema().GetPrimAtPath(f"/{name}").properties}


def definitions(prim: Usd.Prim) -> Iterator[dict[str, Sdf.PropertySpec]]:
    """The definitions that a prim's type and its applied or authored binding ask for."""
    type_name = str(prim.GetTypeName())
    if type_name in TYPES:
        yield definition(type_name)
    if applies_binding(prim) or prim.HasRelationship("fabric:binding"):
        yield definition(BINDING_API)


def applies_binding(prim: Usd.Prim) -> bool:
    """Whether WovenBindingAPI is applied to a prim."""
    authored = prim.GetMetadata("apiSchemas")
    if authored is not None and BINDING_API in authored.GetAppliedItems():
        return True
    # Another schema may build it in, which USD knows only where it knows ours.
    return BINDING_API in prim.GetAppliedSchemas()


@cache
def _fallbacks() -> dict[str, Any]:
    names = (*TYPES, BINDING_API)
    specs = [spec for name in names for spec in definition(name).values()]
    return {spec.name: spec.default for spec in specs if isinstance(spec, Sdf.AttributeSpec)}


def value(prim: Usd.Prim, name: str) -> Any:
    """An attribute's value at the default time, or the schema's fallback where it has none."""
    attribute = prim.GetAttribute(name)
    found = attribute.Get() if attribute else None
    return _fallbacks()[name] if found is None else found


def allowed_tokens(prim: Usd.Prim, name: str) -> tuple[str, ...]:
    """What the schema allows an attribute of a prim to be."""
    return tuple(definition(str(prim.GetTypeName()))[name].GetInfo("allowedTokens") or ())


def targets(prim: Usd.Prim, name: str) -> list[Sdf.Path]:
    """Where a relationship leads in the end; [] where it is not authored or leads nowhere."""
    relationship = prim.GetRelationship(name)
    return list(relationship.GetForwardedTargets()) if _has_targets(relationship) else []


def next_targets(relationship: Usd.Relationship) -> list[Sdf.Path]:
    """Where a relationship leads first: prims, or relationships that lead on."""
    return list(relationship.GetTargets()) if _has_targets(relationship) else []


def _has_targets(relationship: Usd.Relationship) -> bool:
    """Whether to ask USD for targets: it warns of each that it drops, as `lost_targets` does."""
    if not relationship:
        return False
    kept, lost = _by_fate(relationship.GetPrim(), relationship.GetName())
    return bool(kept) or not lost


def lost_targets(prim: Usd.Prim, name: str) -> list[tuple[Sdf.Path, str]]:
    """Targets that composition drops, with the layers that author them.

    A reference brings what lies below the prim that it names. A target outside of that has no path
    on the stage.
    """
    return _by_fate(prim, name)[1]


def _by_fate(prim: Usd.Prim, name: str) -> tuple[list[Sdf.Path], list[tuple[Sdf.Path, str]]]:
    """Targets authored anywhere for a relationship: those that composition keeps, and others."""
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
                # Weaker layers do not count.
                return kept, lost
    return kept, lost


def _nodes(node: Pcp.NodeRef) -> Iterator[Pcp.NodeRef]:
    """A prim index's nodes, from strong to weak."""
    yield node
    for child in node.children:
        yield from _nodes(child)


def over_above(prim: Usd.Prim) -> Usd.Prim | None:
    """The uppermost `over` that a prim lies below, which keeps USD from taking it for defined."""
    for path in prim.GetPath().GetPrefixes():
        above = prim.GetStage().GetPrimAtPath(path)
        if above and not above.HasDefiningSpecifier():
            return above
    return None


def unbinds(prim: Usd.Prim) -> bool:
    """Whether a prim takes its fabric off, by a `fabric:binding` that is authored without a target.

    A target that composition drops is one: whoever authored it named a fabric.
    """
    name = "fabric:binding"
    relationship = prim.GetRelationship(name)
    if not relationship or not relationship.HasAuthoredTargets():
        return False
    return not targets(prim, name) and not lost_targets(prim, name)
