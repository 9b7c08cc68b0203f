"""Skies under which a mixture is compared with the cloth that it was fitted to.

Each has the horizontal irradiance pi, so that a white diffuser is white.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fabricusd.materials.fit.judge import hemisphere

Floats = NDArray[np.float64]

DIRECTIONS = 4096
"""Of a sky, 2.2 degrees apart: a third of the width of the narrowest lobe of a preset."""


def directions() -> Floats:
    """(n, 3) directions of a sky, uniform in solid angle."""
    return hemisphere(DIRECTIONS)


def _overcast(w: Floats) -> Floats:
    """CIE's overcast sky, three times as bright overhead as at the horizon."""
    return np.asarray(1.0 + 2.0 * w[:, 2])


def _window(w: Floats) -> Floats:
    """A soft box 40 degrees wide, 50 degrees high, which gives most of the light of a dim room."""
    return np.asarray(0.08 + (_cosine(w, 50.0, 25.0) > np.cos(np.radians(20.0))))


def _clear(w: Floats) -> Floats:
    """A sky that brightens towards the horizon and the sun; haze makes the sun 10 degrees wide."""
    to_sun = _cosine(w, 35.0, 110.0)
    away = np.arccos(np.clip(to_sun, -1.0, 1.0))
    blue = 0.5 / (0.3 + w[:, 2]) * (1.0 + 4.0 * np.exp(-3.0 * away))
    return np.asarray(blue + 60.0 * (to_sun > np.cos(np.radians(5.0))))


SKIES: dict[str, Callable[[Floats], Floats]] = {
    "overcast": _overcast, "window": _window, "clear": _clear,
}  # fmt: skip


def radiance(name: str) -> Floats:
    """(n,) radiance of a sky in each of `directions`, times the solid angle of the direction."""
    w = directions()
    bright = SKIES[name](w)
    return np.asarray(np.pi * bright / (bright @ w[:, 2]))


def _cosine(w: Floats, elevation: float, azimuth: float) -> Floats:
    """(n,) cosine of the angle to a direction [degrees]."""
    e, a = np.radians((elevation, azimuth))
    return np.asarray(w @ (np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)))
