"""Where light and camera of the gantry stand: the thesis's two measurements, and smaller ones."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from fabricusd.measure.angles import DEGREE, Floats

HIDDEN = 6.0
"""Degrees around the light within which the camera would hide it, and around the point opposite
within which the light would shine into the lens."""


def _grid(theta_i: object, theta_o: object, phi_d: object) -> tuple[Floats, Floats, Floats]:
    """Angles [rad] of a grid in degrees, without the views that cannot be taken."""
    i, o, p = (
        x.ravel() for x in np.meshgrid(
            *(np.atleast_1d(np.asarray(a, np.float64)) for a in (theta_i, theta_o, phi_d)),
            indexing="ij",
        )
    )  # fmt: skip
    before = (np.abs(i - o) < HIDDEN) & (p < HIDDEN)
    behind = (np.abs(i + o) < HIDDEN) & (p > 180.0 - HIDDEN)
    kept: NDArray[np.bool_] = ~(before | behind)
    return i[kept] * DEGREE, o[kept] * DEGREE, p[kept] * DEGREE


def _incidence() -> tuple[Floats, Floats, Floats]:
    """One incidence in the plane, 2 degrees apart: the 780 captures of [Bisker2011] 3.2.7."""
    return _grid(15.0, np.arange(-70, 85, 2.0), 0.0)


def _slice() -> tuple[Floats, Floats, Floats]:
    """Five incidences in the plane, 4 degrees apart."""
    return _grid([0.0, 15.0, 30.0, 45.0, 60.0], np.arange(-70, 85, 4.0), 0.0)


def _half() -> tuple[Floats, Floats, Floats]:
    """A half sphere: 8 degrees of incidence, 4 of inclination, 12 of azimuth."""
    return _grid(np.arange(0, 85, 8.0), np.arange(-70, 85, 4.0), np.arange(0, 181, 12.0))


def _coarse() -> tuple[Floats, Floats, Floats]:
    """A few views, to try the commands with: three incidences, 10 degrees apart."""
    return _grid([0.0, 20.0, 45.0], np.arange(-70, 85, 10.0), 0.0)


DESIGNS = MappingProxyType(
    {"incidence": _incidence, "slice": _slice, "half": _half, "coarse": _coarse}
)
"""Name -> function that returns theta_i, theta_o, phi_d, each (n,) [rad]."""
