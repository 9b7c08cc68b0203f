"""What a texel shows of the threads: the shares of eight parts, and how the angles differ there.

A part is the threads of one set whose tangent angle falls gently, falls steeply, rises gently or
rises steeply along their axis, as in the maps `weft_share` and `warp_share` of a bake. All fields
of `Texels` but the tints are means over the texel and therefore filter linearly: coarser texels are
means of finer ones, and the coarsest is `Parts.texel`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.quadrature import curve_nodes
from fabricusd.bake.texels.angle_rows import FINE, part_of, steepness
from fabricusd.bake.texels.moment_indices import PARTS
from fabricusd.fabric import Fabric

Floats = NDArray[np.float64]

COUNT = 2 * PARTS
"""Number of parts, those of the weft first."""

SETS = np.repeat((0, 1), PARTS)
"""Thread set of each part: 0 for the weft, 1 for the warp."""

LEAST = 1e-6
"""Share of a part below which it is not there."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Texels:
    """What n texels show.

    share : (n, 8) share of the texel that each part covers; the rest is gap
    lean : (n, 2) by set: mean of the angle's difference from `Parts.angle` of its part [rad], times
        the share of the set
    spread : (n, 2) by set: mean square of that difference, times the share of the set
    tint : (n, 2, 3) by set: colour of the threads over that of the whole set, times the set's share
    """

    share: Floats
    lean: Floats
    spread: Floats
    tint: Floats

    @property
    def sets(self) -> Floats:
        """(n, 2) share of the texel that each set covers."""
        return np.asarray(self.share.reshape(-1, 2, PARTS).sum(axis=2))


@dataclass(frozen=True, kw_only=True, eq=False)
class Parts:
    """The parts of a whole cloth.

    share : (8,) share of the cloth
    angle : (8,) mean tangent angle [rad]
    spread : (2,) by set: mean square of the angle's difference from that of its part, times the
        share of the set
    """

    share: Floats
    angle: Floats
    spread: Floats

    @property
    def texel(self) -> Texels:
        """The coarsest texel, which shows the whole cloth."""
        sets = self.share.reshape(2, PARTS).sum(axis=1)
        return Texels(
            share=self.share[None], lean=np.zeros((1, 2)), spread=self.spread[None],
            tint=np.repeat(sets[None, :, None], 3, axis=2),
        )  # fmt: skip

    def at(self, thread_set: NDArray[np.int64], angle: Floats, part: NDArray[np.int64]) -> Texels:
        """Return texels that each show one point of a thread.

        thread_set : (n,) 0 or 1; angle : (n,) [rad]; part : (n,) index of its part
        """
        n = len(part)
        rows, sets = np.arange(n), thread_set
        share, lean, tint = np.zeros((n, COUNT)), np.zeros((n, 2)), np.zeros((n, 2, 3))
        share[rows, part] = 1.0
        lean[rows, sets] = angle - self.angle[part]
        tint[rows, sets] = 1.0
        return Texels(share=share, lean=lean, spread=lean**2, tint=tint)


def parts_of(fabric: Fabric) -> Parts:
    """Return the parts of a fabric."""
    nodes = curve_nodes(fabric, FINE)
    part = part_numbers(fabric, nodes.psi0, nodes.warp_start)
    share: Floats = np.bincount(part, nodes.weight, COUNT).astype(np.float64)
    angle = np.bincount(part, nodes.weight * nodes.psi0, COUNT) / np.maximum(share, LEAST)
    off = nodes.weight * (nodes.psi0 - angle[part]) ** 2
    spread = np.bincount(SETS[part], off, 2).astype(np.float64)
    return Parts(share=share, angle=angle, spread=spread)


def part_numbers(fabric: Fabric, psi0: Floats, warp_start: int) -> NDArray[np.int64]:
    """(n,) part of each tangent angle [rad]; those from `warp_start` on are of the warp."""
    split = steepness(fabric)
    weft, warp = psi0[:warp_start], psi0[warp_start:]
    return np.concatenate((part_of(weft, split[0]), PARTS + part_of(warp, split[1])))


def mean_of(texels: Texels, weight: Floats | None = None) -> Texels:
    """Return the one texel that is the mean of all, weighted by weight (n,)."""
    fields = (texels.share, texels.lean, texels.spread, texels.tint)
    share, lean, spread, tint = (np.average(x, axis=0, weights=weight)[None] for x in fields)
    return Texels(share=share, lean=lean, spread=spread, tint=tint)
