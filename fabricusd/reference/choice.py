"""The cheapest method that meets a bound, by the measured table."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from fabricusd.appearance.weave.footprint import Limits
from fabricusd.errors import FabricError, reads
from fabricusd.files import readable_file
from fabricusd.scene.scene import FabricSurface, Scene

BOUNDS = (0.5, 0.2, 0.1, 0.05, 0.02, 0.01)
"""Errors that the levels' limits are measured for."""


TABLE = Path(__file__).with_name("choice.json")


Front = Mapping[str, tuple[float, float]]
"""Method -> (cost, error)."""


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A method, what it costs and how far it is off, and why it was taken, for people."""

    method: str
    cost: float
    error: float
    why: str


@cache
@reads("a table of choices")
def read_table(path: Path = TABLE) -> dict[str, Front]:
    """Preset -> front of its shadowing methods; FabricError for a file that is no such table."""
    return {
        name: {method: (float(c), float(e)) for method, (c, e) in front.items()}
        for name, front in _part(path, "shadows").items()
    }


@cache
@reads("a table of choices")
def read_limits(path: Path = TABLE) -> dict[str, dict[str, dict[float, float]]]:
    """Preset -> level -> bound -> limit, as `level_errors.coarsest` has them."""
    return {
        name: {level: {float(b): float(x) for b, x in limits} for level, limits in found.items()}
        for name, found in _part(path, "levels").items()
    }


def _part(path: Path, name: str) -> dict[str, Any]:
    try:
        content = json.loads(readable_file(path).read_text(encoding="utf-8"))[name]
        if all(isinstance(found, dict) for found in content.values()):
            return dict(content)
        raise ValueError(f"'{name}' holds no tables")
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise FabricError(str(path), f"is no table of choices: {error}") from None


def front_of(name: str, table: Mapping[str, Front]) -> Front:
    """A preset's front; for any other cloth the worst of each method over the presets."""
    if name in table:
        return table[name]
    methods = set.intersection(*(set(front) for front in table.values()))
    return {
        m: tuple(max(front[m][k] for front in table.values()) for k in (0, 1))  # type: ignore[misc]
        for m in methods
    }


def cheapest(front: Front, max_error: float) -> Choice:
    """The cheapest method whose error is at most `max_error`; the nearest where none is."""
    if not max_error > 0:
        raise FabricError("--max-error", f"is {max_error:g}; it must be above 0")
    least = min(cost for cost, _ in front.values())
    good = {m: x for m, x in front.items() if x[1] <= max_error}
    method = min(good, key=lambda m: good[m]) if good else min(front, key=lambda m: front[m][1])
    cost, error = front[method]
    cheaper = [m for m, x in front.items() if x[0] < cost and m != method]
    why = f"error {error:.2g}, {cost / least:.2g} times the cheapest"
    if not good:
        why += f"; none is within {max_error:g}, this is the nearest"
    elif cheaper:
        misses = ", ".join(f"{m} {front[m][1]:.2g}" for m in sorted(cheaper))
        why += f"; cheaper ones are off by more: {misses}"
    return Choice(method=method, cost=cost, error=error, why=why)


def choose_shadow(names: Sequence[str], max_error: float, path: Path = TABLE) -> Choice:
    """The shadowing method for a picture of cloths of these names, which all take the same one.

    Error: rms difference of the share of light from the marched height field.
    """
    table = read_table(path)
    choices = [cheapest(front_of(name, table), max_error) for name in names or ("",)]
    return max(choices, key=lambda c: c.cost)


def choose_limits(names: Sequence[str], max_error: float, path: Path = TABLE) -> tuple[Limits, str]:
    """Where level `auto` changes for cloths of these names, and why, for people.

    Each level is taken as soon as its error is within the bound, without transition: rms over the
    pixels, over the cloth's mean, against level `thread` filtered. All cloths take the limits of
    the one that asks most.
    """
    table = read_limits(path)
    chosen = [_within(table[n], max_error) for n in ([n for n in names if n in table] or table)]
    if any(n not in table for n in names):
        chosen = [_within(found, max_error) for found in table.values()]
    repeats, pixels = max(c[0] for c in chosen), min(c[1] for c in chosen)
    parts = [
        f"far from {repeats:.3g} repeats a pixel" if repeats < math.inf else "far never",
        f"thread from {pixels:.3g} pixels a thread" if pixels > 0 else "else thread",
    ]
    why = ", ".join(parts) + f": the levels' errors beyond are within {max_error:g}"
    return Limits(repeats=repeats, pixels=pixels, octaves=0.0), why


def _within(found: Mapping[str, Mapping[float, float]], max_error: float) -> tuple[float, float]:
    """(repeats, pixels) by the largest bound of the table that is no larger than `max_error`."""
    far = {b: x for b, x in found["far"].items() if b <= max_error}
    weave = {b: x for b, x in found["weave"].items() if b <= max_error}
    return far[max(far)] if far else math.inf, weave[max(weave)] if weave else 0.0


def presets_in(scene: Scene) -> tuple[str, ...]:
    """A name for each fabric in a scene: its own where it is that preset unchanged, else ""."""
    from fabricusd.schema import load, preset_names

    presets = preset_names()
    fabrics = [m.binding.fabric for m in scene.materials if isinstance(m, FabricSurface)]
    return tuple(f.name if f.name in presets and f == load(f.name) else "" for f in fabrics)
