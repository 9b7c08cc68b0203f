"""Fabrics that users make: threads of a real fibre, the conserving law, the colours asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fabricusd.dye.fibres import SURFACES
from fabricusd.dye.solve import Dyed, dyed
from fabricusd.fabric import BASES, CONSERVING_MODEL, OBSERVERS, SURFACE_LAWS, Fabric, Thread
from fabricusd.weaves.color import RGB
from fabricusd.weaves.yarn import DEFAULT_FIBRE


def thread_of(fibre: str = DEFAULT_FIBRE, base: Thread | None = None) -> Thread:
    """`base`, or the default thread, with the scattering of `fibre`."""
    from fabricusd.weaves import DEFAULT_THREAD

    return replace(base or DEFAULT_THREAD, **SURFACES[fibre].fields())


def made_of_colors(
    fabric: Fabric,
    *,
    basis: str = BASES[1],
    observer: int = OBSERVERS[0],
    palette: Sequence[RGB] = (),
    raw: bool = False,
) -> Dyed:
    """`fabric` under the conserving law, with threads of such albedo that cloth has their `color`.

    basis, observer : as in `Thread`, of the colours
    palette : colours as asked for, of which `color` keeps what lies in Rec. 709
    raw : whether the colours are the albedos themselves, and nothing is solved
    """
    wanted = {(max(r, 0.0), max(g, 0.0), max(b, 0.0)): (r, g, b) for r, g, b in palette}
    threads = {}
    for name, thread in fabric.threads.items():
        if raw:
            r, g, b = (min(channel, 1.0) for channel in thread.color)
            threads[name] = replace(thread, model="", albedo=(r, g, b))
            continue
        threads[name] = replace(
            thread,
            model="",
            target_color=wanted.get(thread.color, thread.color),
            target_basis=basis,
            target_observer=observer,
        )
    made = replace(fabric, threads=threads, model=CONSERVING_MODEL, surface_law=SURFACE_LAWS[0])
    return Dyed(fabric=made, notes=()) if raw else dyed(made)
