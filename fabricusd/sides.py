"""What cloth does with light by side, as numbers that a fabric may state for the `conserving` law.

The numbers are those that tracing the cloth's tubes gives (`fabricusd.geometry.sides`). Where a
fabric states none, `appearance.conserving.by_side` takes the medians of the presets. Every number
is a share, which changes little with the scattering of the threads: it belongs to the layout.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError

POLAR = (0.0, 20.0, 40.0, 55.0, 65.0, 75.0, 82.0, 86.0, 89.0)
"""Angles to the normal at which shares are stated [degrees]; beyond the last, the last holds."""

AZIMUTHS = (0.0, 22.5, 45.0, 67.5, 90.0)
"""Azimuths at which shares are stated, from U towards V [degrees]. Cloth is taken to be the same
at the azimuths a, -a and 180 - a."""

LENGTHS = (0, 1, len(POLAR), len(POLAR) * len(AZIMUTHS))
"""How many shares a field may hold: none, one for all directions, one a polar angle, or one a
polar angle and azimuth, azimuths first."""

_SHARE = MappingProxyType(
    {"minimum": 0.0, "maximum": 1.0, "above": None, "below": None, "lengths": LENGTHS}
)


@dataclass(frozen=True, kw_only=True)
class Sides:
    """Shares of the light from a direction, at POLAR and AZIMUTHS; see LENGTHS. Empty: not stated.

    gap : of all light, what passes between the threads
    surface : of the light that the threads' surfaces reflect, what leaves at once on the side that
        it came from
    reflected, transmitted : of the light that a white thread scatters inside, what leaves at once
        on the side that it came from, and on the other
    forward : of the light that meets more than one thread, what leaves on the other side
    """

    gap: tuple[float, ...] = field(default=(), metadata=_SHARE)
    surface: tuple[float, ...] = field(default=(), metadata=_SHARE)
    reflected: tuple[float, ...] = field(default=(), metadata=_SHARE)
    transmitted: tuple[float, ...] = field(default=(), metadata=_SHARE)
    forward: tuple[float, ...] = field(default=(), metadata=_SHARE)

    def __post_init__(self) -> None:
        for f in fields(self):
            values = tuple(float(x) for x in getattr(self, f.name))
            object.__setattr__(self, f.name, values)
            if len(values) not in LENGTHS:
                raise FabricError(
                    f"sides {f.name}",
                    f"has {len(values)} shares; it must have "
                    f"{', '.join(str(n) for n in LENGTHS[:-1])} or {LENGTHS[-1]}",
                )
            bad = [x for x in values if not 0.0 <= x <= 1.0]
            if bad:
                raise FabricError(f"sides {f.name}", f"holds {bad[0]!r}; it must be from 0 to 1")
        if self.reflected and self.transmitted:
            both = spread(self.reflected) + spread(self.transmitted)
            if both.max() > 1.0 + 1e-9:
                raise FabricError(
                    "sides transmitted",
                    f"and sides reflected together are {both.max():.6g} in some direction; they "
                    "must be at most 1",
                )


UNSTATED = Sides()
"""States nothing: the gap of the bands, the medians of the presets."""


def spread(values: tuple[float, ...]) -> NDArray[np.float64]:
    """(POLAR, AZIMUTHS) shares from 1, POLAR, or POLAR times AZIMUTHS of them."""
    shape = len(POLAR), len(AZIMUTHS)
    if len(values) == shape[0] * shape[1]:
        return np.array(values).reshape(shape)
    return np.array(np.broadcast_to(np.array(values)[:, None], shape))
