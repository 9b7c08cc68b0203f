"""A page that shows the photograph, the recovered cloth and their difference."""

from __future__ import annotations

import base64
import html
import os

import numpy as np
from numpy.typing import NDArray

from fabricusd.files import whole_file
from fabricusd.measure.flat.compare import Comparison
from fabricusd.measure.flat.fit import Flat
from fabricusd.preview.png import png_bytes
from fabricusd.quality.pictures import heat
from fabricusd.srgb import srgb_encode

Floats = NDArray[np.float64]

STYLE = """body{font:15px system-ui,sans-serif;margin:2em auto;padding:0 1em;max-width:1600px}
.row{display:grid;grid-template-columns:repeat(3,minmax(0,1fr));gap:1em;margin-bottom:1em}
figure{margin:0}img{width:100%;display:block}.near img{image-rendering:pixelated}
@media(max-width:600px){.row{grid-template-columns:1fr}}
table{border-collapse:collapse}td,th{padding:.15em .8em;text-align:left}
td+td{font-variant-numeric:tabular-nums}figcaption{color:#555}"""

CLOSE = 96
"""Pixels per side of the crop that is shown enlarged."""


def _picture(codes: NDArray[np.uint8], caption: str) -> str:
    data = base64.b64encode(png_bytes(np.ascontiguousarray(codes))).decode()
    text = html.escape(caption)
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
        f"<figcaption>{text}</figcaption></figure>"
    )


def shown(linear: Floats) -> NDArray[np.uint8]:
    """(h, w, 3) codes of what a display shows."""
    return np.asarray(np.rint(255 * srgb_encode(linear)), np.uint8)


def page_text(flat: Flat, made: Comparison, through: Floats | None = None) -> str:
    """The page as HTML that needs no other file. through : render of the cloth lit from behind"""
    h, w = flat.front.shape
    side = min(CLOSE, h, w)
    middle = slice((h - side) // 2, (h + side) // 2), slice((w - side) // 2, (w + side) // 2)
    photograph, render = shown(flat.front.linear), shown(made.render)
    difference = heat(made.flip)
    rows_of_pictures = [
        '<div class="row">',
        _picture(photograph, "the photograph"),
        _picture(render, "the fabric, by the path tracer under the stated light"),
        _picture(difference, f"FLIP, mean {made.flip.mean():.3f}; black is alike"),
        '</div><div class="row near">',
        _picture(photograph[middle], "its middle"),
        _picture(render[middle], "its middle"),
        _picture(difference[middle], "its middle"),
        "</div>",
    ]
    if flat.behind is not None and through is not None:
        rows_of_pictures += [
            '<div class="row">',
            _picture(shown(flat.behind.linear), "the photograph, lit from behind"),
            _picture(shown(through), "the fabric, lit from behind, made as bright"),
            "</div>",
        ]
    rows = "".join(
        f"<tr><td>{html.escape(v.label)}</td><td>{v.value:.4g} {v.unit}</td>"
        f"<td>{v.low:.4g} to {v.high:.4g}</td><td>{v.source}</td></tr>"
        for v in flat.values
    )
    others = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{value:.3f}</td></tr>"
        for name, value in made.figures.items()
    )
    notes = "".join(f"<li>{html.escape(note)}</li>" for note in flat.notes)
    title = html.escape(os.path.basename(flat.front.name))
    return f"""<!doctype html>
<html lang="en"><meta charset="utf-8">
<meta name="viewport" content="width=device-width"><title>{title}</title><style>{STYLE}</style>
<h1>{title}: {html.escape(flat.lattice.weave.name)}</h1>
{"".join(rows_of_pictures)}
<h2>Difference</h2>
<p>CIE &Delta;E 2000 of the render, in the mean: {made.delta_e:.2f}</p>
<table><tr><th>picture</th><th>mean FLIP</th></tr>{others}</table>
<h2>Numbers, with 95 % intervals</h2>
<table><tr><th>number</th><th>value</th><th>interval</th><th>from</th></tr>{rows}</table>
<ul>{notes}</ul>
</html>
"""


def write_page(path: str | os.PathLike[str], text: str) -> None:
    """Write the page, whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
