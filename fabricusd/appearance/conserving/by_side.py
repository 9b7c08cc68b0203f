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
from scipy.interpolate import PchipInterpolator

from fabricusd.appearance.weave.coverage import coverage
from fabricusd.fabric import Fabric
from fabricusd.sides import POLAR, Sides, spread

Floats = NDArray[np.float64]

CLOSING = (1.0, 0.99, 0.94, 0.78, 0.24, 0.09, 0.0)
"""Gap at POLAR over the gap seen from above; median over the presets and azimuths."""

MEDIAN = Sides(
    surface=(0.40, 0.39, 0.38, 0.39, 0.46, 0.52, 0.65),
    reflected=(0.475, 0.473, 0.472, 0.471, 0.482, 0.496, 0.512),
    transmitted=(0.209, 0.210, 0.208, 0.206, 0.180, 0.157, 0.124),
    forward=(0.612, 0.618, 0.613, 0.611, 0.623, 0.633, 0.639),
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
    zero, diagonal, quarter = spread(values).T
    terms = np.stack(
        (
            0.25 * (zero + 2.0 * diagonal + quarter),
            0.5 * (zero - quarter),
            0.25 * (zero - 2.0 * diagonal + quarter),
        ),
        axis=1,
    )
    polar = np.radians(POLAR)
    found = PchipInterpolator(polar, terms, axis=0)(np.minimum(theta, polar[-1]))
    even = found[..., 0] + found[..., 1] * np.cos(2.0 * phi) + found[..., 2] * np.cos(4.0 * phi)
    return np.asarray(np.clip(even, 0.0, 1.0))
