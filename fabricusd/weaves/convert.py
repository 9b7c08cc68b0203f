"""From a draft to a fabric, and back."""

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
"""A spun thread that rises and falls over what it crosses, where no other is asked for."""


def albedo_scale(base: Thread) -> float:
    """What a draft's colour is multiplied by to make an albedo: the base's largest channel.

    The published albedos are a colour times a scale (MODEL section 11), which belongs to the
    fibre and not to the dye; a white thread so reflects as much as the base's brightest channel.
    """
    return max(base.albedo)


def to_fabric(
    draft: Draft, base_thread: Thread = DEFAULT_THREAD, name: str = "", density: float | None = None
) -> Fabric:
    """The fabric that `draft` weaves of threads like `base_thread`.

    Each distinct pair of palette colour and thickness is one thread, `Color3` (counted from 1,
    as WIF counts) or `Color3_2` for its second thickness; `color` is the draft's, `albedo` is
    the colour times `albedo_scale(base_thread)`. A draft without colours has the one thread
    `Thread`, the base's own. Threads of spacing 0 are left out. `density` [1/m] is used where the
    draft has no spacing; None is the default of `ThreadSet`. `losses(draft)` says what changed;
    it is part of the fabric's documentation.

    Raises FabricError where every thread of a set is hidden.
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
    """The draft that `fabric` was woven from; its palette is the distinct `color`s in use.

    A set with threads of one thickness has that, and one with several has a thickness for each
    thread of the repeat. `from_fabric(to_fabric(draft))` has the same weave, colours and sizes
    (spacing to rounding), apart from what `losses` names.
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
                "the draft has none."
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
    """The weave's name where the fabric's is none of its own, or that one spelt as a prim's."""
    spelt = re.sub(r"\W+", "_", fabric.weave.name).strip("_")
    own = fabric.name != "Fabric" and fabric.name.strip("_") != spelt
    return fabric.name if own else fabric.weave.name


def losses(draft: Draft, density: float | None = None) -> tuple[str, ...]:
    """One sentence for each thing in `draft` that a fabric cannot carry or has to assume.

    `density` as in `to_fabric`.
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
                f"{max(shown) * 1e3:.4g} mm; the fabric has its mean."
            )
        if side.spacing is None and not shown:
            assumed.append(f"{per_cm:g} {'ends' if side.label == 'warp' else 'picks'}/cm")
    if assumed:
        found.append(f"The draft has no density; {' and '.join(assumed)} are assumed.")
    return tuple(found)


def _visible(draft: Draft) -> tuple[Side, Side, np.ndarray]:
    """Both sides and the cells without the threads of spacing 0."""
    cells = draft.weave.cells
    sides = []
    for axis, side in enumerate((draft.warp, draft.weft)):
        if 0.0 not in side.spacings:
            sides.append(side)
            continue
        # Colours may repeat with another length than the weave: the cut needs both written out.
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
    """(palette index, thickness) of each thread, as long as the shortest sequence that holds it.

    The index is -1 where the draft has no colours.
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
            r, g, b = draft.palette[index]
            thread = replace(thread, color=(r, g, b), albedo=(r * scale, g * scale, b * scale))
        threads[name] = thread
    return threads


def _thread_set(sequence: tuple[int, ...], side: Side, density: float | None) -> ThreadSet:
    # Each spacing is the width that one thread takes, so their mean is the pitch.
    spacing = float(np.mean(side.spacings)) if side.spacings else side.spacing
    if spacing is not None:
        return ThreadSet(sequence=sequence, density=1.0 / spacing)
    return ThreadSet(sequence=sequence, **({} if density is None else {"density": density}))
