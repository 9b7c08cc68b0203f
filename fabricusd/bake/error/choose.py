"""The cheapest bake that meets a bound: fewest bytes over resolutions and choices of maps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fabricusd.bake.error.accuracy import swatch_errors
from fabricusd.bake.error.relight import NEEDED, RELIT
from fabricusd.bake.texels.maps import REGISTRY, TextureMap, chosen_maps
from fabricusd.bake.texels.sheet import Sheet

COARSEST = 64
"""Texels a side that a search begins with."""


@dataclass(frozen=True, kw_only=True)
class Tried:
    """A resolution and a choice of maps to re-light, what they cost and what they reach.

    megabytes : of the finest levels before compression, of all sheets
    point : mean delta E 2000 against level `weave` at points, of the worst garment
    """

    resolution: int
    maps: tuple[str, ...]
    megabytes: float
    point: float


def cheapest(
    max_error: float,
    sheets_at: Callable[[int], Sequence[Sheet]],
    largest: int,
    count: int,
    choices: Sequence[tuple[str, ...]] = RELIT,
) -> tuple[Tried, list[Tried]]:
    """What meets `max_error` at the least cost up to `largest` texels a side, and what was tried.

    sheets_at : for a resolution, one sheet of each garment
    count : sheets in all

    All maps at one resolution cost less than the fewest at twice of it, so the first resolution at
    which any choice is good enough has the cheapest. Where none is, what loses least at `largest`.
    """
    tried: list[Tried] = []
    resolution = min(COARSEST, largest)
    while True:
        errors = [swatch_errors(sheet, choices, means=False) for sheet in sheets_at(resolution)]
        here = [
            Tried(
                resolution=resolution,
                maps=names,
                megabytes=count * resolution**2 * bytes_per_texel(names) / 1e6,
                point=max(one[k].point for one in errors),
            )
            for k, names in enumerate(choices)
        ]
        tried += here
        good = [one for one in here if one.point <= max_error]
        if good:
            return min(good, key=lambda one: one.megabytes), tried
        if resolution >= largest:
            return here[-1], tried
        resolution *= 2


def bytes_per_texel(names: Sequence[str]) -> int:
    """Of maps, before compression, at the finest level."""
    return sum(REGISTRY[name].bytes_per_texel for name in names)


def maps_with(names: Sequence[str], *, light: bool) -> list[TextureMap]:
    """All maps, but of those that are re-lit only `names`."""
    every = [one.name for one in chosen_maps(None, light=light) if one.name not in NEEDED]
    return chosen_maps([*every, *names], light=light)
