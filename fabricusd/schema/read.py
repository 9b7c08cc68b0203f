"""Prim -> Fabric. Only composed values are asked for, so every kind of composition works."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from pxr import Usd

from fabricusd.errors import FabricError, reads
from fabricusd.fabric import Binding, Fabric, TangentCurve, Thread, ThreadSet, Weave
from fabricusd.schema import attributes, weave_rows
from fabricusd.schema.access import over_above, targets, value
from fabricusd.schema.attributes import DEGREE, Attribute, to_si
from fabricusd.schema.check import Finding, check_prim
from fabricusd.schema.names import free_name
from fabricusd.schema.rules.rules import thread_prims
from fabricusd.schema.source import (
    find_fabric,
    no_warnings,
    open_stage,
    split_source,
    usd_errors,
)

Note = Callable[[str], None]

_BACK = "fabric:back"


@reads("a fabric")
def load(source: str | os.PathLike[str]) -> Fabric:
    """The fabric in `FILE[:/PRIM]`, or a preset by its name.

    FabricError, naming place, value and what would be accepted, where it breaks a rule.
    """
    stage, file = open_stage(source)
    with usd_errors(file, "read as a fabric"), no_warnings():
        prim = find_fabric(stage, file, split_source(source)[1])
        try:
            return read_fabric(prim)
        except FabricError as error:
            raise error.inside(f"{file}:") from error


def read_fabric(prim: Usd.Prim, note: Note | None = None) -> Fabric:
    """A WovenFabric prim -> Fabric, with its back.

    note : gets a line where the back cannot be read, and the front is returned without it; where
        it is None, that raises FabricError as well
    """
    faults = list(check_prim(prim, fatal=True))
    fabric = _read_side(prim, [f for f in faults if f.property != _BACK])
    try:
        back = _read_back(prim, [f for f in faults if f.property == _BACK])
    except FabricError as error:
        if note is None:
            raise
        note(f"{error} - seen from behind it is its front, mirrored")
        back = None
    return replace(fabric, back=back)


def _read_back(prim: Usd.Prim, faults: list[Finding]) -> Fabric | None:
    _raise_first(faults)
    found = targets(prim, _BACK)
    if not found:
        return None
    back = prim.GetStage().GetPrimAtPath(found[0])
    beyond = targets(back, _BACK)
    if beyond and beyond != [prim.GetPath()]:
        raise FabricError(
            f"{back.GetPath()} {_BACK}",
            f"targets {beyond[0]}; the back of {prim.GetPath()} must target that or nothing",
        )
    return read_side(back)


def read_side(prim: Usd.Prim) -> Fabric:
    """A WovenFabric prim without its back."""
    return _read_side(prim, [f for f in check_prim(prim, fatal=True) if f.property != _BACK])


def _read_side(prim: Usd.Prim, faults: list[Finding]) -> Fabric:
    _raise_first(faults)
    threads: dict[str, Thread] = {}
    for thread_prim in thread_prims(prim):
        _require_clean(thread_prim)
        # Two threads of one name may come from two libraries.
        threads[free_name(thread_prim.GetName(), threads)] = read_thread(thread_prim)
    rows = value(prim, "fabric:weave:rows")
    return Fabric(
        name=prim.GetName(),
        threads=threads,
        weave=Weave(weave_rows.to_cells(rows), value(prim, "fabric:weave:name")),
        warp=_read_set(prim, "warp"),
        weft=_read_set(prim, "weft"),
        model=str(value(prim, "fabric:model")),
        opaque=bool(value(prim, "fabric:opaque")),
        documentation=_documentation(prim),
        **_read_numbers(prim, attributes.FABRIC),
    )


def _require_clean(prim: Usd.Prim) -> None:
    _raise_first(list(check_prim(prim, fatal=True)))


def _raise_first(faults: list[Finding]) -> None:
    for finding in faults:
        raise FabricError(f"{finding.prim} {finding.property}".strip(), finding.problem)


def _read_numbers(prim: Usd.Prim, table: tuple[Attribute, ...]) -> dict[str, Any]:
    return {entry.field: to_si(value(prim, entry.name), entry) for entry in table}


def _read_set(prim: Usd.Prim, which: str) -> ThreadSet:
    sequence = tuple(value(prim, f"fabric:{which}:threads"))
    return ThreadSet(sequence=sequence, **_read_numbers(prim, attributes.thread_set(which)))


def read_thread(prim: Usd.Prim) -> Thread:
    """A WovenThread prim without faults -> Thread."""
    angles = (a * DEGREE for a in value(prim, "thread:curve:angles"))
    curve = TangentCurve(
        positions=tuple(value(prim, "thread:curve:positions")),
        angles=tuple(min(max(a, -math.pi / 2), math.pi / 2) for a in angles),
    )
    model = str(value(prim, "thread:model"))
    return Thread(
        curve=curve,
        model="" if model == "inherit" else model,
        documentation=_documentation(prim),
        **_read_numbers(prim, attributes.THREAD),
    )


def read_binding(prim: Usd.Prim, note: Note | None = None) -> Binding:
    """A mesh or subset with WovenBindingAPI -> Binding; `note` as in `read_fabric`.

    It also gets a line about a fabric below an `over`, which is read all the same.
    """
    _require_clean(prim)
    fabric = prim.GetStage().GetPrimAtPath(targets(prim, "fabric:binding")[0])
    over = over_above(fabric)
    if over and note is not None:
        note(
            f"wears {fabric.GetPath()}, which lies below {over.GetPath()}, an 'over' that no layer "
            "defines: other programs do not see it and show a grey; make it a 'def'"
        )
    return Binding(
        fabric=read_fabric(fabric, note),
        uv_set=str(value(prim, "fabric:binding:uvSet")),
        **_read_numbers(prim, attributes.BINDING),
    )


def _documentation(prim: Usd.Prim) -> str:
    # Without this test USD answers with the schema's own documentation.
    return str(prim.GetDocumentation()) if prim.HasAuthoredDocumentation() else ""
