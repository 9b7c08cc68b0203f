"""Measure what cloth does with light by side: the numbers of `fabricusd.sides`, from its tubes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.conserving.facets import surface_shares
from fabricusd.appearance.weave.coverage import coverage
from fabricusd.errors import FabricError
from fabricusd.fabric import Fabric
from fabricusd.geometry.cloth import tubes
from fabricusd.geometry.paths import albedo
from fabricusd.geometry.tables import conserving
from fabricusd.sides import AZIMUTHS, POLAR, Sides

Floats = NDArray[np.float64]

COUNT = 1 << 15
"""Paths a direction: standard errors are then .003."""

SHADES = (1.0, 0.0, 0.0)
"""Albedos traced: white threads, and black ones, whose light is that of their surfaces."""

DIGITS = 3
"""Decimals that are kept, which the errors allow."""


def measure_sides(fabric: Fabric, *, count: int = COUNT, seed: int = 20130402) -> Sides:
    """The numbers of `fabric`, as if its threads were `conserving`, from `count` paths a direction.

    What ends where tubes overlap counts as leaving on both sides alike. Raises FabricError for
    cloth without a geometry, and for opaque cloth, whose backing no tubes know.
    """
    if fabric.opaque:
        raise FabricError(
            f"fabric '{fabric.name}'",
            "is opaque; where its light goes can be measured for cloth without a backing only",
        )
    cloth = tubes(conserving(fabric, SHADES))
    views = _views()
    found = albedo(cloth, views, count=count, seed=seed)
    gap = found.gap.copy()
    # From above, the tubes' gap is that of the bands, but for a hair between neighbours.
    gap[views[:, 2] == 1.0] = coverage(fabric).gap
    met = np.maximum(1.0 - gap, 1e-6)
    kept = met / (found.reflected + found.transmitted)[:, 0]
    surface, once = found.reflected_once[:, 1] * kept, found.reflected_once[:, 0] * kept
    beyond, through = found.transmitted_once[:, 0] * kept, found.transmitted[:, 0] * kept
    on_surfaces = surface_shares(fabric, views)
    inside = met * (1.0 - on_surfaces)
    return Sides(
        gap=_folded(gap),
        surface=_folded(surface / np.maximum(met * on_surfaces, 1e-6)),
        reflected=_folded((once - surface) / np.maximum(inside, 1e-6)),
        transmitted=_folded(beyond / np.maximum(inside, 1e-6)),
        forward=_folded((through - beyond) / np.maximum(met - once - beyond, 1e-6)),
    )


def _views() -> Floats:
    """(POLAR 2 AZIMUTHS, 3) directions: every azimuth, and its mirror image in V."""
    turn = np.radians(np.concatenate((AZIMUTHS, np.negative(AZIMUTHS))))
    theta, phi = (x.ravel() for x in np.meshgrid(np.radians(POLAR), turn, indexing="ij"))
    return np.stack((np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), 1)


def _folded(shares: Floats) -> tuple[float, ...]:
    """Means over the mirror images, rounded, from 0 to 1."""
    mean = shares.reshape(len(POLAR), 2, len(AZIMUTHS)).mean(axis=1)
    return tuple(np.round(np.clip(mean, 0.0, 1.0), DIGITS).ravel().tolist())
