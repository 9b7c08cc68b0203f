"""Conversion of a draft to a fabric, and back."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np

from fabricusd.errors import FabricError
from fabricusd.fabric import DEGREE, Fabric, TangentCurve, Thread, ThreadSet, Weave
from fabricusd.weaves.color import RGB
from fabricusd.weaves.draft import LIMIT, Draft, Side, known_length

DEFAULT_THREAD = Thread(curve=TangentCurve(angles=(-20 * DEGREE, 20 * DEGREE)))
"""The default thread: spun, it rises and falls over the threads that it crosses."""


def albedo_scale(base: Thread) -> float:
    """The factor that turns a draft's colour into an albedo: the largest channel of the base's.

    A published albedo is a colour times a scale (MODEL section 11), and the scale belongs to the
    fibre, not to the dye: a white thread reflects as much as the base in its brightest channel.
    """
    return max(base.albedo)


def to_fabric(
    draft: Draft, base_thread: Thread = DEFAULT_THREAD, name: str = "", density: float | None = None
) -> Fabric:
    """The fabric that `draft` weaves from threads like `base_thread`.

    Each distinct pair of palette colour and thickness becomes one thread, called `Color3` (counted
    from 1, as WIF counts) or `Color3_2` for the second thickness of that colour. Its `color` is the
    draft's, its `albedo` the colour times `albedo_scale(base_thread)`. A draft without colours has
    one thread, `Thread`, which is the base. Threads of spacing 0 are left out. `density` [1/m] is
    used if the draft has no spacing; None stands for the default of `ThreadSet`. `losses(draft)`
    says what was changed, and becomes part of the fabric's documentation.

    Raises FabricError if every thread of a set is hidden.
    """
    warp, weft, cells = _visible(draft)
    if not (warp.threads and weft.threads):
        raise FabricError("spacing", "is 0 for every thread of a set; at least one must be visible")
    kinds: dict[tuple[int, float], int] = {}
    sequences = []
    for side in (warp, weft):
        sequence = [kinds.setdefault(kind, len(kinds)) for kind in _kinds(side, base_thread)]
        sequences.append(tuple(sequence))
    lines = [f"Draft: {draft.source or draft.title or draft.weave.name}."]
    lines += [f"Author: {draft.author}."] if draft.author else []
    documentation = " ".join([*lines, *losses(draft, density), draft.notes]).strip()
    return Fabric(
        name=name or "Fabric",
        threads=_threads(draft, base_thread, list(kinds)),
        weave=Weave(cells, draft.weave.name),
        warp=_thread_set(sequences[0], warp, density),
        weft=_thread_set(sequences[1], weft, density),
        documentation=documentation,
    )


def from_fabric(fabric: Fabric) -> Draft:
    """The draft that `fabric` was woven from; its palette holds the distinct `color`s in use.

    A set whose threads share one thickness has that thickness; otherwise the draft has one for each
    thread of the repeat. `from_fabric(to_fabric(draft))` has the same weave, colours and sizes
    (spacing up to rounding), apart from what `losses` names.
    """
    used: dict[RGB, int] = {}
    fields: dict[str, object] = {}
    warnings = []
    threads = fabric.thread_list
    for label, thread_set, count in (
        ("warp", fabric.warp, fabric.weave.ends),
        ("weft", fabric.weft, fabric.weave.picks),
    ):
        colors = tuple(used.setdefault(threads[k].color, len(used)) for k in thread_set.sequence)
        thick = [known_length(threads[k].thickness) or 0.0 for k in thread_set.sequence]
        fields[f"{label}_colors"] = colors
        fields[f"{label}_spacing"] = known_length(thread_set.pitch)
        if len(set(thick)) == 1:
            fields[f"{label}_thickness"] = thick[0] or None
        elif count % len(thick) == 0:
            fields[f"{label}_thicknesses"] = tuple(thick) * (count // len(thick))
        else:
            warnings.append(
                f"The {label}'s {len(thick)} thicknesses do not fit the weave's {count} threads; "
                "the draft has no thicknesses."
            )
    return Draft(
        weave=fabric.weave,
        palette=tuple(used),
        title=_title(fabric),
        notes=fabric.documentation,
        warnings=tuple(warnings),
        **fields,  # type: ignore[arg-type]
    )


def _title(fabric: Fabric) -> str:
    """The fabric's name; the weave's if the fabric has none, or the same one spelt as a prim's."""
    spelt = re.sub(r"\W+", "_", fabric.weave.name).strip("_")
    own = fabric.name != "Fabric" and fabric.name.strip("_") != spelt
    return fabric.name if own else fabric.weave.name


def losses(draft: Draft, density: float | None = None) -> tuple[str, ...]:
    """One sentence for each thing in `draft` that a fabric cannot hold or has to assume.

    density : as for `to_fabric`
    """
    found, assumed = [], []
    per_cm = (ThreadSet().density if density is None else density) / 100
    for side in (draft.warp, draft.weft):
        hidden = side.spacings.count(0.0)
        if hidden:
            found.append(f"{hidden} hidden {side.label} thread(s) of spacing 0 are left out.")
        shown = {s for s in side.spacings if s}
        if len(shown) > 1:
            found.append(
                f"The {side.label} is spaced unevenly, {min(shown) * 1e3:.4g} to "
                f"{max(shown) * 1e3:.4g} mm; the fabric has the mean spacing."
            )
        if side.spacing is None and not shown:
            assumed.append(f"{per_cm:g} {'ends' if side.label == 'warp' else 'picks'}/cm")
    if assumed:
        found.append(f"The draft has no density; {' and '.join(assumed)} are assumed.")
    return tuple(found)


def _visible(draft: Draft) -> tuple[Side, Side, np.ndarray]:
    """(warp, weft, cells), without the threads of spacing 0."""
    cells = draft.weave.cells
    sides = []
    for axis, side in enumerate((draft.warp, draft.weft)):
        if 0.0 not in side.spacings:
            sides.append(side)
            continue
        # Colours and weave may repeat after different lengths; to leave out threads, both have to
        # be written out over their common repeat.
        total = math.lcm(side.threads, len(side.colors) or 1)
        if total > LIMIT:
            raise FabricError(
                f"{side.label} colours",
                f"repeat after {len(side.colors)} and the weave after {side.threads} threads, "
                f"together after {total}; with hidden threads that must be at most {LIMIT}",
            )
        spacings = np.tile(np.array(side.spacings), total // side.threads)
        shown = np.flatnonzero(spacings)
        cells = np.take(cells, shown % side.threads, axis=axis)
        sides.append(
            side._replace(
                threads=len(shown),
                colors=tuple(side.colors[k % len(side.colors)] for k in shown if side.colors),
                spacings=tuple(float(spacings[k]) for k in shown),
                thicknesses=tuple(
                    side.thicknesses[k % side.threads] for k in shown if side.thicknesses
                ),
            )
        )
    return sides[0], sides[1], cells


def _kinds(side: Side, base: Thread) -> list[tuple[int, float]]:
    """(palette index, thickness) of each thread, over the shortest sequence that repeats.

    The index is -1 if the draft has no colours.
    """
    colors = side.colors or (-1,)
    default = side.thickness if side.thickness is not None else base.thickness
    if not side.thicknesses:
        return [(c, default) for c in colors]
    total = math.lcm(len(colors), side.threads)
    if total > LIMIT:
        raise FabricError(
            f"{side.label} colours",
            f"repeat after {len(colors)} and the thickness after {side.threads} threads, together "
            f"after {total}; that must be at most {LIMIT}",
        )
    return [
        (colors[k % len(colors)], side.thicknesses[k % side.threads] or default)
        for k in range(total)
    ]


def _threads(draft: Draft, base: Thread, kinds: list[tuple[int, float]]) -> dict[str, Thread]:
    """Name -> Thread for each (palette index, thickness), in the order of `kinds`."""
    scale = albedo_scale(base)
    threads: dict[str, Thread] = {}
    for index, thickness in kinds:
        stem = f"Color{index + 1}" if index >= 0 else "Thread"
        name, copy = stem, 1
        while name in threads:
            copy += 1
            name = f"{stem}_{copy}"
        thread = replace(base, thickness=thickness)
        if index >= 0:
            # A colour outside of Rec. 709 has numbers below 0.
            r, g, b = (max(channel, 0.0) for channel in draft.palette[index])
            thread = replace(thread, color=(r, g, b), albedo=(r * scale, g * scale, b * scale))
        threads[name] = thread
    return threads


def _thread_set(sequence: tuple[int, ...], side: Side, density: float | None) -> ThreadSet:
    # A spacing is the width that one thread takes up, so the mean spacing is the pitch.
    spacing = float(np.mean(side.spacings)) if side.spacings else side.spacing
    if spacing is not None:
        return ThreadSet(sequence=sequence, density=1.0 / spacing)
    return ThreadSet(sequence=sequence, **({} if density is None else {"density": density}))
