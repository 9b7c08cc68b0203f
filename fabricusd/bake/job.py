"""What a bake is asked for, and what it has made."""

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
"""Texels that a shell is continued beyond its border: enough for four mip levels without a seam."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is made of a scene.

    resolution : texels along a side, a power of two from 64; 0 to take `texels_per_thread`
    maps : names from the registry, None for all
    light : direction to a light in the surface frame, for the map `shadow`
    level : "weave" or "thread", whether threads are flat or round across their width
    udim : bake each UDIM tile that the UVs reach into
    fit : move and scale each garment's UVs into the unit square first
    unwrap : "x", "y" or "z": new UVs by xatlas, with the warp along that axis of the world
    max_error : mean delta E 2000 of re-lit texels against level `weave` to reach; 0 to ask nothing
    btf : forms of the BTF to write, see `btf.write.FORMS`
    file_format : "exr", or "png" or "tiff" for 16-bit integers and the finest level alone
    margin : texels that a shell is continued beyond its border

    `ranges.check_settings` says what each may be; `bake` and `plan` ask it before any work.
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
    """What a bake has made.

    files : names of the textures, by garment, map and UDIM number
    encodings : of each file whose numbers are not the values themselves
    errors : of each garment, measured as `accuracy.swatch_error` does with the maps that were made
    map_errors : of each garment and map
    tried : where a bound was asked for, what was tried to meet it
    btf : records of the BTFs that were written, by fabric
    notes : what had to be assumed or left out
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
        """Whether every garment, and every BTF, is within `max_error`."""
        records = [r["delta_e"] for rows in self.btf.values() for r in rows]
        return all(e.point <= max_error for e in self.errors.values()) and all(
            e <= max_error for e in records
        )
