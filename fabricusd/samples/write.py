"""Writes the sample files into a folder."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from fabricusd.errors import FabricError
from fabricusd.files import whole_file
from fabricusd.images.files import write_exr, write_png
from fabricusd.samples.garment import skirt_obj
from fabricusd.samples.pictures import diamonds, rose, sky
from fabricusd.schema import load
from fabricusd.weaves import from_fabric, write_wif


def _skirt(path: Path) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(skirt_obj(), encoding="ascii")


def _sky(path: Path) -> None:
    write_exr(path, {"beauty": sky()}, {"beauty": ("R", "G", "B")}, {"Software": "fabricusd"})


SAMPLES: dict[str, tuple[Callable[[Path], object], str, str]] = {
    # name: how it is written, what it is, what to do with it
    "skirt.obj": (
        _skirt, "a garment with UVs, in centimetres",
        "fabricusd dress {} --units cm --fabric denim -o skirt.usda",
    ),
    "sky.exr": (
        _sky, "a latitude-longitude picture of an overcast sky and a window",
        "fabricusd render skirt.usda skirt.png --dome {}",
    ),
    "rose.png": (
        lambda path: write_png(path, rose()), "artwork of three colours",
        "fabricusd new --figure {} --ends-per-cm 60 --picks-per-cm 60 --fibre silk -o damask.usda",
    ),
    "diamonds.png": (
        lambda path: write_png(path, diamonds()), "a drawdown, a pixel per crossing",
        "fabricusd new --from {} --ends-per-cm 24 --picks-per-cm 24 -o diamonds.usda",
    ),
    "tweed.wif": (
        lambda path: write_wif(from_fabric(load("herringbone_tweed")), path),
        "a herringbone draft in WIF", "fabricusd new --from {} --fibre wool -o tweed.usda",
    ),
}  # fmt: skip
"""The sample files, in the order in which they are written."""


def write_samples(folder: str | os.PathLike[str], *, clobber: bool = True) -> list[Path]:
    """Write all sample files into `folder`, which is made, and return their paths.

    Raises `FabricError`, before anything is written, for a folder that cannot be made and, without
    `clobber`, for a file that exists.
    """
    place = Path(folder)
    paths = [place / name for name in SAMPLES]
    for path in paths:
        if not clobber and os.path.lexists(path):
            raise FabricError(str(path), "exists; with --no-clobber, give another folder")
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FabricError(str(place), f"cannot be made: {error.strerror}") from error
    for path in paths:
        SAMPLES[path.name][0](path)
    return paths
