"""Prim -> Fabric. Only composed values are asked for, so every kind of composition works."""

from __future__ import annotations

import math
import os
from typing import Any

from pxr import Usd

from fabricusd.errors import FabricError, reads
from fabricusd.fabric import Binding, Fabric, TangentCurve, Thread, ThreadSet, Weave
from fabricusd.schema import attributes, weave_rows
from fabricusd.schema.attributes import DEGREE, Attribute, to_si
from fabricusd.schema.check import check_prim
from fabricusd.schema.names import free_name
from fabricusd.schema.rules import thread_prims
from fabricusd.schema.source import find_fabric, open_stage, split_source, usd_errors


@reads("a fabric")
def load(source: str | os.PathLike[str]) -> Fabric:
    """The fabric in `FILE[:/PRIM]`, or a preset by its name.

    FabricError, naming place, value and what would be accepted, where it breaks a rule.
    """
    stage, file = open_stage(source)
    with usd_errors(file, "read as a fabric"):
        prim = find_fabric(stage, file, split_source(source)[1])
        try:
            return read_fabric(prim)
        except FabricError as error:
            raise error.inside(f"{file}:") from error


def read_fabric(prim: Usd.Prim) -> Fabric:
    """A Fabric prim -> Fabric, with its back."""
    fabric = read_side(prim)
    targets = prim.GetRelationship("fabric:back").GetForwardedTargets()
    if not targets:
        return fabric
    back = read_side(prim.GetStage().GetPrimAtPath(targets[0]), prim)
    return _replace(fabric, back=back)


def _replace(fabric: Fabric, **changes: Any) -> Fabric:
    from dataclasses import replace

    return replace(fabric, **changes)


def read_side(prim: Usd.Prim, front: Usd.Prim | None = None) -> Fabric:
    """A Fabric prim without its back; a back may name its `front` as its own, and nothing else."""
    _require_clean(prim)
    if front is not None:
        beyond = prim.GetRelationship("fabric:back").GetForwardedTargets()
        if beyond and beyond != [front.GetPath()]:
            raise FabricError(
                f"{prim.GetPath()} fabric:back",
                f"targets {beyond[0]}; the back of {front.GetPath()} must target that or nothing",
            )
    threads: dict[str, Thread] = {}
    for thread_prim in thread_prims(prim):
        _require_clean(thread_prim)
        # Two threads of one name may come from two libraries.
        threads[free_name(thread_prim.GetName(), threads)] = read_thread(thread_prim)
    rows = prim.GetAttribute("fabric:weave:rows").Get()
    return Fabric(
        name=prim.GetName(),
        threads=threads,
        weave=Weave(weave_rows.to_cells(rows), prim.GetAttribute("fabric:weave:name").Get()),
        warp=_read_set(prim, "warp"),
        weft=_read_set(prim, "weft"),
        model=str(prim.GetAttribute("fabric:model").Get()),
        opaque=bool(prim.GetAttribute("fabric:opaque").Get()),
        documentation=_documentation(prim),
        **_read_numbers(prim, attributes.FABRIC),
    )


def _require_clean(prim: Usd.Prim) -> None:
    for finding in check_prim(prim, severity="error"):
        raise FabricError(f"{finding.prim} {finding.property}".strip(), finding.problem)


def _read_numbers(prim: Usd.Prim, table: tuple[Attribute, ...]) -> dict[str, Any]:
    return {entry.field: to_si(prim.GetAttribute(entry.name).Get(), entry) for entry in table}


def _read_set(prim: Usd.Prim, which: str) -> ThreadSet:
    sequence = tuple(prim.GetAttribute(f"fabric:{which}:threads").Get())
    return ThreadSet(sequence=sequence, **_read_numbers(prim, attributes.thread_set(which)))


def read_thread(prim: Usd.Prim) -> Thread:
    """A FabricThread prim without faults -> Thread."""
    angles = (a * DEGREE for a in prim.GetAttribute("thread:curve:angles").Get())
    curve = TangentCurve(
        positions=tuple(prim.GetAttribute("thread:curve:positions").Get()),
        angles=tuple(min(max(a, -math.pi / 2), math.pi / 2) for a in angles),
    )
    model = str(prim.GetAttribute("thread:model").Get())
    return Thread(
        curve=curve,
        model="" if model == "inherit" else model,
        documentation=_documentation(prim),
        **_read_numbers(prim, attributes.THREAD),
    )


def read_binding(prim: Usd.Prim) -> Binding:
    """A mesh or subset with FabricBindingAPI -> Binding."""
    _require_clean(prim)
    target = prim.GetRelationship("fabric:binding").GetForwardedTargets()[0]
    return Binding(
        fabric=read_fabric(prim.GetStage().GetPrimAtPath(target)),
        uv_set=str(prim.GetAttribute("fabric:binding:uvSet").Get()),
        **_read_numbers(prim, attributes.BINDING),
    )


def _documentation(prim: Usd.Prim) -> str:
    # Without this test USD answers with the schema's own documentation.
    return str(prim.GetDocumentation()) if prim.HasAuthoredDocumentation() else ""
