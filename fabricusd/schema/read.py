"""Prim -> Fabric. Only composed values are asked for, so every kind of composition works."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from dataclasses import replace

from pxr import Usd

from fabricusd.errors import FabricError, FabricWarning, reads
from fabricusd.fabric import Binding, Fabric
from fabricusd.schema import attributes
from fabricusd.schema.access import BACK, over_above, targets, thread_prims, value
from fabricusd.schema.build import build_numbers, build_side
from fabricusd.schema.findings import Finding, faults, remarks
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

    FabricError, naming place, value and what would be accepted, where it breaks a rule. A
    FabricWarning of what is not read as it stands, such as values in time.
    """
    return _load(source, _warn)


@reads("a fabric")
def load_noted(source: str | os.PathLike[str]) -> tuple[Fabric, tuple[str, ...]]:
    """`load`, with a line of each thing that is not read as it stands, and no warning."""
    notes: list[str] = []
    return _load(source, notes.append), tuple(notes)


@reads("a fabric")
def load_placed(source: str | os.PathLike[str]) -> tuple[str, Fabric]:
    """The path of the WovenFabric prim that `load` reads, and the fabric."""
    return _load_placed(source, _warn)


def _load(source: str | os.PathLike[str], tell: Note) -> Fabric:
    return _load_placed(source, tell)[1]


def _load_placed(source: str | os.PathLike[str], tell: Note) -> tuple[str, Fabric]:
    stage, file = open_stage(source)
    with usd_errors(file, "read as a fabric"), no_warnings():
        prim = find_fabric(stage, file, split_source(source)[1])
        try:
            return str(prim.GetPath()), _read_both_sides(prim, tell, None)
        except FabricError as error:
            raise error.inside(f"{file}:") from error


def read_fabric(prim: Usd.Prim, note: Note | None = None) -> Fabric:
    """A WovenFabric prim -> Fabric, with its back.

    note : gets a line of each thing that is not read as it stands, such as values in time, and of a
        back that cannot be read, without which the front is returned. Where it is None, the first
        are FabricWarnings, and such a back raises FabricError.
    """
    return _read_both_sides(prim, note or _warn, note)


def _read_both_sides(prim: Usd.Prim, tell: Note, lost_back: Note | None) -> Fabric:
    found = faults(prim)
    fabric = _read_side(prim, [f for f in found if f.property != BACK], tell)
    try:
        back = _read_back(prim, [f for f in found if f.property == BACK], tell)
    except FabricError as error:
        if lost_back is None:
            raise
        lost_back(f"{error} - seen from behind it is its front, mirrored")
        back = None
    return replace(fabric, back=back)


def _read_back(prim: Usd.Prim, found: list[Finding], note: Note) -> Fabric | None:
    _raise_first(found)
    backs = targets(prim, BACK)
    if not backs:
        return None
    back = prim.GetStage().GetPrimAtPath(backs[0])
    beyond = targets(back, BACK)
    if beyond and beyond != [prim.GetPath()]:
        raise FabricError(
            f"{back.GetPath()} {BACK}",
            f"targets {beyond[0]}; the back of {prim.GetPath()} must target that or nothing",
        )
    return _read_side(back, [f for f in faults(back) if f.property != BACK], note)


def _read_side(prim: Usd.Prim, found: list[Finding], note: Note) -> Fabric:
    _raise_first(found)
    threads = thread_prims(prim)
    for thread in threads:
        _require_clean(thread)
    for each in (prim, *threads):
        _pass_on(each, note)
    return build_side(prim)


def _pass_on(prim: Usd.Prim, note: Note) -> None:
    for finding in remarks(prim):
        note(f"{finding.prim} {finding.property} {finding.problem}")


def _warn(line: str) -> None:
    warnings.warn(line, FabricWarning, stacklevel=2)


def _require_clean(prim: Usd.Prim) -> None:
    _raise_first(faults(prim))


def _raise_first(found: list[Finding]) -> None:
    for finding in found:
        raise FabricError(f"{finding.prim} {finding.property}".strip(), finding.problem)


def read_binding(prim: Usd.Prim, note: Note | None = None) -> Binding:
    """A mesh or subset with WovenBindingAPI -> Binding; `note` as in `read_fabric`.

    It also gets a line about a fabric below an `over`, which is read all the same.
    """
    _require_clean(prim)
    _pass_on(prim, note or _warn)
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
