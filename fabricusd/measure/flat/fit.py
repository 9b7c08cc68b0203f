"""Photographs of flat cloth -> a fabric, each of its numbers with an interval and a source."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.measure.flat.card import carded, lamp_of
from fabricusd.measure.flat.lattice import Lattice
from fabricusd.measure.flat.photograph import Photograph, require_same_size
from fabricusd.measure.flat.setup import Setup, turned
from fabricusd.measure.flat.texture import Unevenness, gap_of, texture_of, unevenness_of
from fabricusd.measure.flat.tones import (
    IOR,
    PARAMETERS,
    SPREAD,
    Task,
    Toned,
    fit_faces,
    light_of,
    through_color,
)
from fabricusd.measure.flat.weave import find_weave, other_face, stated
from fabricusd.run.blas import one_blas_thread
from fabricusd.weaves import parse_weave

Floats = NDArray[np.float64]

USUAL_WIDTH = 0.1
"""Length of cloth across a picture where it is not told [m]."""
USUAL_GAP = (0.04, 0.0, 0.15)
"""Gap of cloth that was not lit from behind."""
SIGMAS = 1.96
HELD = 0.8
"""Deviation over the usual spread from which a number is one of usual cloth, not the picture's."""
MISFIT = 0.1
"""Misfit from which the light of the setup is doubted."""
CHANNELS = ("red", "green", "blue")


@dataclass(frozen=True, kw_only=True)
class Value:
    """A number of the fabric with its 95 % interval.

    source : "fitted", "spectrum", "autocorrelation", "specks", "card", "stated" or "assumed"
    """

    label: str
    value: float
    low: float
    high: float
    unit: str = ""
    source: str = "fitted"

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        interval = f"{self.low:.4g} to {self.high:.4g}"
        return f"{self.label} {self.value:.4g}{unit} ({interval}, {self.source})"


@dataclass(frozen=True, kw_only=True, eq=False)
class Flat:
    """The fabric of a photograph, and how it lay there.

    gain : of the lamp: irradiance at a distance of the camera's height, 1 being the largest code
    """

    fabric: Fabric
    setup: Setup
    lattice: Lattice
    gain: float
    values: tuple[Value, ...]
    notes: tuple[str, ...]
    front: Photograph
    behind: Photograph | None = field(default=None)

    def lines(self) -> list[str]:
        """The fit in words, a line for each number."""
        said = [f"{self.lattice.weave.name}: {self.lattice.explained:.0%} of the spectrum's peaks"]
        said += [f"  {value}" for value in self.values]
        return said + [f"  note: {note}" for note in self.notes]

    def as_json(self) -> dict[str, Any]:
        """The fit as plain numbers and texts."""
        return {
            "weave": self.lattice.weave.name,
            "gain": self.gain,
            "values": {
                v.label: {
                    "value": v.value, "low": v.low, "high": v.high, "unit": v.unit,
                    "source": v.source,
                }
                for v in self.values
            },
            "notes": list(self.notes),
        }  # fmt: skip


@one_blas_thread()
def fit_flat(
    front: Photograph,
    behind: Photograph | None,
    setup: Setup,
    *,
    weave: str | None = None,
    pitch: tuple[float, float] | None = None,
    card: Photograph | None = None,
    card_reflectance: float = 0.9,
) -> Flat:
    """The fabric that looks like flat cloth in a photograph, lit from before, and from behind.

    weave : as `new --weave` takes it; None to find it out, which takes 6 pixels a thread
    pitch : pixels from end to end and from pick to pick; None to find them out
    card : the photograph of a white card in the cloth's place, of the same light and exposure

    Raises FabricError for photographs of two sizes, a weave that is not seen, and a lamp that is
    not stated.
    """
    for other in (behind, card):
        if other is not None:
            require_same_size(front, other)
    if behind is not None and setup.back_light is None:
        raise FabricError("--back-light", f"is missing; where was the lamp of '{behind.name}'?")
    notes: tuple[str, ...] = ()
    gain = 0.0
    if card is not None:
        gain = lamp_of(card, setup, card_reflectance)
        front = carded(front, card, setup, card_reflectance, gain)
    if pitch is not None:
        if weave is None:
            raise FabricError("--weave", "is missing; --pitch is that of a weave that is named")
        lattice = stated(parse_weave(weave).weave, pitch)
    else:
        lattice, notes = find_weave(front, weave)
    gap = USUAL_GAP if behind is None else gap_of(behind)
    width = setup.width or USUAL_WIDTH
    pixel = width / front.shape[1]
    middle = setup.pairs(np.zeros((1, 3)))
    light = None if behind is None else light_of(behind, setup, lattice.turn, behind=True)
    task = Task(
        weave=lattice.weave, frequencies=lattice.frequencies, gap=gap[0],
        front=light_of(front, setup, lattice.turn), texture=texture_of(front, lattice),
        middle=(turned(middle[0], lattice.turn)[0], turned(middle[1], lattice.turn)[0]),
        behind=light, through=None if light is None else through_color(light), gain=gain,
        density=(1 / (lattice.pitch[0] * pixel), 1 / (lattice.pitch[1] * pixel)),
    )  # fmt: skip
    tasks = [task]
    if lattice.weave.warp_share != 0.5:
        tasks.append(replace(task, weave=other_face(lattice.weave)))
    best, toned = fit_faces(tasks)
    if best:
        notes += (
            f"the light says that the set that floats lies across the picture: {lattice.weave.name}"
            f" is taken as {tasks[best].weave.name}, the warp being the set that lies upright",
        )
        task, lattice = tasks[best], replace(lattice, weave=tasks[best].weave)
    uneven = unevenness_of(front, lattice)
    values = _values(task, toned, lattice, setup, gap, uneven, pixel, behind is not None)
    notes += _notes(task, toned, setup, card is not None)
    made = Flat(
        fabric=toned.fabric, setup=setup, lattice=lattice, gain=toned.gain, values=values,
        notes=notes, front=front, behind=behind,
    )  # fmt: skip
    return replace(made, fabric=_dressed(made, uneven, pixel))


def _dressed(made: Flat, uneven: tuple[Unevenness, Unevenness], pixel: float) -> Fabric:
    """The fabric with its unevenness, and with where its numbers are from."""
    threads = {}
    for (name, thread), found in zip(made.fabric.threads.items(), uneven, strict=True):
        own = [str(v) for v in made.values if v.label.startswith(name.lower())]
        shade = min(found.shade, 1.0) if found.low > 0 else 0.0
        threads[name] = replace(
            thread, unevenness_shade=shade,
            unevenness_length=found.length * pixel if shade else 0.0,
            documentation="\n".join(own),
        )  # fmt: skip
    sources = f"'{made.front.name}'" + (f" and '{made.behind.name}'" if made.behind else "")
    lines = [f"Fitted by fabricusd to {sources}:", *(line.strip() for line in made.lines())]
    return replace(made.fabric, threads=threads, documentation="\n".join(lines))


def _values(
    task: Task, toned: Toned, lattice: Lattice, setup: Setup, gap: tuple[float, float, float],
    uneven: tuple[Unevenness, Unevenness], pixel: float, lit: bool,
) -> tuple[Value, ...]:  # fmt: skip
    """Every number of the fabric, and of the lamp."""
    found = []
    source = "spectrum" if lattice.score else "stated"
    for name, pitch in zip(("warp", "weft"), lattice.pitch, strict=True):
        half = SIGMAS * lattice.deviation
        found.append(
            Value(label=f"{name} pitch", value=pitch, low=pitch * (1 - half),
                  high=pitch * (1 + half),
                  unit="pixels", source=source)
        )  # fmt: skip
        density = 0.01 / (pitch * pixel)
        found.append(
            Value(label=f"{name} density", value=density, low=density * (1 - half),
                  high=density * (1 + half), unit="per cm",
                  source=source if setup.width else "assumed")
        )  # fmt: skip
    for k, p in enumerate(PARAMETERS):
        at, half = toned.x[k] / p.scale, SIGMAS * toned.deviations[k] / p.scale
        own = toned.deviations[k] < HELD * SPREAD[k]
        found.append(
            Value(label=p.label, value=float(at), low=float(max(at - half, p.low)),
                  high=float(min(at + half, p.high)), unit=p.unit,
                  source="fitted" if own else "assumed")
        )  # fmt: skip
    for j, name in enumerate(("warp", "weft")):
        for c, channel in enumerate(CHANNELS):
            at, half = float(toned.albedo[j, c]), SIGMAS * float(toned.albedo_deviations[j, c])
            found.append(
                Value(label=f"{name} A {channel}", value=at, low=max(at - half, 0.0),
                      high=min(at + half, 1.0))
            )  # fmt: skip
        found.append(Value(label=f"{name} eta", value=IOR, low=1.46, high=1.6, source="assumed"))
        u = uneven[j]
        found.append(
            Value(label=f"{name} unevenness of shade", value=u.shade, low=u.low, high=u.high,
                  source="autocorrelation")
        )  # fmt: skip
        if u.low > 0:
            found.append(
                Value(label=f"{name} unevenness length", value=1e3 * u.length * pixel,
                      low=500 * u.length * pixel, high=2e3 * u.length * pixel, unit="mm",
                      source="autocorrelation" if setup.width else "assumed")
            )  # fmt: skip
    found.append(
        Value(label="gap", value=gap[0], low=gap[1], high=gap[2],
              source="specks" if lit else "assumed")
    )  # fmt: skip
    found.append(
        Value(label="contrast of the weave", value=task.texture.contrast,
              low=task.texture.contrast * 0.9, high=task.texture.contrast * 1.1, source="spectrum")
    )  # fmt: skip
    if task.through is not None:
        for c, channel in enumerate(CHANNELS):
            if np.isfinite(task.through[c]):
                at = math.exp(float(task.through[c]))
                found.append(
                    Value(label=f"transmitted {channel} over the mean", value=at, low=at * 0.95,
                          high=at * 1.05, source="squares")
                )  # fmt: skip
    spread = math.exp(SIGMAS * toned.gain_deviation)
    found.append(
        Value(label="lamp", value=toned.gain, low=toned.gain / spread, high=toned.gain * spread,
              source="card" if task.gain > 0 else "fitted")
    )  # fmt: skip
    return tuple(found)


def _notes(task: Task, toned: Toned, setup: Setup, carded: bool) -> tuple[str, ...]:
    """What a reader must know of this fit."""
    said = []
    if not setup.width:
        said.append(
            f"the width of the cloth in the picture is not stated: {USUAL_WIDTH * 100:g} cm is "
            "assumed, on which densities rest; see --cloth-width"
        )
    if not carded:
        said.append(
            "without a white card, A and the power of the lamp are told apart by little but the "
            "surface's light: their intervals are wide, and their product is what is known"
        )
    if toned.misfit > MISFIT:
        said.append(
            f"the light across the picture differs from that of the stated lamp by "
            f"{3 * toned.misfit:.0%} rms: is the lamp where it was said to be, and does the lens "
            "darken the corners? A card corrects both"
        )
    if task.through is not None and toned.through is not None:
        clipped = [CHANNELS[c] for c in range(3) if not np.isfinite(task.through[c])]
        if clipped:
            said.append(f"{' and '.join(clipped)} from behind is clipped, and is not used")
        off = np.abs(toned.through - task.through)
        if np.nanmax(np.append(off, 0.0)) > 0.3:
            said.append(
                "the colour of what comes through differs from the fitted cloth's by "
                f"{math.expm1(float(np.nanmax(off))):.0%}"
            )
    return tuple(said)
