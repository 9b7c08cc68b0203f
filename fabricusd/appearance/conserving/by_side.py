"""What cloth does with light by side and direction, from the numbers that its fabric states.

`fabricusd.sides.Sides` says what each number means. Numbers that a fabric does not state are the
medians over the presets that have a geometry, which `tests/appearance/conserving` holds to those.
The gap has no median of its own: it closes as those of the presets do, from what it is seen from
above.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.appearance.weave.coverage import coverage
from fabricusd.fabric import Fabric
from fabricusd.sides import AZIMUTHS, POLAR, Sides, spread

Floats = NDArray[np.float64]

CLOSING = (1.0, 1.0, 0.96, 0.86, 0.63, 0.01, 0.0, 0.0, 0.0)
"""Gap at POLAR over the gap seen from above; median over the presets and azimuths."""

MEDIAN = Sides(
    surface=(0.391, 0.385, 0.381, 0.38, 0.402, 0.458, 0.573, 0.664, 1.0),
    reflected=(0.473, 0.471, 0.471, 0.47, 0.469, 0.476, 0.496, 0.51, 0.508),
    transmitted=(0.211, 0.211, 0.208, 0.206, 0.201, 0.18, 0.131, 0.078, 0.038),
    forward=(0.609, 0.613, 0.615, 0.61, 0.609, 0.621, 0.635, 0.643, 0.647),
)
"""Shares of cloth that states none; medians over the presets and azimuths."""


class BySide(NamedTuple):
    """The fields of `Sides` for some directions, all of one shape."""

    gap: Floats
    surface: Floats
    reflected: Floats
    transmitted: Floats
    forward: Floats


def by_side(fabric: Fabric, theta: Floats, phi: Floats) -> BySide:
    """The shares of `fabric` in the directions theta, phi: polar angle, azimuth from U [rad].

    Light does not pass opaque cloth; what its gaps swallow is the same from everywhere.
    """
    stated = fabric.sides
    above = coverage(fabric).gap
    if fabric.opaque:
        gap = np.full(np.shape(theta), above)
    else:
        gap = _between(stated.gap or tuple(above * c for c in CLOSING), theta, phi)
    reflected, transmitted = (
        _between(getattr(stated, name) or getattr(MEDIAN, name), theta, phi)
        for name in ("reflected", "transmitted")
    )
    # One of the two may be stated and the other not.
    most = np.maximum(1.0, reflected + transmitted)
    return BySide(
        gap=gap,
        surface=_between(stated.surface or MEDIAN.surface, theta, phi),
        reflected=reflected / most,
        transmitted=transmitted / most,
        forward=_between(stated.forward or MEDIAN.forward, theta, phi),
    )


def _between(values: tuple[float, ...], theta: Floats, phi: Floats) -> Floats:
    """Shares between those stated: monotone cubics in the polar angle, harmonics in azimuth."""
    from scipy.interpolate import PchipInterpolator

    order = 2.0 * np.arange(len(AZIMUTHS))
    harmonics = np.linalg.solve(np.cos(np.radians(AZIMUTHS)[:, None] * order), spread(values).T)
    polar = np.radians(POLAR)
    found = PchipInterpolator(polar, harmonics.T, axis=0)(np.minimum(theta, polar[-1]))
    return np.asarray(np.clip((found * np.cos(phi[..., None] * order)).sum(axis=-1), 0.0, 1.0))
