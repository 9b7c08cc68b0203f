"""Find the cheapest bake that meets an error bound: the resolution and maps of the fewest bytes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fabricusd.bake.error.accuracy import swatch_errors
from fabricusd.bake.error.relight import NEEDED, RELIT
from fabricusd.bake.texels.maps import REGISTRY, TextureMap, chosen_maps
from fabricusd.bake.texels.sheet import Sheet

COARSEST = 64
"""Resolution [texels] at which a search starts."""


@dataclass(frozen=True, kw_only=True)
class Tried:
    """A trial: a resolution and a choice of maps to re-light from, their cost and their error.

    megabytes : size of the finest levels of all sheets before compression
    point : mean delta E 2000 against level `weave` at points, for the worst garment
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
    """Return the cheapest trial that meets `max_error`, and all trials.

    sheets_at : returns one sheet of each garment at a given resolution
    largest : largest resolution to try
    count : total number of sheets

    All maps at one resolution cost less than the cheapest choice at twice that resolution, so the
    search ends at the first resolution at which any choice is accurate enough. If none is, the
    result is the most accurate choice at `largest`.
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
    """Return the bytes of a texel of these maps at the finest level, before compression."""
    return sum(REGISTRY[name].bytes_per_texel for name in names)


def maps_with(names: Sequence[str], *, light: bool, through: bool = False) -> list[TextureMap]:
    """Return all maps that are not used to re-light, and those of `names`; see `chosen_maps`."""
    every = [t.name for t in chosen_maps(None, light=light, through=through)]
    return chosen_maps([*(n for n in every if n not in NEEDED), *names], light=light)
