"""Prim -> Fabric. Only composed values are asked for, so every kind of composition works."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace

from pxr import Usd

from fabricusd.errors import FabricError, reads
from fabricusd.fabric import Binding, Fabric
from fabricusd.schema import attributes
from fabricusd.schema.access import BACK, over_above, targets, thread_prims, value
from fabricusd.schema.build import build_numbers, build_side
from fabricusd.schema.findings import Finding, check_prim
from fabricusd.schema.source import (
    find_fabric,
    no_warnings,
    open_stage,
    split_source,
    usd_errors,
)

Note = Callable[[str], None]


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
    fabric = _read_side(prim, [f for f in faults if f.property != BACK])
    try:
        back = _read_back(prim, [f for f in faults if f.property == BACK])
    except FabricError as error:
        if note is None:
            raise
        note(f"{error} - seen from behind it is its front, mirrored")
        back = None
    return replace(fabric, back=back)


def _read_back(prim: Usd.Prim, faults: list[Finding]) -> Fabric | None:
    _raise_first(faults)
    found = targets(prim, BACK)
    if not found:
        return None
    back = prim.GetStage().GetPrimAtPath(found[0])
    beyond = targets(back, BACK)
    if beyond and beyond != [prim.GetPath()]:
        raise FabricError(
            f"{back.GetPath()} {BACK}",
            f"targets {beyond[0]}; the back of {prim.GetPath()} must target that or nothing",
        )
    return _read_side(back, [f for f in check_prim(back, fatal=True) if f.property != BACK])


def _read_side(prim: Usd.Prim, faults: list[Finding]) -> Fabric:
    _raise_first(faults)
    for thread in thread_prims(prim):
        _require_clean(thread)
    return build_side(prim)


def _require_clean(prim: Usd.Prim) -> None:
    _raise_first(list(check_prim(prim, fatal=True)))


def _raise_first(faults: list[Finding]) -> None:
    for finding in faults:
        raise FabricError(f"{finding.prim} {finding.property}".strip(), finding.problem)


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
        **build_numbers(prim, attributes.BINDING),
    )
