"""Write U3M 1.1 materials for garment CAD: one seamless swatch of a fabric, in millimetres.

The format is Vizoo's open one ([U3M2021]). Its images must be RGB, so data are stored in three
equal channels; colours are sRGB. The swatch is a whole number of repeats, baked on its own square.
Each material is also written as an archive, `.u3ma`, which holds it and its images.
"""

from __future__ import annotations

import hashlib
import math
import uuid
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
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
from fabricusd.materials.targets.u3ma import write_u3ma
from fabricusd.srgb import srgb_encode
from fabricusd.weaves.recognise import recognise

FIBRES = (
    "Polyester", "Linen", "Silk", "Cotton", "Wool", "Rayon", "Nylon", "Acetate", "Acrylic",
    "Cashmere", "Hemp", "Jute", "Lyocell", "Mohair", "Ramie",
)  # fmt: skip
"""The format's names of fibres, which are looked up in the names of fabrics and threads."""

PILE = "velvet", "velour", "corduroy"


def check(where: Path, clobber: bool) -> None:
    """Raise FabricError if the folder cannot be made."""
    check_folder("--u3m", where)


def folder(look: Path, where: Path) -> Path:
    """Return the folder itself."""
    return where


def write(job: Job, where: Path) -> list[Path]:
    """Write a swatch of each fabric, its pictures, and the archive of both."""
    made: list[Path] = []
    make_folder("--u3m", where)
    for name, fabric in job.fabrics.items():
        files = write_u3m(fabric, where / f"{name}.u3m", fitted=job.fitted, progress=job.progress)
        made += [*files, write_u3ma(where / f"{name}.u3ma", files)]
    return made


def write_u3m(
    fabric: Fabric, path: Path, *, resolution: int = 512, fitted: bool = True,
    progress: Note | None = None,
) -> list[Path]:  # fmt: skip
    """Write the material `path` (`.u3m`) and its PNG files in `<stem>_u3m/` beside it.

    progress : gets a line before a step that takes seconds

    Returns all files. Raises FabricError for another suffix or a fabric that cannot be baked.
    """
    if path.suffix != ".u3m":
        raise FabricError(str(path), "is not the name of a U3M material; it must end in .u3m")
    if progress:
        progress(f"baking the swatch of {fabric.name}")
    tile = baked_tile(fabric, resolution=resolution)
    look = tile_look(tile, "u3m", fitted=fitted, progress=progress)
    images, depth = pictures(tile, look)
    size = (1e3 * tile.size[0], 1e3 * tile.size[1])
    written = []
    folder_name = f"{path.stem}_u3m"
    try:
        path.with_name(folder_name).mkdir(exist_ok=True)
    except OSError as error:
        raise FabricError(str(path), f"cannot be written: {error.strerror}") from error
    for name, pixels in images.items():
        target = path.with_name(folder_name) / f"{name}.png"
        codes = np.rint(np.clip(pixels, 0.0, 1.0) * 65535).astype(np.uint16)
        write_png(target, codes, color_space="sRGB" if name == "basecolor" else "raw")
        written.append(target)
    swatch = _SwatchImages(folder_name, size, resolution)
    write_json(path, material(fabric, images, look, depth, swatch))
    return [path, *written]


def pictures(tile: Tile, look: Look) -> tuple[dict[str, NDArray[np.float64]], float]:
    """(h, w, 3) values from 0 to 1 of each image of the material, and the depth of the relief [mm].

    The depth is the height that 1 represents in the image `displacement`.
    """
    read = tile.maps
    smooth = np.minimum((read["roughness_along"] * look.smooth_scale) ** 2, 1.0)
    rough = np.maximum(np.minimum((read["roughness_across"] * look.rough_scale) ** 2, 1.0), smooth)
    # In the principled shader aspect^2 = 1 - 0.9 anisotropy; alphas are r^2/aspect and r^2 aspect.
    anisotropy = np.clip((1.0 - smooth / rough) / 0.9, 0.0, 1.0)
    x, y = -read["tangent"][..., 1], read["tangent"][..., 0]
    turn = (np.arctan2(y, x) / (2.0 * math.pi)) % 1.0
    height, depth = relief(tile)
    single = {
        "roughness": np.sqrt(np.sqrt(smooth * rough)),
        "anisotropy": anisotropy,
        "anisotropy_rotation": turn[..., None],
        "alpha": read["opacity"],
        "displacement": height,
    }
    found = {name: np.repeat(values, 3, axis=2) for name, values in single.items()}
    color = np.clip(read["base_color"][..., :3] * np.array(look.base_color_scale), 0.0, 1.0)
    found["basecolor"] = np.asarray(srgb_encode(color))
    found["normal"] = 0.5 * read["normal"][..., :3] + 0.5
    return found, 1e3 * depth


class _SwatchImages:
    """Formats values as the U3M schema requires, with the common size of the images."""

    def __init__(self, folder: str, size: tuple[float, float], resolution: int) -> None:
        self.folder, self.size = folder, size
        self.dpi = {k: resolution / mm * 25.4 for k, mm in zip("xy", size, strict=True)}

    def image(self, name: str) -> dict[str, Any]:
        """Return an image."""
        return {
            "path": f"{self.folder}/{name}.png", "width": self.size[0], "height": self.size[1],
            "dpi": self.dpi, "repeat": {"rotation": 0.0, "mode": "normal"},
        }  # fmt: skip

    def number(self, constant: float, name: str = "", factor: float = 1.0) -> dict[str, Any]:
        """Return a number, with an image if it has one."""
        texture = {"factor": factor, "offset": 0.0, "image": self.image(name)} if name else None
        return {"constant": constant, "texture": texture}

    def color(self, rgb: Iterable[float], name: str = "") -> dict[str, Any]:
        """Return a colour, with an image if it has one."""
        white = {"r": 1.0, "g": 1.0, "b": 1.0}
        texture = {"mode": "multiply", "factor": white, "image": self.image(name)} if name else None
        return {"constant": dict(zip("rgb", map(float, rgb), strict=True)), "texture": texture}


def material(
    fabric: Fabric,
    images: dict[str, NDArray[np.float64]],
    look: Look,
    depth: float,
    swatch: _SwatchImages,
) -> dict[str, Any]:
    """Return the document in version 1.1 of the schema.

    depth : depth of the relief [mm]
    """
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    digest = hashlib.sha256(repr((fabric.name, fabric.threads, swatch.size)).encode()).digest()
    return {
        "schema": "1.1",
        "custom": None,
        "material": {
            "id": str(uuid.UUID(bytes=digest[:16], version=4)),
            "name": fabric.name, "description": fabric.documentation,
            "created": now, "modified": now,
            "front": _front(images, look, depth, swatch), "back": None, "side": None,
            "physics": physics(fabric), "metadata": None,
        },
    }  # fmt: skip


def _front(
    images: dict[str, NDArray[np.float64]], look: Look, depth: float, swatch: _SwatchImages
) -> dict[str, Any]:
    mean = {name: values.mean(axis=(0, 1)) for name, values in images.items()}
    up = {"x": 0.0, "y": 0.0, "z": 1.0}
    reflected = ((look.specular_ior - 1.0) / (look.specular_ior + 1.0)) ** 2
    pictured = {
        "roughness": "roughness", "anisotropy_value": "anisotropy",
        "anisotropy_rotation": "anisotropy_rotation", "alpha": "alpha",
    }  # fmt: skip
    plain = {
        "ior": look.specular_ior, "specular_value": reflected / 0.08, "specular_tint": 0.0,
        "metalness": 0.0, "sheen_value": look.fuzz_weight, "sheen_tint": 1.0,
        "clearcoat_value": 0.0, "clearcoat_roughness": 0.0, "subsurface_value": 0.0,
        "subsurface_radius": 0.0, "transmission": 0.0,
    }  # fmt: skip
    return {
        "shader": "principled",
        "basecolor": swatch.color(mean["basecolor"], "basecolor"),
        "normal": {"constant": up, "texture": {"scale": 1.0, "image": swatch.image("normal")}},
        **{key: swatch.number(float(mean[name][0]), name) for key, name in pictured.items()},
        # The displacement is a length, and the format's lengths are in millimetres.
        "displacement": swatch.number(
            depth * float(mean["displacement"][0]), "displacement", depth
        ),
        **{key: swatch.number(value) for key, value in plain.items()},
        "clearcoat_normal": {"constant": up, "texture": None},
        "subsurface_color": swatch.color((0.0, 0.0, 0.0)),
        "preview": None,
    }


def physics(fabric: Fabric) -> dict[str, Any]:
    """Return what is known about the cloth itself, in the format's terms."""
    thick = [t.thickness for t in fabric.thread_list]
    return {
        "thickness": 2e3 * max(thick) if all(thick) else None,
        "weight": None,
        "composition": {"parts": _composition(fabric)},
        "devices": {"fab": "null"},
        "material_type": {"type": "Woven", "name": None},
        "construction": construction(fabric),
    }


def _composition(fabric: Fabric) -> list[dict[str, Any]]:
    """Return the fibre if the names mention exactly one.

    Shares by mass are not known, so a mixture is never stated.
    """
    words = " ".join((fabric.name, *fabric.threads)).lower()
    found = [fibre for fibre in FIBRES if fibre.lower() in words]
    kind = found[0] if len(found) == 1 else "unknown"
    return [{"ratio": 1.0, "type": kind, "name": None}]


def construction(fabric: Fabric) -> dict[str, Any]:
    """Return the weave in the format's terms, or its own name if the format has no term."""
    if any(word in fabric.name.lower() for word in PILE):
        return {"type": "Velour", "name": None}
    name = recognise(fabric.weave.cells) or fabric.weave.name
    first = name.split()[0].lower() if name else ""
    if first == "twill":
        hand = {" S": "Twill - left hand (S)", " Z": "Twill - right hand (Z)"}
        kind = next((full for tail, full in hand.items() if tail in name), "Twill")
        return {"type": kind, "name": None}
    known = {"plain": "Plain weave", "satin": "Satin", "sateen": "Satin", "oxford": "Oxford"}
    if first in known:
        return {"type": known[first], "name": None}
    if max(fabric.weave.ends, fabric.weave.picks) > 64:
        return {"type": "Jacquard", "name": None}
    return {"type": "other", "name": name} if name else {"type": "unknown", "name": None}
