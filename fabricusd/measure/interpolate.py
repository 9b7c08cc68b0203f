"""Lobes between the views: by the ratio to a fitted thread, bilinearly, or by eq. 3.8.

Eq. 3.8, a mean of the n nearest views weighted by 1/(1 + d), does not interpolate: at a view it
returns a mixture, too low on narrow cones. The ratio of lobes to a fitted thread is smooth even
where the lobes are not, so between views it is what to interpolate.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import NearestNDInterpolator, RegularGridInterpolator
from scipy.spatial import cKDTree

from fabricusd.appearance.thread import split
from fabricusd.errors import FabricError
from fabricusd.fabric import Thread
from fabricusd.measure.angles import DEGREE, direction, folded, listed
from fabricusd.measure.lobes import Lobes

Floats = NDArray[np.float64]

METHODS = ("ratio", "bilinear", "thesis")
NEIGHBOURS = 4
"""Nearest views that eq. 3.8 averages; the thesis does not say how many."""


def interpolated(
    lobes: Lobes,
    theta_i: float,
    theta_o: Floats,
    phi_d: Floats,
    *,
    method: str = "ratio",
    thread: Thread | None = None,
    model: str = "microcylinder",
) -> Floats:
    """(n, 3) `f_s` [1/sr] at (n,) directions of the camera, for a measured incidence [rad].

    method : "ratio" needs a fitted `thread` and its `model`; "bilinear" interpolates the lobes;
        "thesis" is eq. 3.8, with distances in degrees

    Beyond the views the nearest ones are taken. Raises FabricError for an incidence that was not
    measured.
    """
    if method not in METHODS:
        raise FabricError("method", f"is '{method}'; it must be one of {', '.join(METHODS)}")
    near = np.abs(lobes.theta_i - theta_i) < 0.01 * DEGREE
    if not near.any():
        raise FabricError(
            "theta_i",
            f"is {theta_i / DEGREE:g} degrees; it must be one of {listed(lobes.incidences)}",
        )
    here = lobes.of(near)
    phi = folded(phi_d)
    if method == "thesis":
        return _nearest_mean(here, theta_o, phi)
    if method == "bilinear":
        return _gridded(here, here.f, theta_o, phi)
    if thread is None:
        raise FabricError("thread", "is missing; the ratio is that to a fitted thread")
    at_views = _fitted(thread, model, theta_i, here.theta_o, here.phi_d)
    # Where noise is larger than the fitted value the ratio would be noise over nothing. There it
    # tends to 1, and what is left is interpolated as a difference.
    ratio = 1.0 + (here.f - at_views) * at_views / (at_views**2 + here.sigma**2)
    rest = here.f - ratio * at_views
    between = _fitted(thread, model, theta_i, theta_o, phi)
    return _gridded(here, ratio, theta_o, phi) * between + _gridded(here, rest, theta_o, phi)


def _fitted(thread: Thread, model: str, theta_i: float, theta_o: Floats, phi: Floats) -> Floats:
    wo = direction(theta_o, phi)
    wi = np.broadcast_to(direction(theta_i, 0.0), wo.shape)
    terms = split(thread, wi, wo, model)
    albedo = np.asarray(thread.albedo, np.float64)
    return np.asarray(terms.surface[:, None] + terms.volume[:, None] * albedo)


def _gridded(lobes: Lobes, values: Floats, theta_o: Floats, phi: Floats) -> Floats:
    """(n, 3) values of views on a grid of inclination and azimuth, bilinear between them."""
    grid_o, at_o = np.unique(np.round(lobes.theta_o, 9), return_inverse=True)
    grid_p, at_p = np.unique(np.round(lobes.phi_d, 9), return_inverse=True)
    table = np.full((len(grid_o), len(grid_p), 3), np.nan)
    table[at_o, at_p] = values
    holes = np.isnan(table[..., 0])
    if holes.any():
        # Where the camera hid the light there is no view; the nearest stands in.
        known = np.argwhere(~holes)
        steps = [np.ptp(g) / max(len(g) - 1, 1) or 1.0 for g in (grid_o, grid_p)]
        scale = np.array(steps) / DEGREE
        fill = NearestNDInterpolator(known * scale, table[~holes])
        table[holes] = fill(np.argwhere(holes) * scale)
    axes: list[Any] = []
    points = []
    for grid, where in ((grid_o, theta_o), (grid_p, phi)):
        if len(grid) > 1:
            axes.append(grid)
            points.append(np.clip(where, grid[0], grid[-1]))
    if not axes:
        return np.broadcast_to(table.reshape(1, 3), (len(theta_o), 3)).copy()
    shape = (*(len(axis) for axis in axes), 3)
    found = RegularGridInterpolator(tuple(axes), table.reshape(shape))
    return np.asarray(found(np.stack(points, axis=-1)), np.float64)


def _nearest_mean(lobes: Lobes, theta_o: Floats, phi: Floats) -> Floats:
    """Eq. 3.8 with distances between unit vectors, in degrees."""
    count = min(NEIGHBOURS, len(lobes))
    distance, index = cKDTree(lobes.wo).query(direction(theta_o, phi), count)
    distance, index = distance.reshape(-1, count), index.reshape(-1, count)
    weight = 1.0 / (1.0 + distance / DEGREE)
    return np.asarray(
        (weight[..., None] * lobes.f[index]).sum(axis=1) / weight.sum(axis=1)[:, None]
    )
