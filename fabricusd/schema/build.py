"""Prims that the rules find no fault with -> the dataclasses; nothing is checked here."""

from __future__ import annotations

import math
from typing import Any

from pxr import Usd

from fabricusd.fabric import Fabric, TangentCurve, Thread, ThreadSet, Weave
from fabricusd.schema import attributes
from fabricusd.schema.access import thread_prims, value
from fabricusd.schema.attributes import DEGREE, Attribute, to_si
from fabricusd.schema.colors import color
from fabricusd.schema.names import free_name
from fabricusd.sides import Sides
from fabricusd.weaves import rows as weave_rows


def build_side(prim: Usd.Prim) -> Fabric:
    """A WovenFabric prim -> Fabric, without its back."""
    threads: dict[str, Thread] = {}
    for thread_prim in thread_prims(prim):
        # Two threads of one name may come from two libraries.
        threads[free_name(thread_prim.GetName(), threads)] = build_thread(thread_prim)
    rows = value(prim, "fabric:weave:rows")
    return Fabric(
        name=prim.GetName(),
        threads=threads,
        weave=Weave(weave_rows.to_cells(rows), value(prim, "fabric:weave:name")),
        warp=_build_set(prim, "warp"),
        weft=_build_set(prim, "weft"),
        model=str(value(prim, "fabric:model")),
        surface_law=str(value(prim, "fabric:surfaceLaw")),
        opaque=bool(value(prim, "fabric:opaque")),
        sides=Sides(**build_numbers(prim, attributes.SIDES)),
        documentation=_documentation(prim),
        **build_numbers(prim, attributes.FABRIC),
    )


def build_thread(prim: Usd.Prim) -> Thread:
    """A WovenThread prim -> Thread."""
    angles = (a * DEGREE for a in value(prim, "thread:curve:angles"))
    curve = TangentCurve(
        positions=tuple(value(prim, "thread:curve:positions")),
        angles=tuple(min(max(a, -math.pi / 2), math.pi / 2) for a in angles),
    )
    model = str(value(prim, "thread:model"))
    return Thread(
        curve=curve,
        model="" if model == "inherit" else model,
        target_basis=str(value(prim, "thread:targetColor:basis")),
        target_observer=int(value(prim, "thread:targetColor:observer")),
        documentation=_documentation(prim),
        **build_numbers(prim, attributes.THREAD),
    )


def build_numbers(prim: Usd.Prim, table: tuple[Attribute, ...]) -> dict[str, Any]:
    """Fields of a dataclass by name, in SI units."""
    read = {True: color, False: value}
    return {entry.field: to_si(read[entry.is_color](prim, entry.name), entry) for entry in table}


def _build_set(prim: Usd.Prim, which: str) -> ThreadSet:
    sequence = tuple(value(prim, f"fabric:{which}:threads"))
    return ThreadSet(sequence=sequence, **build_numbers(prim, attributes.thread_set(which)))


def _documentation(prim: Usd.Prim) -> str:
    # Without this test USD answers with the schema's own documentation.
    return str(prim.GetDocumentation()) if prim.HasAuthoredDocumentation() else ""
