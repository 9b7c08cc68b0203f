"""What a fabric is, in a weaver's words and units, and as JSON."""

from __future__ import annotations

import math
import textwrap
from typing import Any

import numpy as np

from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage
from fabricusd.fabric import Fabric, TangentCurve, Thread, ThreadSet
from fabricusd.weaves.floats import longest_float

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
        f"  gap   {100 * float(share.gap):.3g} % of the cloth",
        f"  floats: {_floats(weave.cells)}",
        f"  seen from behind: {fabric.back.name if fabric.back else 'this weave, mirrored'}"
        + ("; opaque" if fabric.opaque else ""),
        f"  model: {fabric.model}, masking width {math.degrees(fabric.masking_width):.4g} degrees",
        "",
    ]
    for index, (name, thread) in enumerate(fabric.threads.items()):
        lines += _thread_lines(index, name, thread, width)
    return "\n".join(lines)


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


def _thread_lines(index: int, name: str, thread: Thread, width: int) -> list[str]:
    degrees = math.degrees
    thick = f"{thread.thickness * 1e3:.3g} mm" if thread.thickness else "as thick as its pitch"
    albedo = ", ".join(f"{a:.3g}" for a in thread.albedo)
    model = f", model {thread.model}" if thread.model else ""
    lines = [
        f"  {index} {name}: {thick}, albedo ({albedo}), ior {thread.ior:.4g}, "
        f"isotropic {thread.isotropic:.3g}{model}",
        f"    lobes: surface {degrees(thread.gamma_surface):.3g}, "
        f"volume {degrees(thread.gamma_volume):.3g} degrees; {curve_words(thread.curve)}",
    ]
    if thread.documentation:
        lines += textwrap.wrap(
            thread.documentation, width, initial_indent="    ", subsequent_indent="    "
        )
    return lines


def curve_words(curve: TangentCurve) -> str:
    """`straight`, or the tangent angles with a `|` at every jump."""
    if curve.is_straight:
        return "straight"
    words = []
    for k, angle in enumerate(curve.angles):
        jump = k > 0 and curve.positions[k] == curve.positions[k - 1]
        words.append(("| " if jump else "") + f"{math.degrees(angle):.4g}")
    return f"curve {' '.join(words)} degrees"


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
        "model": fabric.model,
        "opaque": fabric.opaque,
        "masking_width": math.degrees(fabric.masking_width),
        "threads": {name: _thread_dict(thread) for name, thread in fabric.threads.items()},
        "back": as_dict(fabric.back) if fabric.back else None,
    }


def _thread_dict(thread: Thread) -> dict[str, Any]:
    return {
        "albedo": list(thread.albedo),
        "ior": thread.ior,
        "isotropic": thread.isotropic,
        "gamma_surface": math.degrees(thread.gamma_surface),
        "gamma_volume": math.degrees(thread.gamma_volume),
        "surface_gain": thread.surface_gain,
        "thickness": thread.thickness,
        "model": thread.model or "inherit",
        "curve": {
            "positions": list(thread.curve.positions),
            "angles": [math.degrees(angle) for angle in thread.curve.angles],
        },
        "color": list(thread.color),
        "documentation": thread.documentation,
    }
