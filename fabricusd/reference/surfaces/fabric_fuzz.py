"""The fuzz of hairy threads, laid over hits on cloth that are already shaded."""

from __future__ import annotations

from numba import njit

from fabricusd.appearance.fuzz import fuzz_over
from fabricusd.kernels.real import LEAN
from fabricusd.reference.rays.wave import GO, GO_PDF, THREAD, WEIGHT, WI, WO, F


@njit(**LEAN)
def lay_fuzz(R, fuzz, is_far, types, hits, first, last):
    """Lay the fuzz over values and weights of hits that are shaded.

    Directions are drawn by the cloth beneath, whose samplers reach all of the viewer's side.
    """
    for h in range(first, last):
        row = types
        if not is_far:
            thread = int(hits[THREAD, h])
            row = -1 if thread < 0 else thread % types
        ox, oy, oz = hits[WO, h], hits[WO + 1, h], hits[WO + 2, h]
        hits[F, h], hits[F + 1, h], hits[F + 2, h] = fuzz_over(
            R, fuzz, row, hits[WI, h], hits[WI + 1, h], hits[WI + 2, h], ox, oy, oz,
            hits[F, h], hits[F + 1, h], hits[F + 2, h],
        )  # fmt: skip
        pdf = hits[GO_PDF, h]
        if pdf > R(0):
            r, g, b = fuzz_over(
                R, fuzz, row, hits[GO, h], hits[GO + 1, h], hits[GO + 2, h], ox, oy, oz,
                hits[WEIGHT, h] * pdf, hits[WEIGHT + 1, h] * pdf, hits[WEIGHT + 2, h] * pdf,
            )  # fmt: skip
            scale = R(1) / pdf
            hits[WEIGHT, h], hits[WEIGHT + 1, h] = r * scale, g * scale
            hits[WEIGHT + 2, h] = b * scale
