"""Write the report of a bake: request, errors and cost as JSON, and a page with pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.report_maps import fullest, shown
from fabricusd.bake.report_page import figure, page_of
from fabricusd.bake.texels.maps import NO_LAY
from fabricusd.errors import FabricError
from fabricusd.files import whole_file, write_json
from fabricusd.images.files import read_part, write_png

if TYPE_CHECKING:
    from fabricusd.bake.job import Baked, Settings
    from fabricusd.bake.layout.garment import Garment

PICTURE = 256
"""Side [texels] of the picture of a map on the page, a part of its finest level."""

Portrait = Callable[[], NDArray[np.uint8]]
"""Draws the garment, (h, w, 3) codes of sRGB. The baker knows no renderer; its caller does."""


def report_of(result: Baked, settings: Settings, scene: Path) -> dict[str, Any]:
    """Return the request, the errors reached and the cost, for JSON."""
    sizes = {
        name: sum((result.folder / f).stat().st_size for f in files.values())
        for maps in result.files.values()
        for name, files in maps.items()
    }
    return {
        "scene": scene.name,
        "garments": [
            {
                "name": one.name,
                "size": (one.points.max(axis=0) - one.points.min(axis=0)).tolist(),
                "triangles": len(one.triangles),
                "own_uv": one.own_uv,
                "fabrics": list(dict.fromkeys(lay.fabric.name for lay in one.lays)),
            }
            for one in result.garments
        ],
        "fabrics": _fabrics(result),
        "asked": {"max_error": settings.max_error or None, "resolution": settings.resolution},
        "reached": {name: asdict(error) for name, error in result.errors.items()},
        "within": result.reached(settings.max_error) if settings.max_error else None,
        "cost": {
            "resolution": result.resolution,
            "seconds": round(result.seconds, 2),
            "bytes": sum(sizes.values()),
            "bytes_per_map": sizes,
        },
        "tried": [asdict(one) for one in result.tried],
        "map_error": {
            garment: {name: asdict(error) for name, error in maps.items()}
            for garment, maps in result.map_errors.items()
        },
        "btf": result.btf,
        "notes": result.notes,
    }


def _fabrics(result: Baked) -> list[dict[str, Any]]:
    """Each fabric of the bake once, with the texels that a thread is wide where it is coarsest."""
    found: dict[str, dict[str, Any]] = {}
    for one in result.garments:
        for lay in one.lays:
            cloth = lay.fabric
            # Threads per unit of UV, along U and along V.
            threads = np.linalg.norm(lay.matrix, axis=1)
            texels = (result.resolution / np.maximum(threads, 1e-12)).tolist()
            said = found.setdefault(
                cloth.name,
                {
                    "name": cloth.name,
                    "weave": cloth.weave.name or f"{cloth.weave.ends} by {cloth.weave.picks}",
                    "ends_per_cm": cloth.warp.density / 100,
                    "picks_per_cm": cloth.weft.density / 100,
                    "texels_per_thread": texels,
                    "model": cloth.model,
                },
            )
            said["texels_per_thread"] = [
                min(a, b) for a, b in zip(said["texels_per_thread"], texels, strict=True)
            ]
    return list(found.values())


def write_report(
    result: Baked, settings: Settings, scene: Path, portrait: Portrait | None = None
) -> None:
    """Write `report.json` and `report.html`, with the page's pictures in `report/`."""
    pictures = result.folder / "report"
    pictures.mkdir(exist_ok=True)
    drawn = _drawn(result, pictures, portrait)
    said = report_of(result, settings, scene)
    write_json(result.folder / "report.json", said)
    figures: dict[str, list[str]] = {}
    maps = {one.name: one for one in result.maps}
    for garment in result.garments:
        files = {name: next(iter(f.items())) for name, f in result.files[garment.name].items()}
        covered = _covered(result, garment, files)
        for name, (number, file) in files.items():
            found = shown(_part(result, garment, number, file), maps[name], covered)
            picture = pictures / f"{garment.name}.{name}.png"
            write_png(picture, found.picture)
            ends = (
                None
                if found.low is None or found.high is None
                else (f"{found.low:.3g}", f"{found.high:.3g} {maps[name].unit}".strip())
            )
            # The marks of code are for the pages of docs.
            meaning = maps[name].meaning.replace("`", "")
            figures.setdefault(garment.name, []).append(
                figure(f"report/{picture.name}", name, meaning, found.legend, ends)
            )
    with whole_file(result.folder / "report.html") as temporary:
        temporary.write_text(page_of(said, figures, drawn), "utf-8")


def _part(result: Baked, garment: Garment, number: int, file: str) -> NDArray[np.float32]:
    """The part of a texture that the page shows."""
    around = fullest(garment, number, min(PICTURE / result.resolution, 1.0))
    return read_part(result.folder / file, PICTURE, around)


def _covered(
    result: Baked, garment: Garment, files: dict[str, tuple[int, str]]
) -> NDArray[np.bool_] | None:
    """(h, w) whether the layout covers a texel of the part, by the map `lay`; None without it."""
    if "lay" not in files or files["lay"][1] in result.encodings:
        return None
    return np.asarray(_part(result, garment, *files["lay"])[..., 0] != NO_LAY)


def _drawn(result: Baked, pictures: Path, portrait: Portrait | None) -> str:
    """Write the garment's picture; its name in the page, or "" where there is none."""
    if portrait is None:
        return ""
    try:
        picture = portrait()
    except FabricError as error:
        result.notes.append(f"the report shows no picture of the garment: {error}")
        return ""
    write_png(pictures / "garment.png", picture)
    return "report/garment.png"
