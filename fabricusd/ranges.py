"""The range of every number that a user can set: one table for the commands and the Python API."""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass
from typing import Any

from fabricusd.errors import FabricError, one_line


@dataclass(frozen=True, kw_only=True)
class Range:
    """Smallest and largest value of a number.

    whole : only whole numbers; above : `low` itself is excluded
    """

    low: float
    high: float
    whole: bool = False
    above: bool = False
    unit: str = ""

    def __contains__(self, value: Any) -> bool:
        kind = numbers.Integral if self.whole else numbers.Real
        if not isinstance(value, kind) or isinstance(value, bool):
            return False
        given: Any = value
        # NaN is in no range, since every comparison with it is false.
        return bool(self.low < given if self.above else self.low <= given) and bool(
            given <= self.high
        )

    def __str__(self) -> str:
        noun = "a whole number " if self.whole else ""
        low, high = (_shown(x, self.whole) for x in (self.low, self.high))
        words = f"above {low} and at most {high}" if self.above else f"from {low} to {high}"
        return f"{noun}{words} {self.unit}".rstrip()

    def require(self, where: str, value: Any) -> None:
        """Raise FabricError, naming `where`, the value and the range, if it is out of range."""
        if value not in self:
            raise FabricError(where, self.refusal(value))

    def refusal(self, value: Any) -> str:
        """The problem with a value that is out of range."""
        return f"is {one_line(_text(value), 60)}; it must be {self}"


RANGES = {
    "width": Range(low=1, high=65536, whole=True, unit="pixels"),
    "height": Range(low=1, high=65536, whole=True, unit="pixels"),
    "spp": Range(low=1, high=65536, whole=True, unit="samples a pixel"),
    "noise": Range(low=0, high=10, above=True),
    "max_bounces": Range(low=0, high=1024, whole=True),
    "max_translucent": Range(low=0, high=1024, whole=True),
    "port": Range(low=0, high=65535, whole=True),
    "view_angle": Range(low=1, high=150, unit="degrees"),
    "cloth_width": Range(low=0, high=100_000, above=True, unit="cm"),
    "card_reflectance": Range(low=0, high=1, above=True),
    "exposure": Range(low=-100, high=100, unit="stops"),
    "seed": Range(low=-(2**63), high=2**63 - 1, whole=True),
    "workers": Range(low=1, high=1024, whole=True),
    "max_error": Range(low=0, high=1000, above=True),
    "frame": Range(low=-1e9, high=1e9),
    "ends_per_cm": Range(low=0.01, high=10000, unit="ends/cm"),
    "picks_per_cm": Range(low=0.01, high=10000, unit="picks/cm"),
    "ends_per_inch": Range(low=0.0254, high=25400, unit="ends/inch"),
    "picks_per_inch": Range(low=0.0254, high=25400, unit="picks/inch"),
    "grain": Range(low=-360, high=360, unit="degrees"),
    "scale": Range(low=0, high=1e6, unit="mm"),
    "azimuth": Range(low=-360, high=360, unit="degrees"),
    "elevation": Range(low=-90, high=90, unit="degrees"),
    "size": Range(low=16, high=4096, whole=True, unit="pixels"),
    "samples": Range(low=1, high=1024, whole=True, unit="samples a pixel"),
    "orbit": Range(low=1, high=3600, whole=True, unit="pictures"),
    "dome_rotation": Range(low=-360, high=360, unit="degrees"),
    "packing": Range(low=0, high=1, above=True),
    "thickness": Range(low=0, high=1000, unit="mm"),
    "color": Range(low=0, high=1000),
    "figure_ends": Range(low=1, high=16384, whole=True, unit="ends"),
    "figure_picks": Range(low=1, high=16384, whole=True, unit="picks"),
    "longest_float": Range(low=2, high=16384, whole=True, unit="threads"),
    "difference": Range(low=0, high=1000),
    "lobes": Range(low=1, high=6, whole=True),
    "paths": Range(low=64, high=2**20, whole=True, unit="paths a direction"),
    "significance": Range(low=0, high=0.5, above=True),
}
"""Name of the setting -> its range. A number beyond it is a slip, or asks for more than a machine
has: each of the `workers` has buffers of up to 5 MB."""

MOST_PIXELS = 2**28
"""Most pixels of one picture; each takes at least 40 bytes of memory."""


def require_ranges(**settings: Any) -> None:
    """Raise FabricError for the first setting that is out of its range."""
    for name, value in settings.items():
        RANGES[name].require(name, value)


def require_picture(width: Any, height: Any) -> None:
    """Raise FabricError if a picture of that size cannot be made."""
    require_ranges(width=width, height=height)
    if width * height > MOST_PIXELS:
        problem = f"is {width} x {height} pixels; it must have at most {MOST_PIXELS} in all"
        raise FabricError("the picture", problem)


def _shown(bound: float, whole: bool) -> str:
    return str(int(bound)) if whole else f"{bound:.10g}"


def _text(value: Any) -> str:
    if isinstance(value, numbers.Integral) and not isinstance(value, bool):
        # Python refuses to print integers of more than some thousand digits.
        return str(value) if abs(int(value)) < 10**30 else "a number of more than 30 digits"
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        return f"{float(value):g}" if math.isfinite(value) else str(float(value))
    return repr(value)
