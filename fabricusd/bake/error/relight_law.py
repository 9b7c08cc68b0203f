"""Re-light texels of cloth whose law is not a sum over what a texel shows.

Between `conserving` threads light also goes from thread to thread, and what is visible of a thread
depends on all of them. Under a law that does not mask, each place is shadowed by all threads. Both
are the same all over the cloth, though, so for one pair of directions the law is a table by thread
and tangent angle, which is averaged over the angles that a texel holds.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fabricusd.appearance.laws import law_of
from fabricusd.appearance.scattering.columns import GAMMA_SURFACE
from fabricusd.appearance.scattering.models import any_conserving
from fabricusd.appearance.scattering.table import pack_threads
from fabricusd.appearance.shadow.mean import WIDEST
from fabricusd.appearance.weave.coverage import GAP
from fabricusd.bake.texels.angle_shape import COUNTS
from fabricusd.bake.texels.law_values import ClothLaw, cloth_law, law_values
from fabricusd.bake.texels.moment_indices import PARTS
from fabricusd.fabric import Fabric
from fabricusd.kernels.real import KERNEL

Floats = NDArray[np.float64]

STEPS = 721
"""Tangent angles from -90 to 90 degrees at which the law is tabulated."""

LEAST_ALBEDO = 1e-3
"""`A` of a thread below which a texel's own `A` no longer changes its colour."""


@lru_cache(maxsize=8)
def _laws(fabric: Fabric) -> tuple[ClothLaw, ClothLaw]:
    return (
        cloth_law(fabric, 0.0, multiple=False),
        cloth_law(fabric),
    )


def angle_table(fabric: Fabric, wi: Floats, wo: Floats) -> Floats:
    """(2, k, STEPS, 2, 3) values by set, thread type and angle: of the surface term, and the rest,
    which has the thread's colour."""
    psi0 = np.linspace(-0.5 * np.pi, 0.5 * np.pi, STEPS)
    i, o = (np.repeat(w[:, None], STEPS, axis=1) for w in (wi, wo))
    table = np.zeros((2, len(fabric.threads), STEPS, 2, 3))
    for which in range(2):
        for kind in range(len(fabric.threads)):
            black, full = (law_values(law, which, kind, psi0, i, o).T for law in _laws(fabric))
            table[which, kind, :, 0] = black
            table[which, kind, :, 1] = full - black
    return table


def relight_law(
    fabric: Fabric, shares: Floats, shapes: Any, sets: Floats, kinds: Any, wi: Floats, wo: Floats
) -> Floats:
    """(n, 3) radiance per unit `L_i dwi` of texels; the arguments are those of `relight._relight`.

    wi may lie below the cloth.
    """
    albedo = np.array([t.albedo for t in fabric.thread_list])
    gamma = pack_threads(fabric, np.float64)[:, GAMMA_SURFACE]
    if law_of(fabric).absolute:
        # The mean shadow steps from stretch to stretch.
        gamma = np.minimum(gamma, WIDEST)
    out = np.zeros((len(kinds), 3))
    _relight(angle_table(fabric, wi, wo), albedo, gamma, shares, shapes, sets, kinds, out)
    if any_conserving(fabric):
        # Light that is stopped in a gap scatters as by the whole repeat.
        stopped = law_values(_laws(fabric)[1], GAP, 0, np.zeros(1), wi[:, None], wo[:, None])[:, 0]
        out += np.clip(1.0 - sets[:, :, 3].sum(axis=1), 0.0, 1.0)[:, None] * stopped
    return out


@njit(**KERNEL)
def _relight(table, albedo, gamma, share, shapes, sets, kinds, out):  # type: ignore[no-untyped-def]
    types = table.shape[1]
    for k in range(out.shape[0]):
        for j in range(2):
            for kind in range(types):
                # If a thread lies under the texel's centre, it stands for its whole set.
                weight = share[j, kind]
                if kinds[k] >= 0 and kinds[k] // types == j:
                    weight = 1.0 if kinds[k] % types == kind else 0.0
                for part in range(PARTS):
                    covered = weight * sets[k, j, 4 + part]
                    if covered <= 0.0:
                        continue
                    mean, deviation = sets[k, j, 8 + part], sets[k, j, 12 + part]
                    shape = shapes[j, part]
                    count = _count(deviation, gamma[kind])
                    for node in range(COUNTS[count]):
                        angle = mean + deviation * shape[count, node]
                        place = (angle / np.pi + 0.5) * (STEPS - 1)
                        place = min(max(place, 0.0), STEPS - 1.0)
                        low = min(int(place), STEPS - 2)
                        for channel in range(3):
                            tint = sets[k, j, channel] / max(albedo[kind, channel], LEAST_ALBEDO)
                            for side in range(2):
                                first = table[j, kind, low, side, channel]
                                second = table[j, kind, low + 1, side, channel]
                                value = first + (place - low) * (second - first)
                                value *= covered / COUNTS[count]
                                out[k, channel] += value * (tint if side == 1 else 1.0)


@njit(**KERNEL)
def _count(deviation, gamma):  # type: ignore[no-untyped-def]
    """Number in COUNTS of the fewest angles that a deviation needs, see `relight._part_terms`."""
    fewest = 3.0 * np.sqrt(3.0) * deviation / gamma
    count = 0
    while count < len(COUNTS) - 1 and COUNTS[count] < fewest:
        count += 1
    return count
