"""Albedos that follow the colours that they were solved for, when something else changes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd

from fabricusd.dye import dyed
from fabricusd.fabric import BASES, CONSERVING_MODEL
from fabricusd.schema.access import definitions, thread_prims, type_of
from fabricusd.schema.build import build_side

Value = tuple[Usd.Prim, Sdf.AttributeSpec, Any]
"""A prim, the attribute of the schema, its value in the file's unit."""

ALBEDO, BASIS = "thread:albedo", "thread:targetColor:basis"

CHANGED = 1e-6
"""Smallest change of an albedo that is written."""


def solved_again(prim: Usd.Prim) -> tuple[list[Value], list[str]]:
    """The albedos of a fabric's threads that their target colours now ask for, and a line for each.

    Nothing for a prim that is no fabric. A thread that no longer follows the conserving law has
    lost its target, which is then said.
    """
    if type_of(prim) != "WovenFabric":
        return [], []
    fabric = build_side(prim)
    values: list[Value] = []
    lines: list[str] = []
    aimed = []
    for name, thread, at in zip(
        fabric.threads, fabric.thread_list, thread_prims(prim), strict=True
    ):
        if thread.target_basis == BASES[0]:
            continue
        if fabric.model_of(thread) == CONSERVING_MODEL:
            aimed.append(name)
            continue
        values.append((at, _spec(at, BASIS), BASES[0]))
        lines.append(f"thread {name} is no longer {CONSERVING_MODEL}, and has no target colour now")
    done = dyed(fabric, aimed)
    for name, at in zip(fabric.threads, thread_prims(prim), strict=True):
        old, new = fabric.threads[name].albedo, done.fabric.threads[name].albedo
        if np.abs(np.subtract(old, new)).max() > CHANGED:
            values.append((at, _spec(at, ALBEDO), Gf.Vec3d(*new)))
            words = ", ".join(f"{channel:.3g}" for channel in new)
            lines.append(f"thread {name}: albedo {words}, solved for its colour")
    changed = any(value[1].name == ALBEDO for value in values)
    return values, [*lines, *(done.notes if changed else ())]


def without_target(values: Sequence[Value]) -> Iterator[Value]:
    """What forgets the target colours of threads of which `values` set the albedo."""
    for prim, spec, _ in values:
        if spec.name == ALBEDO:
            yield prim, _spec(prim, BASIS), BASES[0]


def _spec(prim: Usd.Prim, name: str) -> Sdf.AttributeSpec:
    return next(d[name] for d in definitions(prim) if name in d)
