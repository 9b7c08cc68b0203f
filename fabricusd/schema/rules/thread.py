"""Rules of a WovenThread."""

from __future__ import annotations

import math
from collections.abc import Iterator

from pxr import Usd

from fabricusd.fabric import UNEVENNESS, yarn_faults
from fabricusd.schema import attributes
from fabricusd.schema.access import allowed_tokens, value
from fabricusd.schema.attributes import MILLIMETRE, to_si
from fabricusd.schema.rules.table import THREAD, Fault, rule


@rule(THREAD)
def curve_points_match(prim: Usd.Prim) -> Iterator[Fault]:
    """A curve has as many positions as angles, and at least two."""
    positions = value(prim, "thread:curve:positions") or ()
    angles = value(prim, "thread:curve:angles") or ()
    if len(positions) != len(angles):
        yield (
            "thread:curve:angles",
            f"has {len(angles)} numbers and thread:curve:positions {len(positions)}; "
            "they must be as many",
        )
    elif len(positions) < 2:
        yield "thread:curve:positions", f"has {len(positions)} numbers; it must have at least 2"


@rule(THREAD)
def curve_positions_rise(prim: Usd.Prim) -> Iterator[Fault]:
    """A curve's positions are finite, never decrease, and span a length above 0."""
    name = "thread:curve:positions"
    positions = list(value(prim, name) or [])
    for k, x in enumerate(positions):
        if not math.isfinite(x):
            yield name, f"[{k}] is {x:g}; it must be finite"
            return
        if k and x < positions[k - 1]:
            yield name, f"[{k}] is {x:g}; it must be at least {positions[k - 1]:g}, the one before"
            return
    if len(positions) > 1 and positions[0] == positions[-1]:
        yield name, f"starts and ends at {positions[0]:g}; it must span a length above 0"


@rule(THREAD)
def curve_angles_in_range(prim: Usd.Prim) -> Iterator[Fault]:
    """A curve's angles are from -90 to 90 degrees."""
    name = "thread:curve:angles"
    for k, x in enumerate(value(prim, name) or ()):
        if not (math.isfinite(x) and -90.0 <= x <= 90.0):
            yield name, f"[{k}] is {x:g}; it must be from -90 to 90 degrees"
            return


@rule(THREAD)
def yarn_is_whole(prim: Usd.Prim) -> Iterator[Fault]:
    """Uneven yarn has a length over which it changes, and slubs a length and a distance."""
    mine = {entry.field: entry for entry in attributes.THREAD if entry.field in UNEVENNESS}
    held = {name: to_si(value(prim, entry.name), entry) for name, entry in mine.items()}
    for name, problem in yarn_faults(**held, scale=1.0 / MILLIMETRE, unit="mm"):
        yield mine[name].name, problem


@rule(THREAD)
def target_allowed(prim: Usd.Prim) -> Iterator[Fault]:
    """Basis and observer of the target colour are allowed tokens."""
    for name in ("thread:targetColor:basis", "thread:targetColor:observer"):
        allowed, token = allowed_tokens(prim, name), value(prim, name)
        if token not in allowed:
            yield name, f"is '{token}'; it must be one of {', '.join(allowed)}"
