"""Write the report of a bake, as JSON and as a page with pictures: request, errors and cost."""

from __future__ import annotations

from dataclasses import asdict
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.files import whole_file, write_json
from fabricusd.images.files import read_middle, write_png

if TYPE_CHECKING:
    from fabricusd.bake.job import Baked, Settings

PICTURE = 256
"""Side [texels] of the picture of a map on the page: the centre of its finest level."""

_STYLE = """body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:70em;color:#222}
table{border-collapse:collapse}td,th{padding:.2em .8em;text-align:left;border-bottom:1px solid #ddd}
figure{display:inline-block;margin:.4em;width:160px;vertical-align:top;font-size:12px}
img{width:160px;image-rendering:pixelated;background:#444}"""


def report_of(result: Baked, settings: Settings) -> dict[str, Any]:
    """Return the request, the errors reached and the cost, for JSON."""
    sizes = {
        name: sum((result.folder / f).stat().st_size for f in files.values())
        for maps in result.files.values()
        for name, files in maps.items()
    }
    return {
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


def write_report(result: Baked, settings: Settings) -> None:
    """Write `report.json` and `report.html`, with the page's pictures in `report/`."""
    said = report_of(result, settings)
    write_json(result.folder / "report.json", said)
    pictures = result.folder / "report"
    pictures.mkdir(exist_ok=True)
    figures = []
    for garment, maps in result.files.items():
        for name, files in maps.items():
            file = next(iter(files.values()))
            picture = pictures / f"{garment}.{name}.png"
            write_png(picture, as_picture(read_middle(result.folder / file, PICTURE), name))
            figures.append(
                f'<figure><img src="report/{escape(picture.name)}" alt="{escape(name)}">'
                f"<figcaption>{escape(name)}</figcaption></figure>"
            )
    with whole_file(result.folder / "report.html") as temporary:
        temporary.write_text(_page(said, figures), "utf-8")


def _page(said: dict[str, Any], figures: list[str]) -> str:
    asked = said["asked"]["max_error"]
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{e['point']:.2f}</td><td>{e['texel']:.2f}</td>"
        f"<td>{e['bound']:.2f}</td>"
        f"<td>{'' if e['behind'] is None else format(e['behind'], '.2f')}</td></tr>"
        for name, e in said["reached"].items()
    )
    forms = "".join(
        f"<tr><td>{escape(fabric)}</td><td>{r['form']}</td><td>{r['megabytes']:.2f}</td>"
        f"<td>{max(r['rank'])}</td><td>{r['delta_e']:.2f}</td><td>{r['delta_e_between']:.2f}</td>"
        f"<td>{r['bound']:.2f}</td></tr>"
        for fabric, records in said["btf"].items()
        for r in records
    )
    notes = "".join(f"<li>{escape(n)}</li>" for n in said["notes"])
    cost = said["cost"]
    tried = "".join(
        f"<tr><td>{t['resolution']}<td>{len(t['maps'])}<td>{t['megabytes']:.2f}"
        f"<td>{t['point']:.2f}</tr>"
        for t in said["tried"]
    )
    errors = "".join(
        f"<tr><td>{escape(garment)}<td>{escape(name)}<td>{escape(e['unit'])}<td>{e['rounding']:.2g}"
        f"<td>{e['texel']:.2g}<td>{e['point']:.2g}<td>{e['spread']:.2g}</tr>"
        for garment, maps in said["map_error"].items()
        for name, e in maps.items()
    )
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Bake</title>'
        f"<style>{_STYLE}</style><h1>Bake</h1>"
        f"<p>Requested bound: {'none' if asked is None else f'delta E {asked:g}'}. "
        f"Result: {cost['resolution']} texels along a side, {cost['bytes'] / 1e6:.1f} MB, "
        f"baked in {cost['seconds']:.1f} s.</p>"
        "<table><tr><th>garment<th>delta E 2000 at points<th>over texels<th>stated bound"
        "<th>lit from behind</tr>"
        f"{rows}</table>"
        + (
            "<h2>BTF</h2><table><tr><th>fabric<th>form<th>MB<th>rank<th>delta E<th>between"
            f" directions<th>stated bound</tr>{forms}</table>"
            if forms
            else ""
        )
        + (
            "<h2>Trials</h2><table><tr><th>texels along a side<th>maps used to re-light<th>MB"
            f"<th>delta E 2000 at points</tr>{tried}</table>"
            if tried
            else ""
        )
        + (f"<h2>Notes</h2><ul>{notes}</ul>" if notes else "")
        + "<h2>Error of each map</h2><p>Root mean square errors against level weave.</p>"
        + "<table><tr><th>garment<th>map<th>unit<th>from the number type<th>over texels"
        + f"<th>at points<th>standard deviation of the map</tr>{errors}</table>"
        + f"<h2>Maps</h2>{''.join(figures)}</html>\n"
    )


def as_picture(pixels: NDArray[Any], name: str) -> NDArray[np.uint8]:
    """Return a map as an (h, w, 3) uint8 picture: directions as colours, other maps scaled from
    their smallest to their largest value."""
    part = np.asarray(pixels[..., :3], np.float64)
    if name in ("normal", "tangent"):
        part = 0.5 * part + 0.5
    else:
        low, high = float(part.min()), float(part.max())
        part = (part - min(low, 0.0)) / max(high - min(low, 0.0), 1e-12)
        if part.shape[2] == 3:
            part = part ** (1 / 2.2)
    if part.shape[2] == 1:
        part = np.repeat(part, 3, axis=2)
    elif part.shape[2] == 2:
        part = np.concatenate((part, np.zeros_like(part[..., :1])), axis=2)
    return np.asarray(np.rint(np.clip(part, 0.0, 1.0) * 255), np.uint8)
