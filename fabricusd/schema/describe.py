"""What a fabric is, in a weaver's words and units, and as JSON."""

from __future__ import annotations

import math
import textwrap
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage
from fabricusd.dye.words import cloth_color_lines, color_dict, thread_color_lines
from fabricusd.fabric import Fabric, TangentCurve, Thread, ThreadSet
from fabricusd.weaves.cloth import weight, yarn_of
from fabricusd.weaves.floats import longest_float
from fabricusd.weaves.yarn import DEFAULT_FIBRE, FIBRES, PACKING, count_words

PEIRCE = (
    f"Peirce's {DEFAULT_FIBRE} yarn ({FIBRES[DEFAULT_FIBRE] / 1000:.3g} g/cm3, packing {PACKING:g})"
)
"""The yarn that a thread of unknown count is taken for."""

INCHES_PER_METRE = 1 / 0.0254


def in_words(fabric: Fabric, width: int = 80) -> str:
    """Several lines for a terminal `width` columns wide; the draft is drawn apart."""
    share = coverage(fabric)
    area_warp, area_weft = float(share.area[WARP]), float(share.area[WEFT])
    weave = fabric.weave
    lines = [
        f"{fabric.name}: {weave.name or 'unnamed weave'}, "
        f"{weave.ends} {_plural(weave.ends, 'end')} by {weave.picks} {_plural(weave.picks, 'pick')}"
    ]
    if fabric.documentation:
        lines += textwrap.wrap(
            fabric.documentation, width, initial_indent="  ", subsequent_indent="  "
        )
    lines += [
        "",
        _set_line("warp", "end", fabric.warp, area_warp, fabric),
        _set_line("weft", "pick", fabric.weft, area_weft, fabric),
        f"  gap   {_percent(float(share.gap))} % of the cloth",
        f"  weight: {_weight(fabric)}",
        f"  floats: {_floats(weave.cells)}",
        f"  seen from behind: {fabric.back.name if fabric.back else 'this weave, mirrored'}"
        + ("; opaque" if fabric.opaque else ""),
        f"  light by side: {_stated(fabric)}",
        f"  model: {fabric.model}, surface law {fabric.surface_law}, masking width "
        f"{math.degrees(fabric.masking_width):.4g} degrees",
        *cloth_color_lines(fabric),
        "",
    ]
    for index, (name, thread) in enumerate(fabric.threads.items()):
        lines += _thread_lines(index, name, thread, fabric, width)
    return "\n".join(lines)


def _stated(fabric: Fabric) -> str:
    """Which shares of `Fabric.sides` are stated."""
    names = [f.name for f in fields(fabric.sides)]
    stated = [name for name in names if getattr(fabric.sides, name)]
    if len(stated) in (0, len(names)):
        return "stated" if stated else "the presets' median"
    return f"{', '.join(stated)} stated; otherwise the presets' median"


def _percent(share: float) -> str:
    # Rounding leaves a gap of 1e-16 where there is none.
    return f"{100 * share:.3g}" if share > 1e-9 else "0"


def _weight(fabric: Fabric) -> str:
    """The cloth's weight, its crimp, and what both rest on."""
    heavy = weight(fabric)
    if heavy is None:
        return "not known: no curve tells the length of a pile"
    words = (
        f"{heavy}; crimp of the curves {100 * heavy.warp_crimp:.3g} and "
        f"{100 * heavy.weft_crimp:.3g} %"
    )
    used = {k for threads in (fabric.warp, fabric.weft) for k in threads.sequence}
    if all(fabric.thread_list[k].linear_density for k in used):
        return words
    return f"{words}; counts in brackets are those of {PEIRCE} as thick"


def _plural(number: int, noun: str) -> str:
    return noun if number == 1 else noun + "s"


def _set_line(label: str, noun: str, threads: ThreadSet, area: float, fabric: Fabric) -> str:
    inch = threads.density / INCHES_PER_METRE
    source = "" if threads.coverage is not None else ", derived"
    return (
        f"  {label}  {threads.density / 100:.4g} {noun}s/cm ({inch:.3g}/inch), "
        f"pitch {threads.pitch * 1e3:.3g} mm, covers {100 * area:.3g} %{source}; "
        f"{_sequence(threads.sequence, list(fabric.threads))}"
    )


def _sequence(sequence: tuple[int, ...], names: list[str], longest: int = 8) -> str:
    """`4 Black, 4 White`: a colour order as weavers write it."""
    runs: list[tuple[int, int]] = []
    for index in sequence:
        if runs and runs[-1][1] == index:
            runs[-1] = (runs[-1][0] + 1, index)
        else:
            runs.append((1, index))
    if len(runs) == 1:
        return names[runs[0][1]]
    words = [f"{count} {names[index]}" for count, index in runs[:longest]]
    more = f", and {len(runs) - longest} more" if len(runs) > longest else ""
    return ", ".join(words) + more


def _floats(cells: np.ndarray[Any, np.dtype[np.bool_]]) -> str:
    words = []
    for label, axis, noun in (("warp", 1, "pick"), ("weft", 0, "end")):
        longest = longest_float(cells, axis)
        if longest is None:
            words.append(f"{label} without end")
        else:
            words.append(f"{label} over up to {longest} {_plural(longest, noun)}")
    return ", ".join(words)


def _thread_lines(index: int, name: str, thread: Thread, fabric: Fabric, width: int) -> list[str]:
    degrees = math.degrees
    thick = f"{thread.thickness * 1e3:.3g} mm" if thread.thickness else "as thick as its pitch"
    albedo = ", ".join(f"{a:.3g}" for a in thread.albedo)
    model = f", model {thread.model}" if thread.model else ""
    lines = [
        f"  {index} {name}: {thick}, albedo ({albedo}), ior {thread.ior:.4g}, "
        f"isotropic {thread.isotropic:.3g}{model}",
        f"    yarn: {_count(index, thread, fabric)}",
        f"    lobes: surface {degrees(thread.gamma_surface):.3g}, "
        f"volume {degrees(thread.gamma_volume):.3g} degrees; {curve_words(thread.curve)}",
    ]
    lines += thread_color_lines(name, thread, fabric)
    if thread.is_uneven:
        lines.append(f"    yarn: {yarn_words(thread)}")
    if thread.documentation:
        lines += textwrap.wrap(
            thread.documentation, width, initial_indent="    ", subsequent_indent="    "
        )
    return lines


def _count(index: int, thread: Thread, fabric: Fabric) -> str:
    """The thread's count, in brackets where it is derived from the thickness."""
    if thread.linear_density:
        return count_words(thread.linear_density)
    sets = [threads for threads in (fabric.warp, fabric.weft) if index in threads.sequence]
    return (
        "; ".join(dict.fromkeys(f"({count_words(yarn_of(thread, threads))})" for threads in sets))
        or "not used"
    )


def curve_words(curve: TangentCurve) -> str:
    """`straight`, or the tangent angles with a `|` at every jump."""
    if curve.is_straight:
        return "straight"
    words = []
    for k, angle in enumerate(curve.angles):
        jump = k > 0 and curve.positions[k] == curve.positions[k - 1]
        words.append(("| " if jump else "") + f"{math.degrees(angle):.4g}")
    return f"curve {' '.join(words)} degrees"


def yarn_words(thread: Thread) -> str:
    """What is uneven about a thread: `CVm 18 % over 5 mm, 3 plies Z 400/m`."""
    words = []
    if thread.unevenness_cv:
        words.append(
            f"CVm {100 * thread.unevenness_cv:.3g} % over {1e3 * thread.unevenness_length:.3g} mm"
        )
    if thread.unevenness_count:
        words.append(f"count varies by {100 * thread.unevenness_count:.3g} %")
    if thread.slub_amount:
        words.append(
            f"slubs {100 * thread.slub_amount:.3g} % wider, "
            f"{1e3 * thread.slub_length:.3g} mm long, {1e3 * thread.slub_spacing:.3g} mm apart"
        )
    if thread.unevenness_shade:
        words.append(f"shade varies by {100 * thread.unevenness_shade:.3g} %")
    if thread.shows_plies:
        way = "Z" if thread.twist > 0 else "S"
        words.append(f"{thread.plies} plies, {way} twist {abs(thread.twist):.4g} turns/m")
    if thread.hairiness:
        words.append(f"hairiness {thread.hairiness:.3g}")
    return ", ".join(words)


def as_dict(fabric: Fabric) -> dict[str, Any]:
    """Everything for JSON: metres, threads per metre, angles in degrees, rows as in the file."""
    from fabricusd.weaves.rows import from_cells

    share = coverage(fabric)
    sets = {
        name: {
            "density": threads.density,
            "coverage": threads.coverage,
            "area": float(share.area[which]),
            "threads": list(threads.sequence),
        }
        for name, threads, which in (("warp", fabric.warp, WARP), ("weft", fabric.weft, WEFT))
    }
    return {
        "name": fabric.name,
        "documentation": fabric.documentation,
        "weave": {
            "name": fabric.weave.name,
            "ends": fabric.weave.ends,
            "picks": fabric.weave.picks,
            "rows": from_cells(fabric.weave.cells),
        },
        **sets,
        "gap": float(share.gap),
        "weight": _weight_dict(fabric),
        "model": fabric.model,
        "surface_law": fabric.surface_law,
        "opaque": fabric.opaque,
        "sides": {f.name: list(getattr(fabric.sides, f.name)) for f in fields(fabric.sides)},
        "masking_width": math.degrees(fabric.masking_width),
        "unevenness_seed": fabric.unevenness_seed,
        "threads": {
            name: _thread_dict(name, thread, fabric) for name, thread in fabric.threads.items()
        },
        "back": as_dict(fabric.back) if fabric.back else None,
    }


def _weight_dict(fabric: Fabric) -> dict[str, float] | None:
    """Masses per area [kg/m2] and crimps; None for pile."""
    heavy = weight(fabric)
    return None if heavy is None else {**asdict(heavy), "total": heavy.total}


def _thread_dict(name: str, thread: Thread, fabric: Fabric) -> dict[str, Any]:
    return {
        "albedo": list(thread.albedo),
        "ior": thread.ior,
        "isotropic": thread.isotropic,
        "gamma_surface": math.degrees(thread.gamma_surface),
        "gamma_volume": math.degrees(thread.gamma_volume),
        "surface_gain": thread.surface_gain,
        "thickness": thread.thickness,
        "linear_density": thread.linear_density,
        "model": thread.model or "inherit",
        "curve": {
            "positions": list(thread.curve.positions),
            "angles": [math.degrees(angle) for angle in thread.curve.angles],
        },
        "color": list(thread.color),
        "target": color_dict(name, thread, fabric),
        "unevenness": {
            "cv": thread.unevenness_cv,
            "length": thread.unevenness_length,
            "count": thread.unevenness_count,
            "shade": thread.unevenness_shade,
        },
        "slub": {
            "amount": thread.slub_amount,
            "length": thread.slub_length,
            "spacing": thread.slub_spacing,
        },
        "plies": thread.plies,
        "twist": thread.twist,
        "hairiness": thread.hairiness,
        "documentation": thread.documentation,
    }
