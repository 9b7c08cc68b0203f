"""Tabulate what a sample adds to the moments by thread and tangent angle, except height and light.

Each row of the table is contiguous, so the processor's vector unit adds it; computing the numbers
for each sample took twice as long.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.coverage import WARP
from fabricusd.appearance.weave.curve import height_at
from fabricusd.appearance.weave.quadrature import CELLS, Rule, curve_nodes
from fabricusd.bake.texels import moment_indices as p
from fabricusd.bake.texels import reflectance as r
from fabricusd.fabric import PILE_ANGLE, Fabric

STEPS = 721
"""Angles from -90 to 90 degrees, a quarter of a degree apart: a tenth of the narrowest lobe."""

FINE = Rule(CELLS, math.radians(0.1))
"""Quadrature rule for the distribution of tangent angles along the curves."""

HEIGHTS = 1025
"""Positions along a run at which the height is tabulated; it is linear between them."""


def steepness(fabric: Fabric) -> NDArray[np.float64]:
    """(2,) |tangent angle| [rad] that divides each set's angles into gentle and steep ones.

    The threshold minimises the variance of the angles within the two groups. The groups are then
    narrow compared with the lobes, and the distribution inside a group matters little.
    """
    nodes = curve_nodes(fabric, FINE)
    found = np.zeros(2)
    for which in range(2):
        mine = slice(0, nodes.warp_start) if which != WARP else slice(nodes.warp_start, None)
        angle, weight = np.abs(nodes.psi0[mine]), nodes.weight[mine]
        best = math.inf
        for border in np.linspace(0.0, 0.5 * math.pi, 91):
            total = 0.0
            for side in (angle <= border, angle > border):
                w = weight[side]
                if w.sum() > 0:
                    mean = (w @ angle[side]) / w.sum()
                    total += float(w @ (angle[side] - mean) ** 2)
            if total < best - 1e-12:
                best, found[which] = total, border
    return found


def part_of(psi: NDArray[np.float64], split: float) -> NDArray[np.int64]:
    """Return the part of each angle [rad]: falling gently or steeply, rising gently or steeply."""
    return 2 * (psi < 0) + (np.abs(psi) > split)


def angle_rows(fabric: Fabric) -> NDArray[np.float32]:
    """(2, k, STEPS, LIT) moments before LIT, by thread set (weft, warp), thread type and angle.

    The slope of an upright tangent, as in pile, is infinite; it is limited to that of PILE_ANGLE.
    """
    psi = np.linspace(-0.5 * math.pi, 0.5 * math.pi, STEPS)
    rows = np.zeros((2, len(fabric.threads), STEPS, p.LIT))
    slope = -np.tan(np.clip(psi, -PILE_ANGLE, PILE_ANGLE))
    split, reflected = steepness(fabric), r.reflectance_table(fabric)
    known = np.linspace(-0.5 * math.pi, 0.5 * math.pi, r.ANGLES)
    for which in range(2):
        part = p.PARTS * which + part_of(psi, split[which])
        # A thread is a cylinder: normals across it span all angles, along it the lobe's width.
        along = 1 if which == WARP else 0
        for kind, thread in enumerate(fabric.thread_list):
            row = rows[which, kind]
            row[:, p.COVER] = 1.0
            at = np.arange(STEPS)
            row[at, p.SHARE + part] = 1.0
            row[at, p.ANGLE + part] = psi
            row[at, p.ANGLE_2 + part] = psi * psi
            row[:, p.TINT + 3 * which : p.TINT + 3 * which + 3] = thread.albedo
            row[:, p.SLOPE + along] = slope
            row[:, p.SLOPE_2 + along] = slope * slope
            row[:, p.LOBE_2 + along] = min(thread.gamma_surface**2, 1.0)
            row[:, p.LOBE_2 + 1 - along] = 1.0
            table = reflected[which, kind]
            shown = np.stack([np.interp(psi, known, column) for column in table.T], axis=1)
            row[:, p.SURFACE], row[:, p.FUZZ] = shown[:, r.SURFACE], shown[:, r.FUZZ]
            row[:, p.VOLUME : p.VOLUME + 3] = shown[:, r.VOLUME : r.VOLUME + 3]
            row[:, p.THROUGH : p.THROUGH + 3] = shown[:, r.THROUGH : r.THROUGH + 3]
            row[:, p.FRESNEL] = ((thread.ior - 1.0) / (thread.ior + 1.0)) ** 2
    return rows.astype(np.float32)


def back_rows(back: Fabric) -> NDArray[np.float32]:
    """(2, k, STEPS, 4) cover and VOLUME of a cloth's back, as `angle_rows` has them."""
    rows = angle_rows(back)
    return np.ascontiguousarray(rows[..., [p.COVER, p.VOLUME, p.VOLUME + 1, p.VOLUME + 2]])


def height_rows(fabric: Fabric) -> NDArray[np.float32]:
    """(k, HEIGHTS) height of each thread type's curve at even positions, both in run lengths."""
    places = np.linspace(0.0, 1.0, HEIGHTS)
    return np.stack([height_at(t.curve, places) for t in fabric.thread_list]).astype(np.float32)
