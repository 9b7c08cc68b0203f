"""The kinds of light: their names in UsdLux, the lengths that define them, and their sizes.

Each kind has a module in `reference.lights.kinds` that samples the light and intersects rays with
it. Importing that package fails if a kind has no module.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple


class Size(NamedTuple):
    """The quantities on which the size of a light may depend.

    x, y, z : lengths of the axes of the light's frame; flat : area of the parallelogram of x and y
    lengths : the light's own lengths [scene unit]; angle : diameter of a distant light [rad]
    """

    x: float
    y: float
    z: float
    flat: float
    lengths: Mapping[str, float]
    angle: float


@dataclass(frozen=True, kw_only=True)
class LightKind:
    """One kind of light.

    usd : names of the light's types in USD
    lengths : the light's lengths with their defaults [scene unit]
    size : the divisor of `normalize`, for example the area in square scene units
    round : first of the axes that must be scaled equally for the light to stay round; None for flat
        lights
    """

    name: str
    usd: tuple[str, ...]
    lengths: Mapping[str, float] = field(default_factory=dict)
    size: Callable[[Size], float] = lambda s: 1.0
    round: int | None = None


def _projected(s: Size) -> float:
    """Projected solid angle of a distant light, continued beyond a hemisphere as in UsdLux."""
    sine2 = math.sin(0.5 * s.angle) ** 2
    return math.pi * (sine2 if s.angle <= math.pi else 2 - sine2) if s.angle > 0 else 1.0


KINDS = (
    LightKind(name="distant", usd=("DistantLight",), size=_projected),
    LightKind(name="dome", usd=("DomeLight", "DomeLight_1")),
    LightKind(
        name="rect", usd=("RectLight",), lengths={"width": 1.0, "height": 1.0},
        size=lambda s: s.lengths["width"] * s.lengths["height"] * s.flat,
    ),
    LightKind(
        name="disk", usd=("DiskLight",), lengths={"radius": 0.5},
        size=lambda s: math.pi * s.lengths["radius"] ** 2 * s.flat,
    ),
    LightKind(
        name="sphere", usd=("SphereLight",), lengths={"radius": 0.5}, round=0,
        size=lambda s: 4 * math.pi * (s.lengths["radius"] * (s.x + s.y + s.z) / 3) ** 2,
    ),
    LightKind(
        name="cylinder", usd=("CylinderLight",), lengths={"radius": 0.5, "length": 1.0}, round=1,
        size=lambda s: (
            2 * math.pi * s.lengths["radius"] * 0.5 * (s.y + s.z) * s.lengths["length"] * s.x
        ),
    ),
)  # fmt: skip
"""`scene.Light.kind` is an index into this."""

NUMBERS = {kind.name: number for number, kind in enumerate(KINDS)}
DISTANT, DOME, RECT, DISK, SPHERE, CYLINDER = (
    NUMBERS[name] for name in ("distant", "dome", "rect", "disk", "sphere", "cylinder")
)
