"""What a triangle wears in a preview: cloth, or a matte surface that stands for anything else."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fabricusd.preview.kernels.sky import sky_light
from fabricusd.preview.lights import Lights
from fabricusd.preview.tables import Tables
from fabricusd.preview.values import look_up, value_far, value_near

REAL: Any = np.float32
Reals = NDArray[np.float32]

SKY_DIRECTIONS = 2
"""Directions of the sky for each sample at levels `weave` and `thread`."""

R4 = 1.1673039782614187 ** -np.arange(1.0, 5.0)
"""Steps of the R sequence in four dimensions [Roberts2018]: two for the sky, two for the place."""

MANY = 2.0
"""Repeats that a pixel holds each way from which on its samples are even over one of them."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What n pixels see.

    wo, wi, zenith : (3, n) - to the viewer, to the key light, and upwards, in the surface frame
    uv : (n, 2) float64 - weave coordinates [threads]
    lit, open : (n,) - share of the key light and of the sky that the rest of the shape lets through
    extent : (n, 2) - threads across the pixel; None at level `far`
    """

    wo: Reals
    wi: Reals
    zenith: Reals
    uv: NDArray[np.float64]
    lit: Reals
    open: Reals
    extent: Reals | None = None

    def of(self, some: NDArray[np.int64]) -> Seen:
        """The same of some of the pixels."""
        wo, wi, zenith = (np.ascontiguousarray(w[:, some]) for w in (self.wo, self.wi, self.zenith))
        extent = None if self.extent is None else self.extent[some]
        return Seen(wo, wi, zenith, self.uv[some], self.lit[some], self.open[some], extent)


class Surface(Protocol):
    """What can be shaded: (3, n) radiance at a level.

    numbers : (4, n) where a sample's draws begin, see R4; None at level `far`
    """

    def radiance(self, seen: Seen, lights: Lights, level: str, numbers: Any) -> Reals:
        """(3, n) radiance towards the viewer."""
        ...

    def value_far(self, wi: Reals, wo: Reals) -> Reals:
        """(3, n) value at level `far`."""
        ...

    def identity(self) -> tuple[object, ...]:
        """What its values at level `far` depend on, as `cache.kept` takes it."""
        ...


@dataclass(frozen=True, eq=False)
class Cloth:
    """Cloth over a black lining, by the tables of its front."""

    tables: Tables

    def radiance(self, seen: Seen, lights: Lights, level: str, numbers: Any) -> Reals:
        """See `Surface`."""
        # The lining holds back what would come through the cloth.
        key = lights.key * seen.lit * (seen.wi[2] > 0.0)
        if level == "far":
            value = value_far(self.tables, seen.wi, seen.wo) * key
            sky = np.zeros_like(value)
            even, slope = REAL(lights.even), REAL(lights.slope)
            sky_light(REAL, self.tables.sky, even, slope, seen.wo, seen.zenith, sky)
            return np.asarray(value + sky * seen.open, REAL)
        hit = look_up(self.tables, self._even(seen, numbers[2:]))
        value = value_near(self.tables, level, hit, seen.wi, seen.wo) * key
        for number in range(SKY_DIRECTIONS):
            u = (numbers[:2] + (number * R4[:2]).astype(REAL)[:, None]) % 1.0
            wi = _cosine_directions(u)
            f = value_near(self.tables, level, hit, wi, seen.wo)
            light = lights.even + lights.slope * (wi * seen.zenith).sum(axis=0)
            weight = light * seen.open * (math.pi / SKY_DIRECTIONS)
            value += f * (weight / np.maximum(wi[2], REAL(1e-4)))
        return np.asarray(value, REAL)

    def _even(self, seen: Seen, numbers: Reals) -> NDArray[np.float64]:
        """(n, 2) weave coordinates; of many repeats in a pixel, even over the nearest one.

        Where in which repeat a sample lies is of no account there, and where in the repeat is: even
        places leave no grain, and no moire. The picture is blurred by up to half a repeat.
        """
        cloth = self.tables.cloth
        repeat = np.lcm(cloth.grid.shape, cloth.sequence_length)
        if seen.extent is None:
            return seen.uv
        many = np.flatnonzero((seen.extent > MANY * repeat).all(axis=1))
        off = numbers[:, many].T - seen.uv[many] / repeat
        uv = seen.uv.copy()
        uv[many] += repeat * (off - np.floor(off + 0.5))
        return uv

    def value_far(self, wi: Reals, wo: Reals) -> Reals:
        """See `Surface`."""
        return value_far(self.tables, wi, wo)

    def identity(self) -> tuple[object, ...]:
        """See `Surface`: all values at level `far` are in the table of the sky."""
        return (self.tables.sky,)


@dataclass(frozen=True, eq=False)
class Matte:
    """A Lambertian surface. diffuse : (3,) linear Rec. 709."""

    diffuse: tuple[float, float, float]

    def radiance(self, seen: Seen, lights: Lights, level: str, numbers: Any) -> Reals:
        """See `Surface`. The linear part of the sky adds two thirds of its slope along N."""
        key = np.maximum(seen.wi[2], 0.0) * (lights.key / math.pi) * seen.lit
        sky = (lights.even + lights.slope * (2.0 / 3.0) * seen.zenith[2]) * seen.open
        return np.asarray(np.array(self.diffuse)[:, None] * (key + sky), REAL)

    def value_far(self, wi: Reals, wo: Reals) -> Reals:
        """See `Surface`."""
        diffuse = np.array(self.diffuse, REAL)[:, None] * REAL(1 / math.pi)
        return np.asarray(diffuse * np.maximum(wi[2], REAL(0)), REAL)

    def identity(self) -> tuple[object, ...]:
        """See `Surface`."""
        return (self.diffuse,)


def _cosine_directions(u: Reals) -> Reals:
    """(3, n) directions above the cloth, by the cosine to the normal, for u (2, n) in [0, 1)."""
    flat = np.sqrt(u[0])
    turn = REAL(2 * math.pi) * u[1]
    return np.stack((flat * np.cos(turn), flat * np.sin(turn), np.sqrt(1 - u[0]))).astype(REAL)
