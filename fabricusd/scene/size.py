"""How large meshes are, in words: metres, threads across, and whether a size is likely."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.scene.scene import FabricSurface, Mesh, Scene
from fabricusd.scene.surface.normals import measured_scale

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Metres in a unit of length that a file may be in."""

WORDS = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "in": "inches"}

LARGEST, SMALLEST = 10.0, 0.005
"""Metres of the longest side beyond which a size is told as unlikely.

A wedding train, a curtain or a sail is within 10 m, and a swatch under a microscope above 5 mm. A
shirt of 70 cm whose centimetres were taken for metres is 70 m, whose metres were taken for
centimetres 7 mm, for millimetres 0.7 mm."""

UNITLESS = (".obj", ".ply")
"""Mesh files that do not say their unit; glTF is in metres."""


def unit_length(units: str | None, suffix: str) -> float:
    """Metres in one unit of a file with that suffix. Raises FabricError for others than UNITS."""
    if units is None:
        return 1.0
    if units not in UNITS:
        raise FabricError("--units", f"is '{units}'; it must be one of {', '.join(UNITS)}")
    if suffix not in UNITLESS:
        raise FabricError(
            "--units", f"is for {' and '.join(UNITLESS)} files; a {suffix} file has its own unit"
        )
    return UNITS[units]


def size_words(low: NDArray[np.float64], high: NDArray[np.float64]) -> str:
    """'0.6 m wide, 0.8 m high and 0.1 m deep', without the sides that have no length."""
    sides = zip(high - low, ("wide", "high", "deep"), strict=True)
    parts = [f"{side:.3g} m {word}" for side, word in sides if side > 0]
    return " and ".join([", ".join(parts[:-1])] * (len(parts) > 1) + parts[-1:]) or "a point"


def note_size(scene: Scene, path: Path, units: str | None) -> None:
    """Tell the size of a mesh file where its unit was assumed, or where it is not likely."""
    low, high = scene.bounds()
    longest = float((high - low).max())
    if not np.isfinite(longest) or not longest > 0:
        return
    suffix = path.suffix.lower()
    words = f"is {size_words(low, high)}"
    if units is not None:
        words += f" with --units {units}"
    elif suffix in UNITLESS:
        words += f"; {suffix} has no unit and metres were taken"
    else:
        words += "; lengths in glTF are metres"
    if SMALLEST <= longest <= LARGEST:
        if units is None and suffix in UNITLESS:
            scene.note(path.name, words)
        return
    unit = next((u for u in ("cm", "mm") if longest * UNITS[u] <= 3.0), "mm")
    if suffix not in UNITLESS or longest < SMALLEST:
        scene.note(path.name, f"{words}; no cloth is likely to be that size, scale it")
    elif units is None:
        scene.note(path.name, f"{words}; if it is in {WORDS[unit]}, add --units {unit}")
    else:
        scene.note(path.name, f"{words}; no cloth is likely to be that size")


def mesh_words(scene: Scene, mesh: Mesh) -> str:
    """A mesh's size, and how many threads of each of its fabrics run across it."""
    one = Scene(meshes=[mesh])
    words = size_words(*one.bounds())
    if mesh.uv is None:
        return words
    material = np.asarray(mesh.material)
    for index in np.unique(material):
        surface = scene.materials[index]
        if not isinstance(surface, FabricSurface):
            continue
        mine = material == index
        corners = mesh.points[np.asarray(mesh.triangles)[mine]]
        area2 = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        metres = measured_scale(mesh.uv[mine], area2)
        if not metres > 0:
            continue
        threads = surface.binding.weave_coordinates(mesh.uv[mine], metres).reshape(-1, 2)
        words += f"; {threads_words(threads)} of {surface.name} across"
    return words


def threads_words(threads: NDArray[np.float64]) -> str:
    """'1200 warp and 1400 weft threads', from (n, 2) weave coordinates."""
    warp, weft = np.ptp(threads, axis=0)
    return f"{warp:.0f} warp and {weft:.0f} weft threads"
