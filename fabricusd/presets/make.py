"""Weave a preset of its row, by the functions that `fabricusd new` is made of."""

from __future__ import annotations

import textwrap
from dataclasses import replace

import numpy as np

from fabricusd.appearance.weave.bands import band_areas
from fabricusd.appearance.weave.coverage import WARP, WEFT
from fabricusd.dye.make import made_of_colors, thread_of
from fabricusd.errors import FabricError
from fabricusd.fabric import DEGREE, Fabric, TangentCurve, Thread, ThreadSet
from fabricusd.presets.rows import Row, Yarn
from fabricusd.presets.spinning import SPINNING
from fabricusd.sides import UNSTATED, Sides
from fabricusd.weaves import parse_color, parse_weave, to_fabric, with_colors
from fabricusd.weaves.cloth import WARP_LABEL, spun_anew
from fabricusd.weaves.yarn import TEX, count_words, diameter, fibre_density, parse_count

MILLIMETRE = 1e-3

DIGITS = 4
"""Significant digits of albedos, colours, thicknesses, counts and coverages: no law sees more."""


def woven(row: Row) -> Fabric:
    """The cloth of a row, before its shares of light by side are known and before it is dyed.

    Raises FabricError for a row whose numbers are not usable.
    """
    warp, weft = (parse_color(yarn.color) for yarn in (row.warp, row.weft))
    draft = with_colors(parse_weave(row.weave), [warp], [weft])
    fabric = to_fabric(draft, thread_of(row.fibre), row.name)
    fabric = replace(
        fabric,
        warp=replace(fabric.warp, density=row.warp.density),
        weft=replace(fabric.weft, density=row.weft.density),
        documentation=_lines(
            f"Derived, not published. {row.is_named}: {draft.weave.name}. Warp {row.warp}; weft "
            f"{row.weft}. {row.source} It is {row.trade[0]:g} to {row.trade[1]:g} g/m2 in the "
            "trade."
        ),
    )

    def spun(thread: Thread, _threads: ThreadSet, label: str) -> Thread:
        return _spun(thread, row.warp if label == WARP_LABEL else row.weft, row.fibre)

    return _corded(_covered(_named(spun_anew(fabric, spun), row)), row)


def made(row: Row, sides: Sides = UNSTATED) -> Fabric:
    """The preset of a row: woven, of stated `sides`, in the colours asked for.

    Raises FabricError where a colour cannot be reached: a preset is what it says.
    """
    palette = [parse_color(yarn.color) for yarn in (row.warp, row.weft)]
    done = made_of_colors(replace(woven(row), sides=sides), palette=palette)
    if done.notes:
        raise FabricError(f"preset '{row.name}'", f"has another colour: {done.notes[0]}")
    threads = {}
    for name, thread in done.fabric.threads.items():
        threads[name] = replace(
            thread, albedo=_all_rounded(thread.albedo), color=_all_rounded(thread.color),
            target_color=_all_rounded(thread.target_color),
        )  # fmt: skip
    return replace(done.fabric, threads=threads)


def _spun(thread: Thread, yarn: Yarn, fibre: str) -> Thread:
    """The thread as a yarn of its set is spun; the width is that of Peirce's yarn, pressed flat."""
    spinning = SPINNING[yarn.spun]
    count = parse_count(yarn.count)
    round_one = diameter(count, fibre=fibre_density(fibre), packing=spinning.packing)
    positions, angles = yarn.curve
    curve = thread.curve
    if positions:
        curve = TangentCurve(positions=positions, angles=tuple(a * DEGREE for a in angles))
    return replace(
        thread,
        linear_density=_rounded(count, TEX),
        thickness=_rounded(round_one * spinning.flatness**0.5, MILLIMETRE),
        curve=curve,
        documentation=_lines(
            f"{thread.documentation} Derived: {spinning.words}, {count_words(count)}; "
            f"packing {spinning.packing:g} and width over height "
            f"{spinning.flatness:g} assumed, so that {round_one * 1e3:.3g} mm by Peirce become the "
            "thickness; unevenness usual for such yarn (Uster statistics), hairiness what "
            "finishing leaves of the usual."
        ),
        **spinning.fields(),
    )


def _named(fabric: Fabric, row: Row) -> Fabric:
    """`fabric` with threads named by what they are: the fibre, or the sets."""
    names = [row.fibre.capitalize()] if len(fabric.threads) == 1 else ["Warp", "Weft"]
    return replace(fabric, threads=dict(zip(names, fabric.thread_list, strict=True)))


def _covered(fabric: Fabric) -> Fabric:
    """`fabric` with the areas that bands as wide as its threads show; touching threads are cut."""
    cells, width = np.zeros(2), np.zeros(2)
    cells[WARP], cells[WEFT] = fabric.weave.warp_share, 1.0 - fabric.weave.warp_share
    for which, threads in ((WARP, fabric.warp), (WEFT, fabric.weft)):
        thick = fabric.thread_list[threads.sequence[0]].thickness
        width[which] = min(1.0, thick / threads.pitch)
    area = band_areas(cells, width)
    warp = _rounded(float(area[WARP]))
    weft = min(_rounded(float(area[WEFT])), 1.0 - warp)
    return replace(
        fabric,
        warp=replace(fabric.warp, coverage=warp),
        weft=replace(fabric.weft, coverage=weft),
    )


def _corded(fabric: Fabric, row: Row) -> Fabric:
    """`fabric` with the cords of its row: in both sets, the last threads of every so many."""
    cords = row.cords
    if cords is None:
        return fabric
    (name, thread), *others = fabric.threads.items()
    if others:
        raise FabricError(f"preset '{row.name}'", "has cords; its warp and weft must be alike")
    angle = cords.angle * DEGREE
    cord = replace(
        thread,
        curve=TangentCurve(angles=(-angle, angle)),
        color=parse_color(cords.color),
        documentation=_lines(f"{thread.documentation} In cords, it stands up: assumed."),
    )
    sequence = (0,) * (cords.apart - cords.wide) + (1,) * cords.wide
    return replace(
        fabric,
        threads={name: thread, "Cord": cord},
        warp=replace(fabric.warp, sequence=sequence),
        weft=replace(fabric.weft, sequence=sequence),
    )


def _rounded(value: float, unit: float = 1.0) -> float:
    return float(f"{value / unit:.{DIGITS}g}") * unit


def _all_rounded(color: tuple[float, float, float]) -> tuple[float, float, float]:
    """A colour without the digits that differ between processors."""
    r, g, b = (_rounded(x) for x in color)
    return r, g, b


def _lines(text: str) -> str:
    return textwrap.fill(text, 95)
