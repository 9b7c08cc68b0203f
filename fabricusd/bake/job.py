"""The settings and the result of a bake."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fabricusd.bake.error.accuracy import SwatchError
from fabricusd.bake.error.choose import Tried
from fabricusd.bake.error.map_error import MapError
from fabricusd.bake.layout.garment import Garment
from fabricusd.bake.texels.encoding import Encoding
from fabricusd.bake.texels.maps import TextureMap

MARGIN = 16
"""Texels by which a UV shell is extended beyond its border: enough for four seamless mip levels."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What to bake, and how.

    resolution : texels along a side, a power of two from 64 on
    texels_per_thread : if not 0, the resolution is derived from it
    maps : names from the registry, None for all
    light : direction to a light in the surface frame, for the map `shadow`
    shadow : method of that map, "peak", "horizon" or "traced"
    level : "weave" for threads that are flat across their width, "thread" for round ones
    udim : bake every UDIM tile that the UVs reach
    fit : translate and scale each garment's UVs into the unit square first
    unwrap : "x", "y" or "z": new UVs by xatlas, with the warp along that world axis
    max_error : bound on the mean delta E 2000 of re-lit texels against level `weave`; 0 for none
    btf : forms of the BTF to write, see `btf.write.FORMS`
    file_format : "exr", or "png" or "tiff" for 16-bit integers and the finest level only
    margin : texels by which a UV shell is extended beyond its border

    `ranges.check_settings` states the accepted values; `bake` and `plan` call it before any work.
    """

    resolution: int = 1024
    texels_per_thread: float = 0.0
    maps: tuple[str, ...] | None = None
    light: tuple[float, float, float] | None = None
    shadow: str = "peak"
    level: str = "weave"
    udim: bool = False
    fit: bool = False
    unwrap: str = ""
    max_error: float = 0.0
    btf: tuple[str, ...] = ()
    file_format: str = "exr"
    margin: int = MARGIN


@dataclass(kw_only=True)
class Baked:
    """The result of a bake.

    files : names of the textures, by garment, map and UDIM number
    encodings : by file name, for files whose numbers are not the values themselves
    errors : by garment, as `accuracy.swatch_error` measures them, for the maps that were written
    map_errors : by garment and map
    tried : the trials of the search, if `max_error` was set
    btf : records of the BTFs that were written, by fabric
    notes : assumptions and omissions
    finished : False if the bake was interrupted
    """

    folder: Path
    resolution: int
    garments: list[Garment]
    maps: list[TextureMap]
    files: dict[str, dict[str, dict[int, str]]]
    notes: list[str] = field(default_factory=list)
    encodings: dict[str, Encoding] = field(default_factory=dict)
    errors: dict[str, SwatchError] = field(default_factory=dict)
    map_errors: dict[str, dict[str, MapError]] = field(default_factory=dict)
    tried: list[Tried] = field(default_factory=list)
    btf: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    seconds: float = 0.0
    finished: bool = True

    def reached(self, max_error: float) -> bool:
        """Whether the error of every garment and every BTF is at most `max_error`."""
        records = [r["delta_e"] for rows in self.btf.values() for r in rows]
        return all(e.point <= max_error for e in self.errors.values()) and all(
            e <= max_error for e in records
        )
