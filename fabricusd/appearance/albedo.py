"""How much of the light a cloth gives back, and how large `A` may be before it gives back more.

The directional albedo of a view is the integral of the far value over all directions of light. For
the published models it is `surface + A volume`, with no bound: above the safe `A` the cloth sends
out more than it receives and every bounce of light between folds grows. `conserving` cloth, where
`A` is an albedo, stays below 1 by construction. Source: `docs/model.md` section 2.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from fabricusd.appearance.law import (
    FAR,
    SurfaceLaw,
    law_density,
    law_direction,
    law_value,
    surface_law,
)
from fabricusd.appearance.real import KERNEL
from fabricusd.fabric import Fabric

Floats = NDArray[np.float64]

DIRECTIONS = 2048
"""Directions of light drawn for a view: the albedo is then within about 0.3 %."""

STEEPEST_VIEW = math.radians(89.9)

WORST_VIEWS = (
    tuple(math.radians(t) for t in (0, 30, 50, 60, 70, 75, 80, 84, 87, 89, 89.9)),
    tuple(math.radians(p) for p in range(0, 360, 30)),
)
"""Inclinations and azimuths among which the worst view is sought."""


class SafeAlbedo(NamedTuple):
    """The largest `A` of all threads for which no view gets back more light than fell on the cloth.

    albedo : float - infinite where nothing depends on `A`
    theta, phi : float - the view that bounds it: polar angle, azimuth from U [rad]
    """

    albedo: float
    theta: float
    phi: float


def directional_albedo(
    fabric: Fabric,
    thetas: ArrayLike,
    phis: ArrayLike = 0.0,
    *,
    directions: int = DIRECTIONS,
    multiple: bool = True,
) -> Floats:
    """(n, 3) share of the light that comes back towards views, level `far`, per channel.

    thetas, phis : (n,) or scalars - polar angle from N, below 90 degrees, and azimuth from U [rad]
    directions : how many directions of light each view is measured with
    multiple : whether `conserving` cloth scatters light more than once

    For `conserving` cloth light from both sides counts, without what passes straight through gaps.
    """
    theta, phi = np.broadcast_arrays(np.atleast_1d(thetas), np.atleast_1d(phis))
    law = surface_law(fabric, precision=np.float32, multiple=multiple)
    return _albedos(law, theta, phi, directions)


def safe_albedo(fabric: Fabric, directions: int = 192) -> SafeAlbedo:
    """The largest `A` that is safe on `fabric`'s weave and threads: white, worst view.

    A `conserving` thread counts with the `A` that it has, scattering once.
    """
    if all(fabric.model_of(t) == "conserving" for t in fabric.thread_list):
        return SafeAlbedo(math.inf, 0.0, 0.0)
    theta, phi = (x.ravel() for x in np.meshgrid(*WORST_VIEWS, indexing="ij"))
    # Two channels answer for every A: the value is linear in it.
    probe = replace(
        fabric,
        threads={
            k: t if fabric.model_of(t) == "conserving" else replace(t, albedo=(0.0, 1.0, 0.0))
            for k, t in fabric.threads.items()
        },
    )
    law = surface_law(probe, precision=np.float32, multiple=False)
    surface, white, _ = _albedos(law, theta, phi, directions).T
    volume = white - surface
    with np.errstate(divide="ignore", invalid="ignore"):
        safe = np.where(volume > 0, np.maximum(1.0 - surface, 0.0) / volume, math.inf)
    k = int(np.argmin(safe))
    return SafeAlbedo(float(safe[k]), float(theta[k]), float(phi[k]))


def _albedos(law: SurfaceLaw, theta: Floats, phi: Floats, directions: int) -> Floats:
    theta = np.minimum(np.asarray(theta, np.float64), STEEPEST_VIEW)
    flat = np.sin(theta)
    views = np.stack((flat * np.cos(phi), flat * np.sin(phi), np.cos(theta)))
    real: Any = np.float32
    out = np.zeros((3, views.shape[1]))
    _integrate(real, *law, np.ascontiguousarray(views, np.float32), directions, out)
    return np.ascontiguousarray(out.T)


@njit(**KERNEL, parallel=True)
def _integrate(R, kind, a, b, c, d, views, directions, out):  # type: ignore[no-untyped-def]
    for k in prange(views.shape[1]):
        _integrate_view(R, kind, a, b, c, d, views, k, directions, out)


@njit(**KERNEL)
def _integrate_view(R, kind, a, b, c, d, views, k, directions, out):  # type: ignore[no-untyped-def]
    """Mean of value/density over directions drawn by the law itself, evenly in three dimensions."""
    law = SurfaceLaw(kind, a, b, c, d)
    ox, oy, oz = views[0, k], views[1, k], views[2, k]
    red, green, blue = 0.0, 0.0, 0.0
    for m in range(directions):
        u0 = R((0.5 + m * 0.8191725133961645) % 1.0)
        u1 = R((0.5 + m * 0.6710436067037893) % 1.0)
        u2 = R((0.5 + m * 0.5497004779019703) % 1.0)
        ix, iy, iz = law_direction(R, law, FAR, 0, 0, R(0), ox, oy, oz, u0, u1, u2)
        p = law_density(R, law, FAR, 0, 0, R(0), ix, iy, iz, ox, oy, oz)
        if p > R(0):
            f = law_value(R, law, FAR, 0, 0, R(0), R(0), ix, iy, iz, ox, oy, oz)
            red += f[0] / p
            green += f[1] / p
            blue += f[2] / p
    out[0, k], out[1, k], out[2, k] = red / directions, green / directions, blue / directions
