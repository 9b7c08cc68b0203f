"""Points of a fabric's threads, and their radiance: what a mixture near by is fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.quadrature import curve_nodes
from fabricusd.bake.texels.angle_rows import FINE
from fabricusd.bake.texels.law_values import cloth_law, law_values
from fabricusd.fabric import Fabric
from fabricusd.materials.near.parts import COUNT, LEAST, SETS, part_numbers

Floats = NDArray[np.float64]
Numbers = NDArray[np.int64]

PER_PART = 5
"""Points of each thread type in each part, which stand for equal shares of it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Points:
    """Points of threads.

    thread_set, thread, part : (n,); angle : (n,) tangent angle [rad]
    weight : (n,) share of the cloth that the point stands for
    """

    thread_set: Numbers
    thread: Numbers
    part: Numbers
    angle: Floats
    weight: Floats


def points_of(fabric: Fabric) -> Points:
    """Return points of all parts of a fabric's threads."""
    nodes = curve_nodes(fabric, FINE)
    part = part_numbers(fabric, nodes.psi0, nodes.warp_start)
    rows = []
    for b in range(COUNT):
        for kind in np.unique(nodes.thread[part == b]):
            mine = np.flatnonzero((part == b) & (nodes.thread == kind))
            mine = mine[np.argsort(nodes.psi0[mine], kind="stable")]
            weight = nodes.weight[mine]
            total = float(weight.sum())
            if total < LEAST:
                continue
            middle = (np.cumsum(weight) - 0.5 * weight) / total
            at = np.searchsorted(middle, (np.arange(PER_PART) + 0.5) / PER_PART)
            angles = nodes.psi0[mine[np.minimum(at, len(mine) - 1)]]
            rows += [(SETS[b], kind, b, angle, total / PER_PART) for angle in angles]
    table = np.array(rows, np.float64).reshape(-1, 5)
    return Points(
        thread_set=table[:, 0].astype(np.int64), thread=table[:, 1].astype(np.int64),
        part=table[:, 2].astype(np.int64), angle=table[:, 3], weight=table[:, 4],
    )  # fmt: skip


def radiance(fabric: Fabric, points: Points, wi: Floats, wo: Floats) -> Floats:
    """(points, n, 3) radiance of level `weave` at each point for n pairs, with its mean shadow."""
    law, n = cloth_law(fabric), len(wi)
    out = np.zeros((len(points.part), n, 3))
    kinds = np.unique(np.stack((points.thread_set, points.thread)), axis=1).T
    for which, kind in kinds:
        mine = np.flatnonzero((points.thread_set == which) & (points.thread == kind))
        lights, views = (np.tile(w, (len(mine), 1)).T for w in (wi, wo))
        found = law_values(
            law, int(which), int(kind), np.repeat(points.angle[mine], n), lights, views
        )
        out[mine] = found.T.reshape(len(mine), n, 3)
    return out
