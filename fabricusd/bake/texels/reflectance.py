"""Tabulate the reflectance of a thread in the cloth by its tangent angle, for the colour maps.

Reflectance is the integral of level `weave` over all light directions, for a viewer at the normal.
Its mean over the repeat is the reflectance of level `far`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.published.tables import surface_tables
from fabricusd.appearance.scattering.model import CONSERVING, PUBLISHED
from fabricusd.appearance.scattering.models import model_of, names
from fabricusd.appearance.surface import points_all
from fabricusd.appearance.weave.place import Places
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric

ANGLES = 181
"""Tangent angles from -90 to 90 degrees in steps of one degree: the narrowest published lobe is 2.5
degrees wide."""

COLUMNS = 3
"""Surface term, volume term without `A`, and the gain of both at a grazing view."""

GRAZING = math.radians(75.0)
"""Inclination of the view at which fuzz is measured [rad]; closer to the horizon the published
models reflect hardly any light."""

_POLAR, _AZIMUTHAL, _VIEWS = 24, 48, 4


@lru_cache(maxsize=16)
def reflectance_table(fabric: Fabric) -> NDArray[np.float64]:
    """(2, k, ANGLES, COLUMNS) by thread set (weft, warp), thread type and tangent angle.

    Raises FabricError for the `conserving` model.
    """
    refuse_conserving(fabric)
    table = np.zeros((2, len(fabric.threads), ANGLES, COLUMNS))
    for column, tint in ((0, 0.0), (1, 1.0)):
        painted = {
            name: replace(t, albedo=(tint, tint, tint)) for name, t in fabric.threads.items()
        }
        tables = surface_tables(replace(fabric, threads=painted))
        for thread_set in range(2):
            for thread in range(len(fabric.threads)):
                above = _reflected(tables, thread_set, thread, 0.0)
                table[thread_set, thread, :, column] = above
                if column == 1:
                    grazing = _reflected(tables, thread_set, thread, GRAZING)
                    table[thread_set, thread, :, 2] = np.maximum(grazing - above, 0.0)
    # The second run, with A = 1, holds both terms; the volume term is the difference.
    table[..., 1] = np.maximum(table[..., 1] - table[..., 0], 0.0)
    brightness = np.array([np.mean(t.albedo) for t in fabric.thread_list])
    table[..., 2] *= np.minimum(brightness, 1.0)[None, :, None]
    return table


def refuse_conserving(fabric: Fabric) -> None:
    """Raise FabricError if a thread's model cannot be baked."""
    for name, thread in fabric.threads.items():
        if model_of(fabric, thread).law == CONSERVING:
            baked = " or ".join(f"'{n}'" for n in sorted(names(PUBLISHED)))
            raise FabricError(
                f"{fabric.name} {name} model",
                f"is '{fabric.model_of(thread)}', whose light travels between threads and cannot "
                f"be baked; it must be {baked}",
            )


def _reflected(tables: Any, thread_set: int, thread: int, view: float) -> NDArray[np.float64]:
    """(ANGLES,) reflectance for a viewer `view` [rad] from the normal, averaged over azimuths."""
    x, weight = np.polynomial.legendre.leggauss(_POLAR)
    z = 0.5 * (x + 1.0)
    phi = (np.arange(_AZIMUTHAL) + 0.5) * (2.0 * math.pi / _AZIMUTHAL)
    flat = np.sqrt(1.0 - z * z)
    wi = np.stack(
        np.broadcast_arrays(
            flat[:, None] * np.cos(phi),
            flat[:, None] * np.sin(phi),
            np.repeat(z[:, None], len(phi), 1),
        )
    ).reshape(3, -1)
    solid = np.repeat(0.5 * weight * 2.0 * math.pi / _AZIMUTHAL, _AZIMUTHAL)
    psi0 = np.radians(np.linspace(-90.0, 90.0, ANGLES))
    turns = 1 if view == 0 else _VIEWS
    total = np.zeros(ANGLES)
    for turn in range(turns):
        azimuth = 2.0 * math.pi * (turn + 0.5) / turns
        wo = np.array(
            [math.sin(view) * math.cos(azimuth), math.sin(view) * math.sin(azimuth), math.cos(view)]
        )
        n = wi.shape[1]
        lights = np.ascontiguousarray(np.tile(wi, (1, ANGLES)))
        out = np.empty_like(lights)
        sets = np.full(n * ANGLES, thread_set, np.uint8)
        threads = np.full(n * ANGLES, thread, np.int32)
        viewers = np.ascontiguousarray(np.repeat(wo[:, None], n * ANGLES, axis=1))
        real: Any = np.float64
        places = Places(sets, threads, np.repeat(psi0, n), np.zeros(n * ANGLES))
        points_all(real, tables, False, places, lights, viewers, out)
        total += (out[0].reshape(ANGLES, n) * solid).sum(axis=1)
    return total / turns
