"""Check a bake's settings before any work: that names are known and numbers are within range."""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Integral
from typing import TYPE_CHECKING, Any

from fabricusd.bake.btf.write import FORMS
from fabricusd.bake.layout.unwrap import AXES
from fabricusd.bake.texels.encoding import FORMATS
from fabricusd.bake.texels.light import is_number, unit_light
from fabricusd.bake.texels.maps import chosen_maps
from fabricusd.bake.texels.sheet import LARGEST, SMALLEST
from fabricusd.errors import FabricError

if TYPE_CHECKING:
    from fabricusd.bake.job import Settings

WIDEST = 1024
"""Largest margin [texels]: more than any mip level in use needs."""


def check_settings(settings: Settings) -> None:
    """Raise FabricError, naming the command-line option, for the first setting out of range."""
    _check_numbers(settings)
    _one_of("--format", settings.file_format, tuple(FORMATS))
    _one_of("--level", settings.level, ("weave", "thread"))
    _one_of("--shadow", settings.shadow, ("peak", "horizon", "traced"))
    if settings.unwrap:
        _one_of("--unwrap", settings.unwrap, tuple(AXES))
    for form in settings.btf:
        _one_of("--btf", form, FORMS)
    if settings.light is not None:
        unit_light(settings.light)
    if settings.maps is not None and not settings.maps:
        raise FabricError("--maps", "names no map; it must name at least one")
    chosen_maps(settings.maps, light=settings.light is not None)


def _check_numbers(settings: Settings) -> None:
    """Check the resolution, texels per thread, margin and error."""
    if settings.texels_per_thread:
        positive("--texels-per-thread", settings.texels_per_thread)
    else:
        check_resolution(settings.resolution)
    margin = settings.margin
    if not _is_whole(margin) or not 0 <= margin <= WIDEST:
        raise FabricError("margin", f"is {margin!r}; it must be a whole number from 0 to {WIDEST}")
    if settings.max_error:
        positive("--max-error", settings.max_error)


def check_resolution(texels: int) -> None:
    """Raise FabricError unless `texels` is a valid texture resolution."""
    if not _is_whole(texels) or not SMALLEST <= texels <= LARGEST or texels & (texels - 1):
        raise FabricError(
            "--resolution",
            f"is {texels!r}; it must be a power of two from {SMALLEST} to {LARGEST}",
        )


def positive(option: str, number: float) -> float:
    """Return `number` if it is finite and above 0; raise FabricError otherwise."""
    if not is_number(number) or not 0.0 < number < math.inf:
        raise FabricError(option, f"is {number!r}; it must be a number above 0")
    return number


def _one_of(option: str, value: str, known: Sequence[str]) -> None:
    if value not in known:
        raise FabricError(
            f"{option} '{value}'", f"is unknown; it must be one of {', '.join(known)}"
        )


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)
