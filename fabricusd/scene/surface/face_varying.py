"""Interpolates face-varying values on Catmull-Clark surfaces by OpenSubdiv's linear rules.

The values that faces share around a point form a topology of their own, which is torn along seams.
A tear creates borders, which Embree follows smoothly, and the rule decides which points of the
topology stay fixed. This reproduces all six of OpenSubdiv's rules (`FVarLevel`), except at
semi-sharp creases: there a value on a seam follows its border from the start.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.scene.surface.embree_subdivision import INFINITE
from fabricusd.scene.surface.limit_grid import Grid, places
from fabricusd.scene.surface.subdivision import Cage, Topology, limit_of

RULES = ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all")
"""USD's `faceVaryingLinearInterpolation`; cornersPlus1 is its fallback."""


def face_varying(
    cage: Cage, grid: Grid, values: NDArray[np.float64], keys: NDArray[Any], rule: str
) -> NDArray[np.float64]:
    """(k, 2) values at the grid's points.

    values : (h, 2) float - at the faces' corners
    keys : (h,) int - equal at corners that share a value
    rule : one of RULES
    """
    if rule == "all":
        return grid.bilinear(values)
    own = cage.topology
    mixed = own.indices.astype(np.int64) * (int(keys.max()) + 1) + keys
    _, first, index = np.unique(mixed, return_index=True, return_inverse=True)
    torn = Topology(own.counts, index.reshape(-1), len(first))
    crease = np.zeros(len(torn.uses))
    crease[torn.edge] = cage.crease[own.edge]
    flat = np.zeros((len(first), 3))
    flat[:, :2] = values[first]
    point = own.indices[first]
    fixed = _fixed(cage, torn, point, crease, rule) | torn.tangled
    sharpness = np.where(fixed, INFINITE, cage.point_sharpness[point])
    surface = limit_of(flat, torn, crease, sharpness)
    return grid.evaluate(surface, places(torn, grid.size))[:, :2]


def _fixed(
    cage: Cage, torn: Topology, point: NDArray[Any], crease: NDArray[Any], rule: str
) -> NDArray[np.bool_]:
    """(w,) which values stay fixed; `point` is the cage's point to which each value belongs."""
    own = cage.topology
    seam = np.flatnonzero((torn.uses[torn.edge] == 1) & (own.uses[own.edge] > 1))
    differs = np.zeros(own.count, bool)
    differs[own.indices[seam]] = differs[own.indices[own.after[seam]]] = True
    border = own.borders_at > 0
    linear, corners = rule == "boundaries", rule != "none"
    if linear:
        differs |= border
    elif corners and not cage.sharp_corners:
        differs |= own.faces_at == 1
    number = np.bincount(point, minlength=own.count)
    hard = np.zeros(len(crease), bool)
    hard[(crease >= INFINITE) & (torn.uses > 1)] = True
    disjoint = torn.borders_at > 2
    disjoint[torn.ends[hard].ravel()] = True
    alone = torn.faces_at == 1
    every = np.full(own.count, linear) | (cage.point_sharpness >= INFINITE)
    if rule in ("cornersPlus1", "cornersPlus2"):
        every |= number > 2
        every |= (number == 2) & _any_at(point, disjoint, own.count)
    if rule == "cornersPlus2":
        every |= (number == 2) & _any_at(point, alone, own.count)
        every |= (number == 1) & ~border
    return np.asarray(differs[point] & (every[point] | disjoint | (alone & corners)))


def _any_at(point: NDArray[Any], flag: NDArray[np.bool_], count: int) -> NDArray[np.bool_]:
    return np.bincount(point[flag], minlength=count) > 0
