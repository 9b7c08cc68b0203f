"""Compose the manifest: what was baked, from which scene, and with which settings."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numba
import numpy as np

from fabricusd import __version__
from fabricusd.bake.texels.maps import TextureMap
from fabricusd.bake.work.scratch import sha256
from fabricusd.images.files import OPENIMAGEIO

if TYPE_CHECKING:
    from fabricusd.bake.job import Baked, Settings


def manifest_of(result: Baked, settings: Settings, scene: Path) -> dict[str, Any]:
    """Return, for JSON, everything that a program needs to read the textures."""
    return {
        "fabricusd": __version__,
        "versions": {
            "python": ".".join(map(str, sys.version_info[:3])),
            "numpy": np.__version__,
            "numba": numba.__version__,
            "OpenImageIO": OPENIMAGEIO,
        },
        "scene": {"file": scene.name, "sha256": sha256(scene)},
        "settings": asdict(settings),
        "resolution": result.resolution,
        "maps": {
            one.name: {
                "meaning": one.meaning,
                "channels": list(one.channels),
                "color_space": _color_space(one, settings.file_format),
                "type": _number_type(one, settings.file_format),
                "unit": one.unit,
            }
            for one in result.maps
        },
        "garments": {
            one.name: {
                "mesh": f"{one.name}.usdc",
                "uv_of_the_scene": one.own_uv,
                "prims": list(one.copies),
                "fingerprint": one.fingerprint,
                "triangles": len(one.triangles),
                "mirrored_triangles": int(one.mirrored.sum()),
                "error": asdict(result.errors[one.name]),
                "map_error": {
                    name: asdict(error) for name, error in result.map_errors[one.name].items()
                },
                "lays": [
                    {
                        "fabric": lay.fabric.name,
                        "threads_per_uv": lay.matrix.tolist(),
                        "offset": lay.offset.tolist(),
                    }
                    for lay in one.lays
                ],
                "files": {
                    name: {str(number): _file(result, file) for number, file in files.items()}
                    for name, files in result.files[one.name].items()
                },
            }
            for one in result.garments
        },
        "btf": result.btf,
        "notes": result.notes,
    }


def _file(result: Baked, file: str) -> dict[str, Any]:
    """Return a texture's entry, with its `Encoding` if the file does not store plain values."""
    said: dict[str, Any] = {"file": file, "sha256": sha256(result.folder / file)}
    if file in result.encodings:
        said["encoding"] = asdict(result.encodings[file])
    return said


def _color_space(one: TextureMap, file_format: str) -> str:
    if not one.color:
        return "raw"
    return "lin_rec709" if file_format == "exr" else "srgb_texture"


def _number_type(one: TextureMap, file_format: str) -> str:
    if file_format != "exr":
        return "uint16"
    return "float" if one.exact else "half"
