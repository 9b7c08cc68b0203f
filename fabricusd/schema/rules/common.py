"""Rules that hold for fabrics, threads and bindings alike."""

from __future__ import annotations

import math
from collections.abc import Iterator

from pxr import Sdf, Usd

from fabricusd.errors import did_you_mean
from fabricusd.fabric import describe_limits, within_limits
from fabricusd.schema import attributes
from fabricusd.schema.access import (
    EARLIER_NAMES,
    allowed_tokens,
    definitions,
    earlier_names,
    is_authored,
    lost_targets,
    over_above,
    type_of,
    value,
    varies,
)
from fabricusd.schema.attributes import Attribute
from fabricusd.schema.colors import LINEAR, NAMED, color, is_known, space_name
from fabricusd.schema.rules.table import BINDING, FABRIC, THREAD, Fault, rule


# Registered for all prims: USD would not run it on a type that it does not know.
@rule(severity="warning")
def name_is_current(prim: Usd.Prim) -> Iterator[Fault]:
    """No prim uses a name that the schema has replaced, for its type or its binding."""
    for name in earlier_names(prim):
        what = "applies" if name.endswith("API") else "is of the type"
        yield "", f"{what} {name}, an earlier name of the schema; write {EARLIER_NAMES[name]}"


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
    """Every authored attribute has a value at the default time, the only one that is read."""
    for definition in definitions(prim):
        for name, wanted in definition.items():
            attribute = prim.GetAttribute(name)
            if not attribute or not isinstance(wanted, Sdf.AttributeSpec):
                continue
            at_rest = is_authored(attribute, at_rest=True)
            if attribute.HasAuthoredConnections():
                yield name, "is connected to another attribute; it must have a value instead"
            elif is_authored(attribute, at_rest=False) and not at_rest:
                yield name, "has values in time but none at rest; it must have a default value"
            elif attribute.GetResolveInfo(Usd.TimeCode.Default()).ValueIsBlocked():
                yield name, "is blocked with None; it must have a value"


@rule(FABRIC, THREAD, BINDING, severity="warning", noted=True)
def value_is_constant(prim: Usd.Prim) -> Iterator[Fault]:
    """No attribute has values in time: only the value at the default time is read."""
    for definition in definitions(prim):
        for name, wanted in definition.items():
            attribute = prim.GetAttribute(name)
            if not attribute or not isinstance(wanted, Sdf.AttributeSpec):
                continue
            # ValueAtRest covers an attribute without a value at rest.
            if varies(attribute) and is_authored(attribute, at_rest=True):
                yield name, "has values in time; only its value at rest is read, for every frame"


@rule(FABRIC, THREAD, BINDING, severity="warning")
def property_known(prim: Usd.Prim) -> Iterator[Fault]:
    """Every property in the fabric: and thread: namespaces is in the schema."""
    known = {name for definition in definitions(prim) for name in definition}
    for name in prim.GetAuthoredPropertyNames():
        if name.startswith(("fabric:", "thread:")) and name not in known:
            hint = did_you_mean(name, known)
            yield name, f"is not in the schema of {type_of(prim)}{hint}; it is not read"


@rule(FABRIC, BINDING)
def targets_kept(prim: Usd.Prim) -> Iterator[Fault]:
    """Every target of a relationship lies inside of what a reference brings along."""
    for definition in definitions(prim):
        for name, wanted in definition.items():
            if isinstance(wanted, Sdf.RelationshipSpec):
                for path, layer in lost_targets(prim, name):
                    yield (
                        name,
                        f"loses its target {path} of {layer}, which lies outside of the "
                        "referenced prim; it must lie below it, or be authored again here",
                    )


@rule(FABRIC, THREAD, BINDING, severity="warning", undefined=True)
def below_defs_alone(prim: Usd.Prim) -> Iterator[Fault]:
    """No `over` lies above a fabric, a thread of a library, or a prim that wears a fabric."""
    above = prim.GetParent()
    while above and type_of(above) != "WovenFabric":
        above = above.GetParent()
    over = over_above(prim)
    # The finding on a fabric covers its threads and its back.
    if over and not above and prim.HasDefiningSpecifier():
        yield (
            "",
            f"lies below {over.GetPath()}, an over, so USD holds it for undefined; every prim "
            "above it must be a def",
        )


def _numbers(prim: Usd.Prim) -> tuple[Attribute, ...]:
    if type_of(prim) == "WovenThread":
        return attributes.THREAD
    if type_of(prim) == "WovenFabric":
        sets = (attributes.thread_set("warp"), attributes.thread_set("weft"))
        return (*attributes.FABRIC, *attributes.SIDES, *sets[0], *sets[1])
    return attributes.BINDING


@rule(FABRIC, THREAD, BINDING)
def number_in_range(prim: Usd.Prim) -> Iterator[Fault]:
    """Every number is finite and inside its range."""
    for entry in _numbers(prim):
        held = value(prim, entry.name)
        if entry.sentinel is not None and held == entry.sentinel:
            continue
        space = ""
        if entry.is_color and all(math.isfinite(x) for x in held):
            authored, held = held, color(prim, entry.name)
            space = " in linear Rec. 709" if tuple(held) != tuple(authored) else ""
        for number in tuple(held) if hasattr(held, "__len__") else (held,):
            # The bounds are in SI; the message uses the unit of the file.
            if not within_limits(number * entry.scale, entry.limits):
                accepted = describe_limits(entry.limits, 1.0 / entry.scale, entry.unit)
                if entry.sentinel is not None:
                    accepted += f", or {entry.sentinel:g} to derive it"
                yield entry.name, f"is {number:g}{space}; it must be {accepted or 'finite'}"
                break


@rule(THREAD)
def color_space_known(prim: Usd.Prim) -> Iterator[Fault]:
    """A colour's color space, or that of a prim above, is one of USD's or is defined there."""
    for entry in filter(lambda each: each.is_color, attributes.THREAD):
        attribute = prim.GetAttribute(entry.name)
        if attribute and is_authored(attribute, at_rest=True) and not is_known(attribute):
            yield (
                entry.name,
                f"has the color space '{space_name(attribute)}'; it must be one of {LINEAR}, "
                f"{', '.join(NAMED)}, raw, or one that ColorSpaceDefinitionAPI defines",
            )


@rule(FABRIC, THREAD)
def model_allowed(prim: Usd.Prim) -> Iterator[Fault]:
    """The scattering model is an allowed token."""
    name = "fabric:model" if type_of(prim) == "WovenFabric" else "thread:model"
    # USD stores any token; the allowed ones are advice to user interfaces.
    allowed, token = allowed_tokens(prim, name), value(prim, name)
    if token not in allowed:
        yield name, f"is '{token}'; it must be one of {', '.join(allowed)}"
