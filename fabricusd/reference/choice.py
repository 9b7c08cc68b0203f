"""Choosing the cheapest method whose measured error meets a bound."""

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
"""Error bounds for which the limits of the levels were measured."""


TABLE = Path(__file__).with_name("choice.json")


Front = Mapping[str, tuple[float, float]]
"""Method -> (cost, error)."""


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A method, its cost and error, and the reason for the choice in words."""

    method: str
    cost: float
    error: float
    why: str


@cache
@reads("a table of choices")
def read_table(path: Path = TABLE) -> dict[str, Front]:
    """Preset -> front of its shadowing methods. Raises FabricError for a file of another kind."""
    return {
        name: {method: (float(c), float(e)) for method, (c, e) in front.items()}
        for name, front in _part(path, "shadows").items()
    }


@cache
@reads("a table of choices")
def read_limits(path: Path = TABLE) -> dict[str, dict[str, dict[float, float]]]:
    """Preset -> level -> bound -> limit, as `level_errors.coarsest` finds them."""
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
        raise FabricError(str(path), f"is not a table of choices: {error}") from None


def front_of(name: str, table: Mapping[str, Front]) -> Front:
    """A preset's front; for other cloths, each method's worst cost and error over the presets."""
    if name in table:
        return table[name]
    methods = set.intersection(*(set(front) for front in table.values()))
    return {
        m: tuple(max(front[m][k] for front in table.values()) for k in (0, 1))  # type: ignore[misc]
        for m in methods
    }


def cheapest(front: Front, max_error: float) -> Choice:
    """The cheapest method with an error of at most `max_error`; if there is none, the best one."""
    if not max_error > 0:
        raise FabricError("--max-error", f"is {max_error:g}; it must be above 0")
    least = min(cost for cost, _ in front.values())
    good = {m: x for m, x in front.items() if x[1] <= max_error}
    method = min(good, key=lambda m: good[m]) if good else min(front, key=lambda m: front[m][1])
    cost, error = front[method]
    cheaper = [m for m, x in front.items() if x[0] < cost and m != method]
    why = f"error {error:.2g}, {cost / least:.2g} times the cheapest"
    if not good:
        why += f"; no method is within {max_error:g}, and this one is the most accurate"
    elif cheaper:
        misses = ", ".join(f"{m} {front[m][1]:.2g}" for m in sorted(cheaper))
        why += f"; cheaper methods have larger errors: {misses}"
    return Choice(method=method, cost=cost, error=error, why=why)


def choose_shadow(names: Sequence[str], max_error: float, path: Path = TABLE) -> Choice:
    """The shadowing method for a picture of the named cloths, which all use the same method.

    The error is the rms difference between the share of light that the method lets through and
    that of the ray-marched height field.
    """
    table = read_table(path)
    choices = [cheapest(front_of(name, table), max_error) for name in names or ("",)]
    return max(choices, key=lambda c: c.cost)


def choose_limits(names: Sequence[str], max_error: float, path: Path = TABLE) -> tuple[Limits, str]:
    """Where level `auto` changes levels for the named cloths, and the reason in words.

    Each level is used as soon as its error is within the bound, without a transition. The error is
    the rms difference over the pixels from level `thread`, filtered, divided by the cloth's mean.
    All cloths use the limits of the most demanding one.
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
    why = ", ".join(parts) + f": with these limits each level's error is within {max_error:g}"
    return Limits(repeats=repeats, pixels=pixels, octaves=0.0), why


def _within(found: Mapping[str, Mapping[float, float]], max_error: float) -> tuple[float, float]:
    """(repeats, pixels) for the largest bound in the table that does not exceed `max_error`."""
    far = {b: x for b, x in found["far"].items() if b <= max_error}
    weave = {b: x for b, x in found["weave"].items() if b <= max_error}
    return far[max(far)] if far else math.inf, weave[max(weave)] if weave else 0.0


def presets_in(scene: Scene) -> tuple[str, ...]:
    """A name for each fabric in a scene: its own if it is an unchanged preset, else ""."""
    from fabricusd.schema import load, preset_names

    presets = preset_names()
    fabrics = [m.binding.fabric for m in scene.materials if isinstance(m, FabricSurface)]
    return tuple(f.name if f.name in presets and f == load(f.name) else "" for f in fabrics)
