"""Words of the trade, and the attributes that each of them sets.

A word is a function from (fabric, names of threads, what was typed, place for messages) to values
in SI units: of threads by name and field, and of the two sets by field.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from fabricusd.errors import FabricError
from fabricusd.fabric import BASES, CONSERVING_MODEL, Fabric, Thread
from fabricusd.weaves.cloth import parse_weight, with_weight
from fabricusd.weaves.color import parse_color
from fabricusd.weaves.draft import quoted
from fabricusd.weaves.yarn import diameter, parse_count

INCH = 0.0254


@dataclass(kw_only=True)
class Changes:
    """Values in SI units: thread name -> field -> value; "warp" or "weft" -> field -> value."""

    threads: dict[str, dict[str, Any]] = field(default_factory=dict)
    sets: dict[str, dict[str, Any]] = field(default_factory=dict)


Word = Callable[[Fabric, Iterable[str], str, str], Changes]


def _each(
    names: Iterable[str], fabric: Fabric, change: Callable[[Thread], dict[str, Any]]
) -> Changes:
    return Changes(threads={name: change(fabric.threads[name]) for name in names})


def _number(text: str, low: float, high: float, unit: str, where: str) -> float:
    """A number above `low` and at most `high`."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not low < number <= high:
        raise FabricError(
            where, f"is {quoted(text, 40)}; it must be above {low:g} and at most {high:g} {unit}"
        )
    return number


def color(fabric: Fabric, names: Iterable[str], text: str, where: str) -> Changes:
    """Colour of cloth of the thread, in any form of `new`; the albedo is solved for it.

    A thread of a published model, whose A is no albedo, keeps the ratio of its albedo to its
    colour.
    """
    names = list(names)
    observer = {fabric.threads[name].target_observer for name in names}
    rgb = parse_color(text, where, min(observer, default=2))
    red, green, blue = (max(channel, 0.0) for channel in rgb)
    inside = red, green, blue

    def change(thread: Thread) -> dict[str, Any]:
        if fabric.model_of(thread) == CONSERVING_MODEL:
            basis = thread.target_basis if thread.target_basis != BASES[0] else BASES[1]
            return {"color": inside, "target_color": rgb, "target_basis": basis}
        ratio = max(thread.albedo) / max(thread.color) if max(thread.color) > 0 else 1.0
        return {"color": inside, "albedo": tuple(channel * ratio for channel in inside)}

    return _each(names, fabric, change)


def roughness(fabric: Fabric, names: Iterable[str], text: str, where: str) -> Changes:
    """Roughness from 0 to 1 as in other materials; both lobes are widened alike.

    A microfacet surface of roughness r tilts its normals by r^2 / sqrt(2) rad, which is the
    standard deviation of the surface lobe: 0.25 a bright filament, 0.55 spun linen.
    """
    width = _number(text, 0.0, 1.0, "(0.25 a bright filament, 0.55 spun)", where) ** 2 / math.sqrt(
        2
    )

    def change(thread: Thread) -> dict[str, Any]:
        wide = min(width * thread.gamma_volume / thread.gamma_surface, math.pi)
        return {"gamma_surface": width, "gamma_volume": wide}

    return _each(names, fabric, change)


def yarn(fabric: Fabric, names: Iterable[str], text: str, where: str) -> Changes:
    """Yarn count, 20 tex or Ne 30/2; the thickness follows by Peirce, as of cotton."""
    count = parse_count(text, where)
    return _each(names, fabric, lambda _: {"linear_density": count, "thickness": diameter(count)})


def weight(fabric: Fabric, names: Iterable[str], text: str, where: str) -> Changes:
    """Weight of the cloth, 14oz or 470gsm: scales the yarn counts, and keeps the densities."""
    made = with_weight(fabric, parse_weight(text, where))
    if set(made.threads) != {list(fabric.threads)[k] for k in _used(fabric)}:
        raise FabricError(
            where, "needs threads of a known thickness or count; set thickness or yarn before it"
        )
    return _each(
        made.threads,
        made,
        lambda t: {"linear_density": t.linear_density, "thickness": t.thickness},
    )


def _used(fabric: Fabric) -> set[int]:
    return {*fabric.warp.sequence, *fabric.weft.sequence}


def _density(which: str, per: float, unit: str) -> Word:
    def word(fabric: Fabric, names: Iterable[str], text: str, where: str) -> Changes:
        number = _number(text, 0.0, 10000.0, f"per {unit}", where)
        return Changes(sets={which: {"density": number / per}})

    noun = "Ends" if which == "warp" else "Picks"
    word.__doc__ = f"{noun} per {unit}."
    return word


WORDS: dict[str, Word] = {
    "color": color,
    "colour": color,
    "roughness": roughness,
    "yarn": yarn,
    "weight": weight,
    "ends-per-cm": _density("warp", 0.01, "cm"),
    "picks-per-cm": _density("weft", 0.01, "cm"),
    "ends-per-inch": _density("warp", INCH, "inch"),
    "picks-per-inch": _density("weft", INCH, "inch"),
}
"""Word -> its function, whose first line says what it takes."""

SHORT = {"grain": "fabric:binding:rotation", "scale": "fabric:binding:millimetersPerUnit"}
"""Word -> the attribute that it stands for."""
