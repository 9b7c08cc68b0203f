"""The weight of cloth, from the counts of its yarns, their densities and their crimp."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

from fabricusd.errors import FabricError
from fabricusd.fabric import PILE_ANGLE, Fabric, TangentCurve, Thread, ThreadSet
from fabricusd.weaves.draft import quoted
from fabricusd.weaves.yarn import diameter, linear_density

GRAM = 1e-3

OUNCE_PER_YARD = 0.028349523125 / 0.9144**2
"""1 oz/yd2 in kg/m2: 0.0339."""

LIGHTEST, HEAVIEST = GRAM, 20.0
"""Range of cloth weights that can be asked for [kg/m2]."""

FORM = "14oz, 470gsm or 470 g/m2"

_UNITS = {
    "oz": OUNCE_PER_YARD, "oz/yd2": OUNCE_PER_YARD, "oz/yd²": OUNCE_PER_YARD,
    "gsm": GRAM, "g": GRAM, "g/m2": GRAM, "g/m²": GRAM,
}  # fmt: skip

WARP_LABEL, WEFT_LABEL = "warp", "weft"


@dataclass(frozen=True, kw_only=True)
class Weight:
    """Mass per area [kg/m2] of the warp and of the weft, and their crimp.

    warp_crimp, weft_crimp : by how much a thread is longer than the cloth, as a share of the cloth
    """

    warp: float
    weft: float
    warp_crimp: float
    weft_crimp: float

    @property
    def total(self) -> float:
        """Mass per area of the cloth [kg/m2]."""
        return self.warp + self.weft

    def __str__(self) -> str:
        return (
            f"{self.total / GRAM:.3g} g/m2, {self.total / OUNCE_PER_YARD:.3g} oz/yd2 "
            f"(warp {self.warp / GRAM:.3g} g/m2, weft {self.weft / GRAM:.3g} g/m2)"
        )


def crimp(curve: TangentCurve) -> float:
    """By how much a thread with this curve is longer than its run, as a share of the run.

    The thread's length over a step dx is dx / cos(angle). Over a segment in which the angle is
    linear, the integral is the difference of atanh(sin(angle)).
    """
    length = 0.0
    points = list(zip(curve.positions, curve.angles, strict=True))
    for (x0, a0), (x1, a1) in pairwise(points):
        if abs(a1 - a0) < 1e-6:
            length += (x1 - x0) / math.cos((a0 + a1) / 2)
        else:
            length += (x1 - x0) * (math.atanh(math.sin(a1)) - math.atanh(math.sin(a0))) / (a1 - a0)
    return length / (points[-1][0] - points[0][0]) - 1.0


def yarn_of(thread: Thread, threads: ThreadSet) -> float:
    """Linear density [kg/m] of a thread in a set: its own, or that of a cotton yarn as thick.

    A thread of unknown thickness is as thick as its pitch.
    """
    return thread.linear_density or linear_density(thread.thickness or threads.pitch)


def weight(fabric: Fabric) -> Weight | None:
    """The weight of the cloth; None for pile, whose length no curve tells."""
    sums: dict[str, tuple[float, float]] = {}
    for label, threads in (("warp", fabric.warp), ("weft", fabric.weft)):
        mass = extra = 0.0
        for index in threads.sequence:
            thread = fabric.thread_list[index]
            if thread.curve.steepest > PILE_ANGLE:
                return None
            crimped = crimp(thread.curve)
            mass += yarn_of(thread, threads) * (1.0 + crimped)
            extra += crimped
        count = len(threads.sequence)
        sums[label] = (threads.density * mass / count, extra / count)
    return Weight(
        warp=sums["warp"][0],
        weft=sums["weft"][0],
        warp_crimp=sums["warp"][1],
        weft_crimp=sums["weft"][1],
    )


def parse_weight(text: str, where: str = "--weight") -> float:
    """`14oz`, `470gsm` -> kg/m2; FabricError, naming `where`, for anything else."""
    found = re.fullmatch(r"([0-9]{1,7}(?:\.[0-9]{1,7})?)\s*(\S+)", text.strip().lower())
    unit = _UNITS.get(found[2]) if found else None
    if found is None or unit is None:
        raise FabricError(where, f"is {quoted(text, 40)}; write it as in {FORM}")
    value = float(found[1]) * unit
    if not LIGHTEST <= value <= HEAVIEST:
        raise FabricError(
            where,
            f"is {quoted(text, 40)}; it must be from {LIGHTEST / GRAM:g} to {HEAVIEST / GRAM:g} "
            "g/m2",
        )
    return value


def with_weight(fabric: Fabric, wanted: float, *, keep_thickness: bool = False) -> Fabric:
    """`fabric` with yarns so much heavier or lighter that it weighs `wanted` [kg/m2].

    All counts change by one factor, and thicknesses by its root; densities stay. With
    `keep_thickness`, threads of a known thickness keep it.

    Raises FabricError for pile.
    """
    now = weight(fabric)
    if now is None:
        raise FabricError("--weight", f"cannot be met by {fabric.name}, which has a pile")
    factor = wanted / now.total

    def scaled(thread: Thread, threads: ThreadSet, _label: str) -> Thread:
        thick = (thread.thickness or threads.pitch) * math.sqrt(factor)
        return replace(
            thread,
            linear_density=yarn_of(thread, threads) * factor,
            thickness=thread.thickness if keep_thickness and thread.thickness else thick,
        )

    return spun_anew(fabric, scaled)


def with_yarns(
    fabric: Fabric,
    *,
    warp: float | None = None,
    weft: float | None = None,
    fibre: float | None = None,
    packing: float | None = None,
    thickness: float | None = None,
) -> Fabric:
    """`fabric` with yarns of the counts `warp` and `weft` [kg/m], None leaving a set's as they are.

    fibre, packing : see `yarn.diameter`, which gives the thickness
    thickness : [m]; precedes that of the count
    """
    told = {name: x for name, x in (("fibre", fibre), ("packing", packing)) if x is not None}

    def spun(thread: Thread, _threads: ThreadSet, label: str) -> Thread:
        count = warp if label == WARP_LABEL else weft
        thick, heavy = thread.thickness, thread.linear_density
        if count is not None:
            thick, heavy = diameter(count, **told), count
        return replace(
            thread, linear_density=heavy, thickness=thick if thickness is None else thickness
        )

    return spun_anew(fabric, spun)


def spun_anew(fabric: Fabric, change: Callable[[Thread, ThreadSet, str], Thread]) -> Fabric:
    """`fabric` with each thread replaced by `change(thread, its set, "warp" or "weft")`.

    A thread that becomes two becomes two threads, the second with a number after its name.
    """
    names = list(fabric.threads)
    threads: dict[str, Thread] = {}
    sets: dict[str, ThreadSet] = {}
    for label, old in ((WARP_LABEL, fabric.warp), (WEFT_LABEL, fabric.weft)):
        at: dict[int, int] = {}
        for index in dict.fromkeys(old.sequence):
            thread = change(fabric.thread_list[index], old, label)
            name, copy = names[index], 1
            while name in threads and threads[name] != thread:
                copy += 1
                name = f"{names[index]}_{copy}"
            threads[name] = thread
            at[index] = list(threads).index(name)
        sets[label] = replace(old, sequence=tuple(at[index] for index in old.sequence))
    return replace(fabric, threads=threads, warp=sets[WARP_LABEL], weft=sets[WEFT_LABEL])
