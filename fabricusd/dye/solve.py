"""The albedo of threads for the colour that cloth of them is to have."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from fabricusd.appearance.layer import Layer, alone, layer_of
from fabricusd.dye.stack import BASIS
from fabricusd.errors import FabricError
from fabricusd.fabric import BASES, CONSERVING_MODEL, Fabric, Thread

Floats = NDArray[np.float64]

NOTICED = 1e-6
"""Distance from what is within reach, in linear light, below which a colour counts as reached."""


@dataclass(frozen=True, kw_only=True)
class Dyed:
    """A fabric whose threads have the albedo that their target colours ask for.

    notes : a line for each colour that cannot be reached
    """

    fabric: Fabric
    notes: tuple[str, ...]


def dyed(fabric: Fabric, names: Iterable[str] | None = None) -> Dyed:
    """`fabric` with albedos solved for the target colours of its threads, or of those in `names`.

    The colour of a thread is that of cloth of it alone, of the weave and the densities of `fabric`.
    Threads without a target keep their albedo. A colour that cannot be reached becomes the nearest.

    Raises FabricError for a thread with a target that does not follow the conserving law.
    """
    wanted = set(fabric.threads if names is None else names)
    threads, notes = dict(fabric.threads), []
    layers: dict[Thread, Layer] = {}
    for name, thread in fabric.threads.items():
        if name not in wanted or thread.target_basis == BASES[0]:
            continue
        layer = _layer_of_one(fabric, name, thread, layers)
        color = np.array(thread.target_color)
        reach = _color(layer, thread, np.array([0.0, 1.0]))
        # Cloth of one thread reflects all channels alike at an albedo of 0 and of 1.
        low, high = np.full(3, reach[0]), np.full(3, reach[1])
        goal = color
        if (color < low - NOTICED).any() or (color > high + NOTICED).any():
            goal, note = _nearest(name, color, low, high)
            notes.append(note)
        albedo = _albedo(layer, thread, np.clip(goal, low, high))
        threads[name] = replace(thread, albedo=albedo)
    return Dyed(fabric=replace(fabric, threads=threads), notes=tuple(notes))


def reached(fabric: Fabric, name: str, basis: str = "") -> Floats:
    """(3,) colour of cloth of the thread `name` alone, linear Rec. 709.

    basis : one of BASES but "none"; "" for that of the thread's target, or opaque
    """
    thread = fabric.threads[name]
    layer = _layer_of_one(fabric, name, thread, {})
    if basis or thread.target_basis == BASES[0]:
        thread = replace(thread, target_basis=basis or BASES[1])
    return _color(layer, thread, np.array(thread.albedo))


def cloth_color(fabric: Fabric, basis: str = BASES[1]) -> Floats:
    """(3,) colour of the cloth of all its threads, linear Rec. 709."""
    albedo = np.array([t.albedo for t in fabric.thread_list])
    return BASIS[basis](layer_of(fabric).of(albedo))


def _layer_of_one(fabric: Fabric, name: str, thread: Thread, known: dict[Thread, Layer]) -> Layer:
    """The layer of `thread` alone; `known` saves it for threads that differ in colour only."""
    if fabric.model_of(thread) != CONSERVING_MODEL:
        raise FabricError(
            f"thread {name}",
            f"has the model {fabric.model_of(thread)}, which has no albedo to solve for; it must "
            f"be {CONSERVING_MODEL}",
        )
    gray = Thread()
    key = replace(
        thread, albedo=gray.albedo, color=gray.color, documentation="",
        target_color=gray.target_color, target_basis=BASES[0], target_observer=2,
    )  # fmt: skip
    if key not in known:
        known[key] = layer_of(alone(fabric, key))
    return known[key]


def _color(layer: Layer, thread: Thread, albedo: Floats) -> Floats:
    return BASIS[thread.target_basis](layer.of(albedo[None]))


def _albedo(layer: Layer, thread: Thread, color: Floats) -> tuple[float, float, float]:
    """A per channel; the reflectance grows with it."""

    def missed(albedo: float, goal: float) -> float:
        return float(_color(layer, thread, np.array([albedo]))[0]) - goal

    found = []
    for goal in color:
        if missed(0.0, goal) >= 0:
            found.append(0.0)
        elif missed(1.0, goal) <= 0:
            found.append(1.0)
        else:
            found.append(float(brentq(missed, 0.0, 1.0, args=(float(goal),), xtol=1e-10)))
    return found[0], found[1], found[2]


def _nearest(name: str, color: Floats, low: Floats, high: Floats) -> tuple[Floats, str]:
    """(the nearest colour, the line that says so)."""
    from fabricusd.dye.difference import code, difference, nearest

    goal = nearest(color, low, high)
    less, more = bool((color < low).any()), bool((color > high).any())
    why = " and ".join(word for word, true in (("darker", less), ("lighter", more)) if true)
    return goal, (
        f"thread {name}: {code(color)} is {why} in some channel than cloth of this fibre can be; "
        f"the nearest is {code(goal)}, delta E 2000 {float(difference(goal, color)):.2g}"
    )
