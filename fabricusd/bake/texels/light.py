"""The direction to a light that a shadow map is baked for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real
from typing import Any

from fabricusd.errors import FabricError

LOWEST = 1e-3
"""Sine of a light's elevation: nearer to the horizon single precision says that none arrives."""


def unit_light(light: Sequence[float]) -> tuple[float, float, float]:
    """The direction at length 1; FabricError for one that is none, or is not over the cloth."""
    where = f"--light {','.join(map(str, light))}"
    if len(light) != 3 or not all(is_number(x) and math.isfinite(x) for x in light):
        raise FabricError(where, "is no direction; it must be three finite numbers")
    # Scaled first: the squares of great numbers are infinite, those of small ones 0.
    largest = max(abs(x) for x in light)
    x, y, z = (part / largest for part in light) if largest > 0 else (0.0, 0.0, 0.0)
    length = math.hypot(x, y, z)
    if not z > LOWEST * length:
        raise FabricError(
            where, f"does not stand over the cloth; its z must be above {LOWEST} of its length"
        )
    return x / length, y / length, z / length


def is_number(value: Any) -> bool:
    """Whether `value` is a real number that a float holds, finite or not; no truth value is."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True
