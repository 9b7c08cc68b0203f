"""Write one seamless tile of each fabric as PNG, named as Substance, Unreal and Unity expect.

The numbers are in Substance's convention of anisotropy; the file `<Fabric>_swatch.json` says what
each picture holds, and how the numbers become those of Unreal and Unity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd import __version__
from fabricusd.fabric import Fabric
from fabricusd.files import write_json
from fabricusd.images.files import write_png
from fabricusd.materials.networks.look import Look
from fabricusd.materials.targets import Job, Note
from fabricusd.materials.targets.tile import (
    Tile,
    baked_tile,
    check_folder,
    make_folder,
    relief,
    tile_look,
)
from fabricusd.srgb import srgb_encode

RESOLUTION = 1024

OPAQUE = 0.9995
"""Mean cover from which cloth has no gaps worth an opacity."""


@dataclass(frozen=True)
class Picture:
    """A picture of the tile.

    pixels : (n, n, 1 or 3), from 0 to 1, as they are coded
    bits : 8 or 16; color : whether the codes are sRGB
    """

    pixels: NDArray[np.float64]
    holds: str
    bits: int = 8
    color: bool = False


def check(where: Path, clobber: bool) -> None:
    """Raise FabricError if the folder cannot be made."""
    check_folder("--swatch", where)


def folder(look: Path, where: Path) -> Path:
    """Return the folder itself."""
    return where


def write(job: Job, where: Path) -> list[Path]:
    """Write the pictures of each fabric, and what they hold."""
    make_folder("--swatch", where)
    made: list[Path] = []
    for name, fabric in job.fabrics.items():
        made += write_swatch(fabric, where, name=name, fitted=job.fitted, progress=job.progress)
    return made


def write_swatch(
    fabric: Fabric,
    where: Path,
    *,
    name: str = "",
    resolution: int = RESOLUTION,
    fitted: bool = True,
    progress: Note | None = None,
) -> list[Path]:
    """Write `<name>_*.png` and `<name>_swatch.json` to a folder; return all files.

    name : the fabric's name by default
    resolution : a power of two from 64 on
    progress : gets a line before a step that takes seconds

    Raises FabricError for a fabric that cannot be baked.
    """
    stem = name or fabric.name
    if progress:
        progress(f"baking the tile of {stem}")
    tile = baked_tile(fabric, resolution=resolution, level="thread")
    look = tile_look(tile, "gltf_pbr", fitted=fitted, progress=progress)
    found = pictures(tile, look)
    metadata: dict[str, str | float] = {
        "Software": f"fabricusd {__version__}",
        "Title": fabric.name,
        "Description": f"{1e3 * tile.size[0]:.6g} x {1e3 * tile.size[1]:.6g} mm, seamless",
        "ResolutionUnit": "cm",
        "XResolution": 0.01 * tile.resolution / tile.size[0],
        "YResolution": 0.01 * tile.resolution / tile.size[1],
    }
    written = []
    for tail, one in found.items():
        target = where / f"{stem}_{tail}.png"
        codes = np.rint(np.clip(one.pixels, 0.0, 1.0) * (65535 if one.bits == 16 else 255))
        pixels = codes.astype(np.uint16) if one.bits == 16 else codes.astype(np.uint8)
        write_png(target, pixels, color_space="sRGB" if one.color else "raw", metadata=metadata)
        written.append(target)
    sidecar = where / f"{stem}_swatch.json"
    write_json(sidecar, _told(fabric, tile, look, stem, found))
    return [*written, sidecar]


def pictures(tile: Tile, look: Look) -> dict[str, Picture]:
    """The pictures of a tile by the ends of their names."""
    read = tile.maps
    smooth = np.minimum((read["roughness_along"] * look.smooth_scale) ** 2, 1.0)
    rough = np.maximum(np.minimum((read["roughness_across"] * look.rough_scale) ** 2, 1.0), smooth)
    level = 1.0 - smooth / np.maximum(rough, 1e-6)
    turn = np.arctan2(read["tangent"][..., 1:2], read["tangent"][..., :1]) / (2.0 * math.pi)
    # Painter turns an axis clockwise, T cos(angle) - B sin(angle). An axis is the same half a turn
    # on. From 135 degrees on, neither weft nor warp lies at an end.
    angle = (-turn - 0.375) % 0.5 + 0.375
    color = np.clip(read["base_color"][..., :3] * np.array(look.base_color_scale), 0.0, 1.0)
    normal = 0.5 * read["normal"][..., :3] + 0.5
    height, _ = relief(tile)
    roughness = np.sqrt(smooth)
    ones, zeros = np.ones_like(roughness), np.zeros_like(roughness)
    return {
        "BaseColor": Picture(np.asarray(srgb_encode(color)), "base colour, sRGB", 8, True),
        "Normal_OpenGL": Picture(normal, "(n + 1)/2, green up", 16),
        "Normal_DirectX": Picture(
            np.concatenate((normal[..., :1], 1.0 - normal[..., 1:2], normal[..., 2:]), axis=2),
            "(n + 1)/2, green down", 16,
        ),
        "Roughness": Picture(roughness, "its square is the GGX alpha of the smoother direction"),
        "Anisotropy": Picture(level, "1 - smoother alpha / rougher alpha"),
        "AnisotropyAngle": Picture(
            angle, "direction of the smoother axis over 360 degrees, clockwise from the "
            "picture's right, from 135 to 315 degrees", 16,
        ),
        "Opacity": Picture(np.clip(read["opacity"], 0.0, 1.0), "share covered by threads"),
        "Height": Picture(height, "height over `height_scale_m`", 16),
        "ORM": Picture(
            np.concatenate((ones, roughness, zeros), axis=2),
            "occlusion, roughness, metallic; occlusion is 1, since the base colour is that of "
            "threads that shadow one another",
        ),
    }  # fmt: skip


def _told(
    fabric: Fabric, tile: Tile, look: Look, stem: str, found: Mapping[str, Picture]
) -> dict[str, Any]:
    """What the pictures hold."""
    cover = float(tile.maps["opacity"].mean())
    reflected = ((look.specular_ior - 1.0) / (look.specular_ior + 1.0)) ** 2
    return {
        "fabricusd": __version__,
        "fabric": fabric.name,
        "size_mm": [1e3 * tile.size[0], 1e3 * tile.size[1]],
        "threads": {"warp": tile.ends, "weft": tile.picks},
        "texels": tile.resolution,
        "texels_per_thread": [tile.resolution / tile.ends, tile.resolution / tile.picks],
        "height_scale_m": relief(tile)[1],
        "mean_opacity": cover,
        "has_gaps": cover < OPAQUE,
        "even_threads": "uneven yarn never repeats, so the threads of the tile are even",
        "pictures": {
            f"{stem}_{tail}.png": {
                "holds": one.holds, "bits": one.bits,
                "color_space": "sRGB" if one.color else "raw",
            }
            for tail, one in found.items()
        },
        "orientation": "the warp runs up the picture, the weft across; the first row is the top",
        "specular": {
            "ior": look.specular_ior, "reflectance": reflected,
            "level_of_substance": reflected / 0.08, "tint": list(look.specular_tint),
        },
        "sheen": {
            "color": [look.fuzz_weight * x for x in look.fuzz_color],
            "roughness": look.fuzz_roughness,
        },
        "look": asdict(look),
        "conventions": {
            "substance": "as the pictures are, in Painter's shader "
            "pbr-metal-rough-anisotropy-angle: alpha = Roughness^2 along the angle, "
            "Roughness^2 / (1 - Anisotropy) across it",
            "substance_asm": "Painter's asm-metal-rough is rougher along its angle: angle plus 90 "
            "degrees, level = (Roughness^2 / (1 - Anisotropy) - Roughness^2)^(1/4)",
            "unreal_and_unity": "anisotropy = Anisotropy / (2 - Anisotropy) along a tangent turned "
            "clockwise by the angle plus 90 degrees; roughness = Roughness / sqrt(1 - anisotropy)",
            "gltf": "anisotropyStrength^2 = (Roughness^2 / (1 - Anisotropy) - Roughness^2) / "
            "(1 - Roughness^2); anisotropyRotation = 90 degrees minus the angle",
            "normals": "OpenGL: Substance, Unity, Blender, glTF; DirectX: Unreal",
        },
    }  # fmt: skip
