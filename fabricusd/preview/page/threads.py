"""The numbers of threads that the page has controls for, and the fabric that they make."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from fabricusd.appearance.fuzz import optical_depth
from fabricusd.appearance.scattering.models import any_conserving
from fabricusd.errors import FabricError
from fabricusd.fabric import BASES, CONSERVING_MODEL, Fabric, Thread

DEGREE = math.pi / 180.0


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number of a thread.

    channel : index into a field of several numbers; unit : of the page's; group : the heading under
    which the page folds it away, or ""; without : what is shown where the thread has 0 for "not
    stated", and is stated along with what needs it
    """

    name: str
    label: str
    field: str
    channel: int = -1
    step: float = 0.01
    scale: float = 1.0
    unit: str = ""
    group: str = ""
    without: float = 0.0

    def of(self, thread: Thread) -> float:
        """Its value, in the page's unit."""
        held: Any = thread.curve.angles if self.field == "curve" else getattr(thread, self.field)
        one = float(held[self.channel] if self.channel >= 0 else held)
        # Rounded, so that a length of 10 mm is written as 10.
        return float(f"{one / self.scale:.12g}") or self.without

    def range_of(self, thread: Thread, conserving: bool) -> tuple[float, float]:
        """Least and largest value that the page offers, the thread's own among them."""
        if self.field == "albedo":
            return 0.0, 1.0 if conserving else max(1.0, *(1.5 * a for a in thread.albedo))
        # Narrower lobes would fall between the nodes that the tables have.
        surface, volume = thread.gamma_surface / DEGREE, thread.gamma_volume / DEGREE
        ranges = {
            "ior": (1.0, 3.0), "isotropic": (0.0, 1.0), "gamma_surface": (surface, 60.0),
            "gamma_volume": (min(surface, volume), 90.0), "surface_gain": (0.0, 2.0),
            "hairiness": (0.0, 20.0), "curve": (-85.0, 85.0), "unevenness_cv": (0.0, 40.0),
            "unevenness_count": (0.0, 20.0), "unevenness_shade": (0.0, 20.0),
            "unevenness_length": (0.5, 200.0), "slub_amount": (0.0, 4.0),
            "slub_length": (1.0, 200.0), "slub_spacing": (1.0, 2000.0), "plies": (1.0, 12.0),
            "twist": (-2000.0, 2000.0),
        }  # fmt: skip
        low, high = ranges[self.field]
        own = self.of(thread)
        return min(low, own), max(high, own)


NUMBERS = (
    Number(name="red", label="Red", field="albedo", channel=0, step=0.005),
    Number(name="green", label="Green", field="albedo", channel=1, step=0.005),
    Number(name="blue", label="Blue", field="albedo", channel=2, step=0.005),
    Number(name="ior", label="Index", field="ior"),
    Number(name="isotropic", label="Isotropic", field="isotropic"),
    Number(
        name="surface", label="Surface", field="gamma_surface", step=0.25, scale=DEGREE, unit="°"
    ),
    Number(name="volume", label="Volume", field="gamma_volume", step=0.25, scale=DEGREE, unit="°"),
    Number(name="gain", label="Gain", field="surface_gain"),
    Number(name="hairiness", label="Hairiness", field="hairiness", step=0.1, unit="H"),
)
"""In the order in which the page holds them; those of the curve and of the yarn follow."""

MILLIMETRE, PERCENT = 1e-3, 0.01
_YARN = "Yarn, as the path tracer shows it"
YARN = (
    Number(name="cv", label="CVm", field="unevenness_cv", step=0.5, scale=PERCENT, unit="%",
           group=_YARN),
    Number(name="count", label="From thread to thread", field="unevenness_count", step=0.5,
           scale=PERCENT, unit="%", group=_YARN),
    Number(name="shade", label="Shade", field="unevenness_shade", step=0.5, scale=PERCENT,
           unit="%", group=_YARN),
    Number(name="length", label="Over", field="unevenness_length", step=0.5, scale=MILLIMETRE,
           unit="mm", group=_YARN, without=10.0),
    Number(name="slub", label="Slubs", field="slub_amount", step=0.05, group=_YARN),
    Number(name="slub length", label="Slub length", field="slub_length", step=1,
           scale=MILLIMETRE, unit="mm", group=_YARN, without=20.0),
    Number(name="slub spacing", label="Slub spacing", field="slub_spacing", step=1,
           scale=MILLIMETRE, unit="mm", group=_YARN, without=100.0),
    Number(name="plies", label="Plies", field="plies", step=1, group=_YARN),
    Number(name="twist", label="Twist", field="twist", step=10, unit="turns/m", group=_YARN),
)  # fmt: skip
"""What `fabric.Thread` says of uneven yarn; the page itself draws threads even."""

MOST_ANGLES = 16
"""Angles of the longest curve that the page has controls for."""

ON_PAGE = ("red", "green", "blue", "ior", "isotropic", "surface", "volume")
"""Numbers of published threads that the page itself writes into its tables."""


def shown_numbers(fabric: Fabric, thread: Thread) -> tuple[Number, ...]:
    """The numbers that a thread's model reads, the angles of its curve, and those of its yarn."""
    gain = fabric.model_of(thread) == CONSERVING_MODEL
    own = tuple(n for n in NUMBERS if gain or n.field != "surface_gain")
    angles = len(thread.curve.angles)
    curve = tuple(
        Number(name=f"angle {k}", label=f"Angle {k + 1}", field="curve", channel=k, step=0.5,
               scale=DEGREE, unit="°", group="Curve, along a run")
        for k in range(angles if angles <= MOST_ANGLES else 0)
    )  # fmt: skip
    return own + curve + YARN


def is_live(fabric: Fabric) -> bool:
    """Whether the page can follow changes by itself: its threads are published, without fuzz.

    The tables of `conserving` threads, and of fuzz, depend on the threads' numbers in ways that the
    page does not compute.
    """
    return not any_conserving(fabric) and optical_depth(fabric) == 0


def thread_controls(fabric: Fabric) -> list[dict[str, Any]]:
    """Name, values and controls of each thread."""
    live = is_live(fabric)
    found = []
    for name, thread in fabric.threads.items():
        numbers = shown_numbers(fabric, thread)
        conserving = fabric.model_of(thread) == CONSERVING_MODEL
        rows = []
        for number in numbers:
            low, high = number.range_of(thread, conserving)
            rows.append(
                {
                    "name": number.name, "label": number.label, "low": low, "high": high,
                    "step": number.step, "unit": number.unit, "group": number.group,
                    "live": live and number.name in ON_PAGE,
                }
            )  # fmt: skip
        values = [number.of(thread) for number in numbers]
        found.append({"name": name, "values": values, "controls": rows})
    return found


def with_numbers(fabric: Fabric, said: Sequence[Sequence[float]]) -> Fabric:
    """`fabric` with the numbers of `thread_controls` as the page has them.

    What a thread has already stays exactly as it is. A thread of another albedo forgets the colour
    that the albedo was solved for. Raises FabricError for numbers that are out of range.
    """
    if len(said) != len(fabric.threads):
        raise FabricError(
            "threads", f"are {len(said)} lists of numbers; there must be {len(fabric.threads)}"
        )
    threads = {}
    for (name, thread), values in zip(fabric.threads.items(), said, strict=True):
        numbers = shown_numbers(fabric, thread)
        if len(values) != len(numbers):
            raise FabricError(
                f"thread {name}", f"has {len(values)} numbers; it must have {len(numbers)}"
            )
        threads[name] = _changed(fabric, name, thread, list(zip(numbers, values, strict=True)))
    return replace(fabric, threads=threads)


def _changed(
    fabric: Fabric, name: str, thread: Thread, values: Sequence[tuple[Number, float]]
) -> Thread:
    conserving = fabric.model_of(thread) == CONSERVING_MODEL
    fields: dict[str, Any] = {}
    for number, value in values:
        if value == number.of(thread):
            continue
        low, high = number.range_of(thread, conserving)
        if not low <= value <= high:
            raise FabricError(
                f"thread {name} {number.name}",
                f"is {value:g}; it must be from {low:g} to {high:g} {number.unit}".rstrip(),
            )
        if number.field == "curve":
            curve = fields.get("curve", thread.curve)
            angles = list(curve.angles)
            angles[number.channel] = value * DEGREE
            fields["curve"] = replace(curve, angles=tuple(angles))
        elif number.channel >= 0:
            held = list(fields.get(number.field, getattr(thread, number.field)))
            held[number.channel] = value
            fields[number.field] = tuple(held)
        elif number.field == "plies":
            fields["plies"] = round(value)
        else:
            fields[number.field] = value * number.scale
    if not fields:
        return thread
    for number, value in values:
        # What is shown where nothing is stated holds as soon as something needs it.
        if number.without and value == number.of(thread) and not getattr(thread, number.field):
            needs = any(fields.get(name) for name in _NEEDS[number.field])
            if needs:
                fields[number.field] = value * number.scale
    # The albedo that is shown is the one that is kept, whatever colour it once made.
    return replace(thread, **fields, target_basis=BASES[0])


_NEEDS = {
    "unevenness_length": ("unevenness_cv", "unevenness_shade"),
    "slub_length": ("slub_amount",),
    "slub_spacing": ("slub_amount",),
}
"""The fields that make no sense without a field of YARN."""
