"""Check and normalise the direction to the light that the map `shadow` is baked for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real
from typing import Any

from fabricusd.errors import FabricError

LOWEST = 1e-3
"""Smallest sine of a light's elevation: below it, single precision yields no light at all."""


def unit_light(light: Sequence[float]) -> tuple[float, float, float]:
    """Normalise a direction; raise FabricError if it is invalid or not above the cloth."""
    where = f"--light {','.join(map(str, light))}"
    if len(light) != 3 or not all(is_number(x) and math.isfinite(x) for x in light):
        raise FabricError(where, "is not a direction; it must be three finite numbers")
    # Scale first, so that squares neither overflow nor underflow.
    largest = max(abs(x) for x in light)
    x, y, z = (part / largest for part in light) if largest > 0 else (0.0, 0.0, 0.0)
    length = math.hypot(x, y, z)
    if not z > LOWEST * length:
        raise FabricError(
            where, f"is not above the cloth; its z must be above {LOWEST} times its length"
        )
    return x / length, y / length, z / length


def is_number(value: Any) -> bool:
    """Whether `value` is a real number, finite or not, that fits a float; booleans do not count."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True
