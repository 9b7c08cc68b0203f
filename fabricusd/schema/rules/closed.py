"""Whether cloth closes: gaps between threads that nobody asked for."""

from __future__ import annotations

from dataclasses import replace

from fabricusd.appearance.weave.coverage import WARP, WEFT, coverage
from fabricusd.fabric import Fabric

MOST_GAP = 0.03
"""Largest share of gap that passes without a word. Woven cloth that is not meant to be open has a
few thousandths between its threads; a hundredth shows as specks against the light."""


def unasked_gap(fabric: Fabric) -> str:
    """What is wrong with the gap of a fabric, "" if nothing is.

    A gap is asked for by a coverage; cloth that is opaque has a backing.
    """
    if fabric.opaque or fabric.warp.coverage is not None or fabric.weft.coverage is not None:
        return ""
    gap = float(coverage(fabric).gap)
    if gap <= MOST_GAP:
        return ""
    words = []
    for label, threads in (("warp", fabric.warp), ("weft", fabric.weft)):
        thin = min(fabric.thread_list[k].thickness or threads.pitch for k in threads.sequence)
        if thin < threads.pitch:
            words.append(f"{label} of {thin * 1e3:.3g} mm at a pitch of {threads.pitch * 1e3:.3g}")
    return f"is open, {100 * gap:.2g} % of it gap: {', '.join(words)}"


def opened(fabric: Fabric) -> Fabric:
    """`fabric` with the coverages that it has anyway written down, so that its gap is asked for."""
    area = coverage(fabric).area
    return replace(
        fabric,
        warp=replace(fabric.warp, coverage=float(area[WARP])),
        weft=replace(fabric.weft, coverage=float(area[WEFT])),
    )
