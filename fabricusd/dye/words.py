"""Colours as people read them: asked for, reached, and mixed in the cloth."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from fabricusd.fabric import BASES, CONSERVING_MODEL, Fabric, Thread

_OF = {"opaque": "folded until opaque", "singleLayer": "one layer over black"}


def words(color: ArrayLike) -> str:
    """`#304878, Lab 31.2 5.1 -29.4`."""
    from fabricusd.dye.difference import code, lab

    lightness, a, b = lab(color)
    return f"{code(color)}, Lab {lightness:.1f} {a:.1f} {b:.1f}"


def _has_target(thread: Thread, fabric: Fabric) -> bool:
    return thread.target_basis != BASES[0] and fabric.model_of(thread) == CONSERVING_MODEL


def thread_color_lines(name: str, thread: Thread, fabric: Fabric) -> list[str]:
    """The colour asked for and the colour reached; none without a target."""
    if not _has_target(thread, fabric):
        return []
    from fabricusd.dye.difference import difference
    from fabricusd.dye.solve import reached

    found = reached(fabric, name)
    off = float(difference(found, thread.target_color))
    return [
        f"    colour: {words(thread.target_color)} asked for, of cloth of it "
        f"{_OF[thread.target_basis]}, D65, {thread.target_observer} degree observer;",
        f"    {words(found)} reached, delta E 2000 {off:.2f}",
    ]


def cloth_color_lines(fabric: Fabric) -> list[str]:
    """The colour of the whole cloth, where a colour was asked for."""
    if not any(_has_target(thread, fabric) for thread in fabric.thread_list):
        return []
    from fabricusd.dye.solve import cloth_color

    mixed = len({thread.albedo for thread in fabric.thread_list}) > 1
    opaque = cloth_color(fabric)
    return [f"  colour: {'mixed, ' * mixed}{words(opaque)} {_OF['opaque']}, D65, d/8"]


def color_dict(name: str, thread: Thread, fabric: Fabric) -> dict[str, Any] | None:
    """Target, basis, observer and the colour reached, linear Rec. 709; None without a target."""
    if not _has_target(thread, fabric):
        return None
    from fabricusd.dye.solve import reached

    return {
        "color": list(thread.target_color),
        "basis": thread.target_basis,
        "observer": thread.target_observer,
        "reached": [float(channel) for channel in reached(fabric, name)],
    }
