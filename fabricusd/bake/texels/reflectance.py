"""Tabulate what a thread in the cloth reflects and transmits by its tangent angle, for the colours.

Reflectance is the integral of level `weave` over all light directions above the cloth, for a viewer
at the normal, and transmittance the integral over those below. Their means over the repeat are
those of level `far`.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.scattering.models import translucent
from fabricusd.appearance.weave.coverage import WARP, WEFT
from fabricusd.appearance.weave.quadrature import CELLS, Rule, curve_nodes
from fabricusd.bake.texels.law_values import ClothLaw, cloth_law, law_values
from fabricusd.fabric import Fabric

Floats = NDArray[np.float64]

ANGLES = 181
"""Tangent angles from -90 to 90 degrees in steps of one degree: the narrowest published lobe is 2.5
degrees wide."""

SURFACE, VOLUME, FUZZ, THROUGH = 0, 1, 4, 5
COLUMNS = 8
"""Columns of the table: the reflectance of the surface term, which is that of black threads; what
the volume term adds, in three channels; what both gain at a grazing view; the transmittance, in
three channels."""

GRAZING = math.radians(75.0)
"""Inclination of the view at which fuzz is measured [rad]; closer to the horizon the published
models reflect hardly any light."""

_POLAR, _AZIMUTHAL, _VIEWS = 24, 48, 4


SPREAD = Rule(CELLS, math.radians(0.1))
"""Quadrature rule that finds the tangent angles of each thread."""


@lru_cache(maxsize=16)
def reflectance_table(fabric: Fabric) -> Floats:
    """(2, k, ANGLES, COLUMNS) by thread set (weft, warp), thread type and tangent angle.

    Angles that a thread does not have hold the values of its nearest one, and threads that a set
    does not show hold 0.
    """
    table = np.zeros((2, len(fabric.threads), ANGLES, COLUMNS))
    black = cloth_law(fabric, 0.0, multiple=False)
    # The published volume term is proportional to `A`. That of `conserving` cloth is not: light
    # goes from thread to thread.
    linear = black.linear
    lit = cloth_law(fabric, 1.0 if linear else None)
    for (which, kind), used in _used_angles(fabric).items():
        psi0 = np.radians(np.linspace(-90.0, 90.0, ANGLES)[used])
        surface = _scattered(black, which, kind, psi0, 0.0)[:, :1]
        both = _scattered(lit, which, kind, psi0, 0.0)
        row = np.zeros((len(psi0), COLUMNS))
        row[:, SURFACE] = surface[:, 0]
        row[:, VOLUME : VOLUME + 3] = np.maximum(both - surface, 0.0)
        gain = np.maximum(_scattered(lit, which, kind, psi0, GRAZING) - both, 0.0)
        row[:, FUZZ] = gain.mean(axis=1)
        if linear:
            albedo = np.array(fabric.thread_list[kind].albedo)
            row[:, VOLUME : VOLUME + 3] *= albedo
            row[:, FUZZ] = gain[:, 0] * min(float(albedo.mean()), 1.0)
        if translucent(fabric):
            through = _scattered(lit, which, kind, psi0, 0.0, below=True)
            row[:, THROUGH : THROUGH + 3] = through
        table[which, kind] = np.pad(row, ((used.start, ANGLES - used.stop), (0, 0)), "edge")
    return table


def _used_angles(fabric: Fabric) -> dict[tuple[int, int], slice]:
    """Indices of the angles that each set's visible threads have, by set and thread type."""
    nodes = curve_nodes(fabric, SPREAD)
    sets = np.where(np.arange(len(nodes.psi0)) < nodes.warp_start, WEFT, WARP)
    found = {}
    for which in (WEFT, WARP):
        for kind in range(len(fabric.threads)):
            mine = nodes.psi0[(sets == which) & (nodes.thread == kind) & (nodes.weight > 0)]
            if len(mine):
                low, high = (np.degrees(end) + 90.0 for end in (mine.min(), mine.max()))
                first, last = max(math.floor(low) - 1, 0), min(math.ceil(high) + 1, ANGLES - 1)
                found[which, kind] = slice(first, last + 1)
    return found


def _scattered(
    law: ClothLaw,
    thread_set: int,
    thread: int,
    psi0: Floats,
    view: float,
    *,
    below: bool = False,
) -> Floats:
    """(n, 3) share of the light of one side for a viewer `view` [rad] from the normal.

    psi0 : (n,) tangent angles [rad]

    It is averaged over azimuths of the view. The light comes from above the cloth, or from below.
    """
    x, weight = np.polynomial.legendre.leggauss(_POLAR)
    z = 0.5 * (x + 1.0)
    phi = (np.arange(_AZIMUTHAL) + 0.5) * (2.0 * math.pi / _AZIMUTHAL)
    flat = np.sqrt(1.0 - z * z)
    wi = np.stack(
        np.broadcast_arrays(
            flat[:, None] * np.cos(phi),
            flat[:, None] * np.sin(phi),
            np.repeat((-z if below else z)[:, None], len(phi), 1),
        )
    ).reshape(3, -1)
    solid = np.repeat(0.5 * weight * 2.0 * math.pi / _AZIMUTHAL, _AZIMUTHAL)
    turns, n = 1 if view == 0 else _VIEWS, wi.shape[1]
    lights = np.tile(wi, (1, len(psi0)))
    total = np.zeros((len(psi0), 3))
    for turn in range(turns):
        azimuth = 2.0 * math.pi * (turn + 0.5) / turns
        wo = np.array(
            [math.sin(view) * math.cos(azimuth), math.sin(view) * math.sin(azimuth), math.cos(view)]
        )
        viewers = np.repeat(wo[:, None], n * len(psi0), axis=1)
        found = law_values(law, thread_set, thread, np.repeat(psi0, n), lights, viewers)
        total += np.einsum("cal,l->ac", found.reshape(3, len(psi0), n), solid)
    return total / turns
