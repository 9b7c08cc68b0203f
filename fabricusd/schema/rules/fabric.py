"""Rules of a WovenFabric."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from pxr import Sdf, Usd

from fabricusd.fabric import FACETS
from fabricusd.schema import attributes
from fabricusd.schema.access import (
    allowed_tokens,
    kind_of,
    lost_targets,
    next_targets,
    targets,
    thread_prims,
    type_of,
    value,
)
from fabricusd.schema.build import build_side
from fabricusd.schema.rules.table import FABRIC, Fault, rule
from fabricusd.sides import LENGTHS, spread
from fabricusd.weaves import rows as weave_rows


def _forwarding_cycle(relationship: Usd.Relationship) -> list[str]:
    """The chain of relationships that leads back to itself, [] where there is none."""
    stage = relationship.GetStage()

    def follow(path: Sdf.Path, chain: list[Sdf.Path]) -> list[Sdf.Path]:
        if path in chain:
            return [*chain, path]
        forwarded = stage.GetRelationshipAtPath(path) if path.IsPropertyPath() else None
        if not forwarded:
            return []
        for target in next_targets(forwarded):
            found = follow(target, [*chain, path])
            if found:
                return found
        return []

    return [str(path) for path in follow(relationship.GetPath(), [])]


@rule(FABRIC)
def relationship_acyclic(prim: Usd.Prim) -> Iterator[Fault]:
    """No relationship of a fabric leads back to itself, and no fabric is its own back."""
    for name in ("fabric:threads", "fabric:back"):
        relationship = prim.GetRelationship(name)
        if not relationship:
            continue
        cycle = _forwarding_cycle(relationship)
        if cycle:
            yield name, f"leads in a circle, {' -> '.join(cycle)}; it must end at a prim"
        elif prim.GetPath() in targets(prim, name):
            yield name, f"targets {prim.GetPath()}, its own prim; it must target another"


@rule(FABRIC)
def threads_exist(prim: Usd.Prim) -> Iterator[Fault]:
    """A fabric has at least one thread, and every target of its thread list is a WovenThread."""
    if not thread_prims(prim) and not lost_targets(prim, "fabric:threads"):
        yield "fabric:threads", "targets no thread; it must target at least one WovenThread prim"
    for path in targets(prim, "fabric:threads"):
        target = prim.GetStage().GetPrimAtPath(path)
        if not target:
            yield (
                "fabric:threads",
                f"targets {path}, which does not exist; it must be a WovenThread",
            )
        elif type_of(target) != "WovenThread" and target != prim:
            yield "fabric:threads", f"targets {path}, {kind_of(target)}; it must be a WovenThread"


@rule(FABRIC)
def thread_indices_in_range(prim: Usd.Prim) -> Iterator[Fault]:
    """Every index in the warp and weft sequences is that of a thread."""
    count = len(thread_prims(prim))
    for which in ("warp", "weft"):
        name = f"fabric:{which}:threads"
        sequence = np.asarray(value(prim, name) or (), dtype=np.int64)
        if sequence.size == 0:
            yield name, "is empty; it must have at least one index"
            continue
        wrong = np.flatnonzero((sequence < 0) | (sequence >= count))
        if wrong.size and count:
            yield (
                name,
                f"[{wrong[0]}] is {sequence[wrong[0]]}; it must be from 0 to {count - 1}, "
                f"the fabric has {count} thread{'s' if count > 1 else ''}",
            )


@rule(FABRIC)
def coverage_at_most_one(prim: Usd.Prim) -> Iterator[Fault]:
    """Authored coverages of warp and weft add up to at most 1."""
    values = [value(prim, f"fabric:{w}:coverage") for w in ("warp", "weft")]
    total = sum(v for v in values if v is not None and math.isfinite(v) and v > 0)
    if total > 1.0 + 1e-9:
        yield "fabric:weft:coverage", f"and the warp's add up to {total:g}; it must be at most 1"


@rule(FABRIC)
def surface_law_allowed(prim: Usd.Prim) -> Iterator[Fault]:
    """The surface law is an allowed token, and facets only where every thread is conserving."""
    name = "fabric:surfaceLaw"
    allowed, token = allowed_tokens(prim, name), value(prim, name)
    if token not in allowed:
        yield name, f"is '{token}'; it must be one of {', '.join(allowed)}"
    elif token == FACETS:
        inherited = str(value(prim, "fabric:model"))
        for thread in thread_prims(prim):
            own = str(value(thread, "thread:model"))
            model = inherited if own == "inherit" else own
            if model != "conserving":
                yield (
                    name,
                    f"is {FACETS}, the law of conserving threads, but {thread.GetPath()} is "
                    f"{model}; it must be one of {', '.join(t for t in allowed if t != FACETS)}",
                )
                return


@rule(FABRIC)
def sides_are_shares(prim: Usd.Prim) -> Iterator[Fault]:
    """Shares by side are one for each direction; reflected and transmitted add up to at most 1."""
    stated = {}
    for entry in attributes.SIDES:
        held = tuple(value(prim, entry.name))
        if len(held) not in LENGTHS:
            lengths = ", ".join(str(n) for n in LENGTHS[:-1])
            yield entry.name, f"has {len(held)} shares; it must have {lengths} or {LENGTHS[-1]}"
        elif held and all(0.0 <= share <= 1.0 for share in held):
            stated[entry.field] = spread(held)
    if {"reflected", "transmitted"} <= stated.keys():
        most = float((stated["reflected"] + stated["transmitted"]).max())
        if most > 1.0 + 1e-9:
            yield (
                "fabric:sides:transmitted",
                f"and fabric:sides:reflected add up to {most:g}; they must add up to at most 1",
            )


@rule(FABRIC)
def weave_is_a_grid(prim: Usd.Prim) -> Iterator[Fault]:
    """The weave has at least one row, rows of one length, and no character but 0 and 1."""
    problem = weave_rows.fault(value(prim, "fabric:weave:rows") or ())
    if problem:
        yield "fabric:weave:rows", problem


@rule(FABRIC)
def back_is_a_fabric(prim: Usd.Prim) -> Iterator[Fault]:
    """The back, where there is one, is one WovenFabric prim."""
    found = targets(prim, "fabric:back")
    if len(found) > 1:
        yield "fabric:back", f"has {len(found)} targets; it must have at most 1"
    for path in found[:1]:
        target = prim.GetStage().GetPrimAtPath(path)
        if not target:
            yield "fabric:back", f"targets {path}, which does not exist; it must be a WovenFabric"
        elif type_of(target) != "WovenFabric":
            yield "fabric:back", f"targets {path}, {kind_of(target)}; it must be a WovenFabric"


@rule(FABRIC, severity="warning")
def threads_used(prim: Usd.Prim) -> Iterator[Fault]:
    """Every thread of a fabric is in its warp or its weft."""
    used: set[int] = set()
    for which in ("warp", "weft"):
        used.update(value(prim, f"fabric:{which}:threads") or ())
    for index, thread in enumerate(thread_prims(prim)):
        if thread and index not in used:
            yield (
                "fabric:threads",
                f"[{index}], {thread.GetName()}, is used by neither the warp nor the weft",
            )


@rule(FABRIC, severity="warning", sound=True)
def gap_is_asked_for(prim: Usd.Prim) -> Iterator[Fault]:
    """Cloth closes, up to 3 % of gap, unless a coverage asks for more or the cloth is opaque."""
    from fabricusd.schema.rules.closed import unasked_gap

    problem = unasked_gap(build_side(prim))
    if problem:
        yield (
            "",
            f"{problem}; make the threads thicker or denser, or set fabric:warp:coverage and "
            "fabric:weft:coverage if the gap is meant",
        )


@rule(FABRIC, severity="warning", sound=True)
def albedo_is_safe(prim: Usd.Prim) -> Iterator[Fault]:
    """The fabric reflects at most the light that it receives, in every view."""
    from fabricusd.appearance.albedo import QUICK, WORST_VIEWS, albedo_by_view, safe_albedo
    from fabricusd.appearance.laws import law_of
    from fabricusd.appearance.scattering.models import model_of

    fabric = build_side(prim)
    worst = 0.0
    # The other laws divide by what is too much.
    if not law_of(fabric).absolute:
        worst = float(albedo_by_view(fabric, np.radians(WORST_VIEWS), QUICK).max())
    if worst > 1.0:
        safe = safe_albedo(fabric, QUICK)
        yield (
            "fabric:threads",
            f"reflect {worst:.3g} of the light in the worst view; lower thread:albedo (white is "
            f"safe up to {safe:.2g}), or set fabric:model to conserving",
        )
    for name, thread in fabric.threads.items():
        most = model_of(fabric, thread).most_albedo
        if max(thread.albedo) > most:
            yield (
                "fabric:threads",
                f"{name} has an albedo above {most:g}; the model {fabric.model_of(thread)} uses "
                f"{most:g} instead",
            )
