"""Tabulate the shape of the distribution of tangent angles about their mean, for re-lighting.

A texel stores the mean and the standard deviation of each part of a set's angles. Radiance depends
on the shape of the distribution as well. A uniform distribution would be wrong: a satin's float is
flat over most of its length and steep at its ends. The loader has the fabric, so it uses the shape
that the part has in the fabric.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.coverage import WARP
from fabricusd.appearance.weave.quadrature import curve_nodes
from fabricusd.bake.texels.angle_rows import FINE, part_of, steepness
from fabricusd.bake.texels.moment_indices import PARTS
from fabricusd.fabric import Fabric

Floats = NDArray[np.float64]

COUNTS = (1, 4, 16, 64)
"""Numbers of angles that can represent a distribution; wider ones, relative to the lobe, need more.
"""


@lru_cache(maxsize=16)
def angle_shapes(fabric: Fabric) -> Floats:
    """(2, PARTS + 1, len(COUNTS), COUNTS[-1]) angles by set, part and count.

    The last part is the whole set. The angles of a part have mean 0 and standard deviation 1, and
    each represents the same share. The array is cached and read-only.
    """
    nodes, split = curve_nodes(fabric, FINE), steepness(fabric)
    found = np.zeros((2, PARTS + 1, len(COUNTS), COUNTS[-1]))
    for which in range(2):
        mine = slice(nodes.warp_start, None) if which == WARP else slice(0, nodes.warp_start)
        angle, weight = nodes.psi0[mine], nodes.weight[mine]
        part = part_of(angle, split[which])
        for k in range(PARTS + 1):
            inside = part == k if k < PARTS else np.ones(len(part), bool)
            for row, count in enumerate(COUNTS):
                shape = _standing_for(angle[inside], weight[inside], count)
                found[which, k, row, :count] = shape
    found.setflags(write=False)
    return found


def _standing_for(angle: Floats, weight: Floats, count: int) -> Floats:
    """(count,) means of equal shares of a distribution, normalised to mean 0 and deviation 1."""
    total = float(weight.sum())
    mean = float(weight @ angle) / total if total > 0 else 0.0
    spread = math.sqrt(max(float(weight @ (angle - mean) ** 2) / total, 0.0)) if total > 0 else 0.0
    if spread < 1e-6:
        return math.sqrt(3.0) * ((2 * np.arange(count) + 1) / count - 1.0)
    order = np.argsort(angle)
    share = np.concatenate(([0.0], np.cumsum(weight[order]) / total))
    moment = np.concatenate(([0.0], np.cumsum(weight[order] * angle[order]) / total))
    ends = np.interp(np.arange(count + 1) / count, share, moment)
    return np.asarray((np.diff(ends) * count - mean) / spread)
