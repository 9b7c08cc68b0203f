"""Setting values in a layer, as overrides or in a variant: all of them, or none."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd

from fabricusd.errors import FabricError, did_you_mean, reads
from fabricusd.fabric import DEFAULT_MODEL, Fabric, Thread, ThreadSet
from fabricusd.schema import attributes
from fabricusd.schema.access import definitions, kind_of, thread_prims, type_of
from fabricusd.schema.access import value as read
from fabricusd.schema.attributes import Attribute, from_si
from fabricusd.schema.build import build_side, build_thread
from fabricusd.schema.colors import LINEAR
from fabricusd.schema.edit.dye import ALBEDO, Value, solved_again, without_target
from fabricusd.schema.edit.values import value_of
from fabricusd.schema.edit.variant import Variant
from fabricusd.schema.edit.words import SHORT, WORDS, Changes
from fabricusd.schema.findings import faults
from fabricusd.schema.source import (
    find_fabric,
    find_prim,
    no_warnings,
    open_stage,
    preset_names,
    split_source,
    usd_errors,
    variants_of,
)
from fabricusd.schema.write import EXTENSIONS, export
from fabricusd.weaves.draft import quoted


@dataclass(frozen=True, kw_only=True)
class Change:
    """A name and what it is set to, as typed.

    of : "warp", "weft", the name of a thread, or "" for all that the name can mean
    """

    name: str
    text: str
    of: str = ""


def parse_change(text: str) -> Change:
    """`roughness=0.4`, `warp.colour=#112233`, `thread:ior=1.4` -> Change."""
    name, equals, value = text.partition("=")
    of, _, name = name.strip().rpartition(".")
    if not equals or not name or not value.strip():
        raise FabricError(
            quoted(text, 40),
            "sets nothing; write NAME=VALUE, as in roughness=0.4 or thread:ior=1.4",
        )
    return Change(name=name, text=value.strip(), of=of)


@reads("a fabric")
def set_values(
    source: str | os.PathLike[str],
    changes: Sequence[Change],
    *,
    variant: str = "",
    write: bool = True,
) -> tuple[str, ...]:
    """Set attributes of the fabric, thread or binding `FILE[:/PRIM]`; a line for each change.

    Albedos that were solved for a colour are solved again where a change makes them wrong, with a
    line for each; an albedo that is set itself forgets its colour.

    Values go into the file's own layer, over what its references and sublayers say. With `variant`,
    `NAME` or `SET=NAME`, they go into that variant of the fabric, which is made if it is new and is
    selected; values that the layer states outside of variants move into the others, since they
    would hide the variant's.

    Raises FabricError, and writes nothing, for a name or a value that is none, for a value that a
    stronger layer hides, and for a fabric that could no longer be read.
    """
    path, where = split_source(source)
    if variants_of(source):
        raise FabricError(str(source), "chooses a variant; name it with --variant instead")
    if os.fspath(source) in preset_names() and not Path(source).exists():
        raise FabricError(
            str(source),
            f"is a preset; make a layer of it first: fabricusd new --preset {source} -o FILE.usda",
        )
    if path.suffix.lower() not in EXTENSIONS:
        raise FabricError(str(path), f"cannot be changed; it must be {', '.join(EXTENSIONS)}")
    stage, file = open_stage(source)
    layer = stage.GetRootLayer()
    try:
        with usd_errors(file, "changed"), no_warnings():
            prim = find_prim(stage, file, where) if where else find_fabric(stage, file)
            if prim.IsInstanceProxy():
                raise FabricError(
                    f"{file}:{prim.GetPath()}", "lies in an instance; change what it is one of"
                )
            into = Variant(prim=_fabric_of(prim), text=variant) if variant else None
            before = _faults(prim)
            told = []
            for change in changes:
                values = list(_values(prim, change))
                author(values, into)
                prims = len({value[0].GetPath() for value in values})
                told.append(f"{change.name} = {change.text}, on {prims} prim{'s' * (prims > 1)}")
                if any(spec.name == ALBEDO for _, spec, _ in values):
                    author(list(without_target(values)), into)
            if not set(_faults(prim)) - set(before):
                solved, lines = solved_again(_fabric_of(prim))
                author(solved, into)
                told += lines
            for (at, name), problem in _faults(prim).items():
                if before.get((at, name)) != problem:
                    raise FabricError(f"{file}:{at} {name}".strip(), problem)
            if write:
                export(layer, file, format=format_of(path))
    finally:
        # The layer in memory is that of the whole process: it must be what the file is.
        layer.Reload(True)
    return tuple(told)


def format_of(path: Path) -> str:
    """The format in which a layer is kept: a .usd may be text."""
    with open(path, "rb") as stream:
        return "usda" if stream.read(5) == b"#usda" else "usdc"


def _fabric_of(prim: Usd.Prim) -> Usd.Prim:
    """The fabric above a thread; otherwise the prim itself."""
    parent = prim.GetParent()
    inside = type_of(prim) == "WovenThread" and type_of(parent) == "WovenFabric"
    return parent if inside else prim


def _values(prim: Usd.Prim, change: Change) -> Iterator[Value]:
    """What a change sets, on which prims."""
    name = SHORT.get(change.name, change.name)
    if name in WORDS:
        yield from _of_word(prim, change)
        return
    if change.of in ("warp", "weft") and named(prim, f"fabric:{change.of}:{name}"):
        # `warp.density` is the warp's, and no thread's.
        change = Change(name=f"fabric:{change.of}:{name}", text=change.text)
        name = change.name
    found = [(target, spec) for target in _targets(prim, change) for spec in named(target, name)]
    several = {spec.name for target, spec in found if target == found[0][0]}
    if len(several) > 1:
        raise FabricError(name, f"may be {' or '.join(sorted(several))}; write the whole name")
    if not found:
        of = f"{kind_of(prim)} {prim.GetPath()}"
        raise FabricError(name, f"is not an attribute of {of}{_meant(prim, name)}")
    # A short name may mean one of the fabric and one of its threads: the fabric comes first.
    full = found[0][1].name
    for target, spec in found:
        if spec.name == full:
            yield target, spec, value_of(change.text, spec, f"{target.GetPath()} {full}")


def _targets(prim: Usd.Prim, change: Change) -> list[Usd.Prim]:
    """The prims that a change may mean: a fabric and its threads, or those that it names."""
    threads = thread_prims(prim) if type_of(prim) == "WovenFabric" else []
    if not change.of:
        return [prim, *threads]
    return [threads[k] for k in _chosen(prim, change.of)]


def _chosen(prim: Usd.Prim, of: str) -> list[int]:
    """Indices of the threads of a set, or of the thread of a name."""
    if type_of(prim) != "WovenFabric":
        raise FabricError(f"{of}.", f"needs a WovenFabric; {prim.GetPath()} is {kind_of(prim)}")
    fabric = build_side(prim)
    for label, threads in (("warp", fabric.warp), ("weft", fabric.weft)):
        other = fabric.weft if label == "warp" else fabric.warp
        if of == label:
            shared = set(threads.sequence) & set(other.sequence)
            if shared:
                name = list(fabric.threads)[min(shared)]
                raise FabricError(
                    f"{of}.", f"cannot be changed alone: thread {name} is in warp and weft"
                )
            return sorted(set(threads.sequence))
    names = list(fabric.threads)
    if of not in names:
        known = ["warp", "weft", *names]
        raise FabricError(
            f"{of}.",
            f"is no set or thread{did_you_mean(of, known)}; write one of {', '.join(known)}",
        )
    return [names.index(of)]


def named(prim: Usd.Prim, name: str) -> list[Sdf.AttributeSpec]:
    """The attribute of a prim's schema that `name`, whole or its end, means."""
    specs = [
        spec
        for definition in definitions(prim)
        for spec in definition.values()
        if isinstance(spec, Sdf.AttributeSpec)
    ]
    exact = [spec for spec in specs if spec.name == name]
    return exact or [spec for spec in specs if spec.name.endswith(f":{name}")]


def _meant(prim: Usd.Prim, name: str) -> str:
    """What `name` may be a slip of, or what there is."""
    known = {}
    for target in (prim, *(thread_prims(prim) if type_of(prim) == "WovenFabric" else ())):
        for definition in definitions(target):
            known.update(dict.fromkeys(definition))
    names = [*known, *(each.rpartition(":")[2] for each in known), *WORDS, *SHORT]
    hint = did_you_mean(name, names)
    return hint or f"; it must be one of {', '.join([*WORDS, *SHORT])}, or a name of the schema"


def _of_word(prim: Usd.Prim, change: Change) -> Iterator[Value]:
    """What a word of the trade sets."""
    kind = type_of(prim)
    if kind == "WovenFabric":
        fabric, prims = build_side(prim), thread_prims(prim)
    elif kind == "WovenThread":
        above = _fabric_of(prim)
        model = DEFAULT_MODEL if above == prim else str(read(above, "fabric:model"))
        fabric, prims = Fabric(threads={prim.GetName(): build_thread(prim)}, model=model), [prim]
    else:
        raise FabricError(
            change.name,
            f"needs a WovenFabric or a WovenThread; {prim.GetPath()} is {kind_of(prim)}",
        )
    names = list(fabric.threads)
    chosen = [names[k] for k in _chosen(prim, change.of)] if change.of else names
    made: Changes = WORDS[change.name](fabric, chosen, change.text, change.name)
    if kind == "WovenThread" and (made.sets or change.name == "weight"):
        raise FabricError(change.name, f"needs a WovenFabric; {prim.GetPath()} is a thread")
    for name, fields in made.threads.items():
        for field, value in fields.items():
            table = (*attributes.THREAD, attributes.TARGET_BASIS)
            yield held_in_file(prims[names.index(name)], table, field, value, Thread)
    for which, fields in made.sets.items():
        for field, value in fields.items():
            yield held_in_file(prim, attributes.thread_set(which), field, value, ThreadSet)


def held_in_file(
    prim: Usd.Prim, table: tuple[Attribute, ...], field: str, value: Any, owner: type
) -> Value:
    """A field of a dataclass as the value of its attribute, in the file's unit."""
    entry = next(each for each in table if each.field == field and each.owner is owner)
    (spec,) = named(prim, entry.name)
    held = from_si(value, entry)
    return prim, spec, type(spec.default)(held) if isinstance(held, tuple) else held


def author(values: Sequence[Value], into: Variant | None) -> None:
    """Author values, and require that the stage then has them."""
    for prim, spec, value in values:
        place: AbstractContextManager[Any] = nullcontext()
        if into is not None:
            into.make_room(prim, spec.name)
            place = into.edit()
        with place:
            attribute = prim.CreateAttribute(
                spec.name, spec.typeName, custom=False, variability=spec.variability
            )
            attribute.Set(value)
            if str(spec.typeName).startswith("color"):
                attribute.SetColorSpace(LINEAR)
        if prim.GetAttribute(spec.name).Get() != value:
            raise FabricError(
                f"{prim.GetPath()} {spec.name}", "is stated in a place that hides the new value"
            )


def _faults(prim: Usd.Prim) -> dict[tuple[str, str], str]:
    """(prim, property) -> problem, of what is changed with `prim`."""
    fabric = _fabric_of(prim)
    threads = thread_prims(fabric) if type_of(fabric) == "WovenFabric" else [prim]
    found = [fault for each in (fabric, *threads) for fault in faults(each)]
    return {(fault.prim, fault.property): fault.problem for fault in found}
