"""Directions of a gantry: inclinations from the thread's normal plane, and the azimuth between."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

DEGREE = np.pi / 180.0


def direction(theta: ArrayLike, phi: ArrayLike) -> Floats:
    """(n, 3) unit vectors in the thread frame of `appearance.frame`, from (n,) angles [rad]."""
    t, p = np.broadcast_arrays(np.asarray(theta, np.float64), np.asarray(phi, np.float64))
    cos = np.cos(t)
    return np.stack([np.sin(t), cos * np.sin(p), cos * np.cos(p)], axis=-1)


def tilted(w: Floats, angle: float) -> Floats:
    """(n, 3) directions as a thread sees them that leans by `angle` [rad] in the light's plane."""
    c, s = np.cos(angle), np.sin(angle)
    x, z = w[..., 0], w[..., 2]
    return np.stack([c * x - s * z, w[..., 1], s * x + c * z], axis=-1)


def folded(phi: ArrayLike) -> Floats:
    """Azimuths [rad] folded to [0, pi]: threads scatter alike to both sides of their plane."""
    turns = np.mod(np.asarray(phi, np.float64), 2 * np.pi)
    return np.minimum(turns, 2 * np.pi - turns)


def degrees_key(*angles: float) -> tuple[float, ...]:
    """Angles [rad] in degrees, rounded to the gantry's .01 degree, as a key of a view."""
    return tuple(round(float(a) / DEGREE, 2) + 0.0 for a in angles)


def listed(values: Any) -> str:
    """Angles [rad] in degrees, for a message: `15, 30, 45`."""
    return ", ".join(f"{v / DEGREE:.4g}" for v in values)
