"""Which weave a photograph shows: the one that was named, or the best of those that are usual."""

from __future__ import annotations

import numpy as np

from fabricusd.errors import FabricError
from fabricusd.fabric import Weave
from fabricusd.measure.flat.lattice import Lattice, match, peaks, require_lattice, window_of
from fabricusd.measure.flat.photograph import Photograph
from fabricusd.weaves import parse_weave

ENOUGH = 6.0
"""Pixels a thread from which the weave itself is told."""

USUAL = (
    "plain", "twill 2/1 S", "twill 2/1 Z", "twill 2/2 S", "twill 2/2 Z", "twill 3/1 S",
    "twill 3/1 Z", "satin 5 step 2", "satin 5 step 3", "satin 8 step 3", "satin 8 step 5",
    "basket 2/2",
)  # fmt: skip
"""Weaves that are tried where none is named, the commonest first."""

CLOSE = 0.15
"""Difference of scores below which a weave is not told from another."""


def forms_of(text: str) -> tuple[str, ...]:
    """What a name leaves open: both hands of a twill, all steps of a satin."""
    words = text.lower().split()
    if words[:1] == ["twill"] and not {"s", "z"} & set(words):
        return f"{text} Z", f"{text} S"
    if words[:1] == ["satin"] and len(words) > 1 and words[1].isdigit() and "step" not in words:
        face = " weft" if "weft" in words else ""
        steps = range(2, int(words[1]) - 1)
        made = []
        for step in steps:
            form = f"satin {words[1]} step {step}{face}"
            try:
                parse_weave(form)
            except FabricError:
                continue
            made.append(form)
        return tuple(made) or (text,)
    return (text,)


def find_weave(photograph: Photograph, text: str | None) -> tuple[Lattice, tuple[str, ...]]:
    """(lattice, notes); text : a weave as `new --weave` takes it, or None to be found out.

    Raises FabricError where the photograph shows no period, and where threads are too few pixels
    wide to tell a weave that is not named.
    """
    if text is not None:
        forms = forms_of(text)
        made = [require_lattice(parse_weave(forms[0]).weave, photograph)] if len(forms) == 1 else []
        found = peaks(photograph)
        for form in forms if not made else ():
            one = match(parse_weave(form).weave, found, window_of(photograph))
            if one is not None:
                made.append(one)
        if not made:
            made = [require_lattice(parse_weave(forms[0]).weave, photograph)]
        return _best(made)
    found, window = peaks(photograph), window_of(photograph)
    fits = [match(parse_weave(form).weave, found, window) for form in USUAL]
    made = [one for one in fits if one is not None]
    if not made:
        raise FabricError(
            f"'{photograph.name}'",
            f"shows no period of a usual weave: {len(found)} peaks in its spectrum; name the weave "
            "with --weave, or photograph from nearer",
        )
    best, notes = _best(made)
    finest = min(best.pitch)
    if finest < ENOUGH:
        raise FabricError(
            f"'{photograph.name}'",
            f"has {finest:.2g} pixels a thread; to tell the weave it must have at least "
            f"{ENOUGH:g}: name the weave with --weave, or photograph from nearer",
        )
    return best, notes


def _best(made: list[Lattice]) -> tuple[Lattice, tuple[str, ...]]:
    """The lattice with the highest score, and a note where another is as good."""
    order = sorted(made, key=lambda one: -one.score)
    best = order[0]
    if len(order) > 1 and best.score - order[1].score < CLOSE:
        other = order[1].weave.name
        note = f"{other} explains the spectrum as well as {best.weave.name}: see --weave"
        return best, (note,)
    return best, ()


def other_face(weave: Weave) -> Weave:
    """The weave with the other set on top, of which a spectrum knows nothing: the light tells."""
    words = weave.name.split()
    name = f"{weave.name}, other face"
    if words[:1] == ["twill"] and len(words) > 1:
        runs = words[1].split("/")
        name = " ".join([words[0], "/".join([*runs[1:], runs[0]]), *words[2:]])
    elif words[:1] == ["satin"]:
        name = " ".join(words[:-1]) if words[-1] == "weft" else f"{weave.name} weft"
    return Weave(~weave.cells, name)


def stated(weave: Weave, pitch: tuple[float, float]) -> Lattice:
    """A lattice of pitches that are given, along the picture's axes."""
    return Lattice(
        weave=weave, frequencies=np.diag([1 / pitch[0], 1 / pitch[1]]), score=0.0, explained=0.0,
        deviation=0.0,
    )  # fmt: skip
