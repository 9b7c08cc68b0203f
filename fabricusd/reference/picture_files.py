"""The files of a picture: their names, what they hold, and whether they can be written."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.files import require_writable
from fabricusd.images.files import write_exr, write_png
from fabricusd.images.view import View, encode
from fabricusd.reference.film import AOVS

MOST_TRIED = 100
"""Number of frames whose output files are checked before rendering starts."""

DENOISED = "denoised"
"""The layer that holds the picture without its noise, beside the beauty, which keeps it."""

CHANNELS = {**AOVS, DENOISED: ("R", "G", "B")}
IN_PNG = ("Software", "fabricusd:view", "fabricusd:exposure")
"""Metadata of the EXR that the PNG has too."""


def picture_targets(
    out: str | os.PathLike[str] | None, frames: tuple[float, ...] | None
) -> list[tuple[float | None, Path | None]]:
    """(time code, file) of each picture. Raises FabricError for a file that cannot be written."""
    if out is None:
        return [(code, None) for code in frames or (None,)]
    path = Path(out)
    if path.suffix.lower() not in (".exr", ".png"):
        raise FabricError(str(path), "is not a picture format; it must end in .exr or .png")
    targets = frame_files(path, frames)
    for _, target in targets[:MOST_TRIED]:
        for file in written_files(target):
            require_writable(file)
    return [*targets]


def frame_files(path: Path, frames: tuple[float, ...] | None) -> list[tuple[float | None, Path]]:
    """(time code, file) of each picture: `path` itself, or numbered before its suffix."""
    if not frames:
        return [(None, path)]
    return [
        (code, path.with_name(f"{path.stem}.{code:04.10g}{path.suffix}"))
        if code != int(code)
        else (code, path.with_name(f"{path.stem}.{int(code):04d}{path.suffix}"))
        for code in frames
    ]


def written_files(target: Path) -> list[Path]:
    """All files that are written for one picture: an EXR has a PNG beside it."""
    return list(dict.fromkeys([target, target.with_suffix(".png")]))


def write_picture(
    target: Path | None,
    layers: Mapping[str, NDArray[np.float32]],
    metadata: Mapping[str, Any],
    exposure: float,
    view: View,
) -> tuple[str, ...]:
    """Write the picture's files and return their names; none for no target.

    The PNG shows the denoised layer, where there is one.
    """
    if target is None:
        return ()
    shown = layers.get(DENOISED, layers["beauty"][..., :3])
    picture = encode(shown, exposure, view)
    files = written_files(target)
    if target.suffix.lower() == ".exr":
        write_exr(target, layers, CHANNELS, metadata)
    write_png(files[-1], picture, metadata={key: f"{metadata[key]}" for key in IN_PNG})
    return tuple(str(file) for file in files)
