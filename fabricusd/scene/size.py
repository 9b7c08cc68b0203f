"""Describes the size of meshes in words: in metres, in threads across, and whether it is likely."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.scene.scene import FabricSurface, Mesh, Scene
from fabricusd.scene.surface.normals import measured_scale

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Metres per unit, for the units of length that a file may use."""

WORDS = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "in": "inches"}

LARGEST, SMALLEST = 10.0, 0.005
"""Bounds on the longest side [m]; a note calls a size outside of them unlikely.

A wedding train, a curtain or a sail is smaller than 10 m, and a swatch under a microscope is larger
than 5 mm. A shirt of 70 cm becomes 70 m if its centimetres are taken for metres, 7 mm if its metres
are taken for centimetres, and 0.7 mm if they are taken for millimetres."""

UNITLESS = (".obj", ".ply")
"""Suffixes of mesh files that do not state their unit; glTF files are in metres."""


def unit_length(units: str | None, suffix: str) -> float:
    """Metres per unit of a file with that suffix. Raises FabricError for a unit not in UNITS."""
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
    """The size in words, as '0.6 m wide, 0.8 m high and 0.1 m deep'; omits sides of length 0."""
    sides = zip(high - low, ("wide", "high", "deep"), strict=True)
    parts = [f"{side:.3g} m {word}" for side, word in sides if side > 0]
    return " and ".join([", ".join(parts[:-1])] * (len(parts) > 1) + parts[-1:]) or "a point"


def note_size(scene: Scene, path: Path, units: str | None) -> None:
    """Add a note about a mesh file's size if its unit was assumed, or if the size is unlikely."""
    low, high = scene.bounds()
    longest = float((high - low).max())
    if not np.isfinite(longest) or not longest > 0:
        return
    suffix = path.suffix.lower()
    words = f"is {size_words(low, high)}"
    if units is not None:
        words += f" with --units {units}"
    elif suffix in UNITLESS:
        words += f"; {suffix} files have no unit, and metres were assumed"
    else:
        words += "; lengths in glTF are metres"
    if SMALLEST <= longest <= LARGEST:
        if units is None and suffix in UNITLESS:
            scene.note(path.name, words)
        return
    unit = next((u for u in ("cm", "mm") if longest * UNITS[u] <= 3.0), "mm")
    if suffix not in UNITLESS or longest < SMALLEST:
        scene.note(path.name, f"{words}; cloth is unlikely to be that size; scale the file")
    elif units is None:
        scene.note(path.name, f"{words}; if it is in {WORDS[unit]}, add --units {unit}")
    else:
        scene.note(path.name, f"{words}; cloth is unlikely to be that size")


def mesh_words(scene: Scene, mesh: Mesh) -> str:
    """The size of a mesh in words, with the number of threads of each of its fabrics across it."""
    one = Scene(meshes=[replace(mesh, placements=None)])
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
    """Words such as '1200 warp and 1400 weft threads', from (n, 2) weave coordinates."""
    warp, weft = np.ptp(threads, axis=0)
    return f"{warp:.0f} warp and {weft:.0f} weft threads"
