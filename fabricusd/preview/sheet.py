"""Contact sheets: many fabrics on one shape under the same lights, as a PNG and as HTML."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Fabric
from fabricusd.preview.lights import Lights
from fabricusd.preview.picture import Picture, preview
from fabricusd.preview.png import png_bytes
from fabricusd.run.spread import Place, spread

TEXT = 15
"""Height of the labels [pixels]."""

_LINE, _GAP = 26, 6
_PAPER, _INK = 26, 220


@dataclass(frozen=True, kw_only=True, eq=False)
class Tile:
    """One picture of a sheet. pixels : (n, n, 3) codes; below : a line about the cloth."""

    name: str
    below: str
    pixels: NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """How all tiles are drawn: arguments of `picture.preview`."""

    shape: str
    level: str | None
    size: int
    lights: Lights
    samples: int | None


def tiles_of(
    named: Sequence[tuple[str, Fabric]],
    how: Drawing,
    codes: Callable[[Picture], NDArray[np.uint8]],
    place: Place = 1,
) -> list[Tile]:
    """A tile of each (name, fabric), drawn at `place`; codes : of a picture, taken here."""
    pictures = spread("tiles", _drawn, how, [fabric for _, fabric in named], place)
    return [
        Tile(name=name, below=words(fabric), pixels=codes(picture))
        for (name, fabric), picture in zip(named, pictures, strict=True)
    ]


def _drawn(how: Drawing, fabric: Fabric) -> Picture:
    return preview(fabric, **vars(how))


def words(fabric: Fabric) -> str:
    """Weave and densities of a cloth."""
    weave = fabric.weave.name or "unnamed weave"
    return f"{weave}, {fabric.warp.density / 100:.3g} x {fabric.weft.density / 100:.3g} per cm"


def sheet_png(tiles: Sequence[Tile]) -> bytes:
    """A PNG of the tiles in rows, each with its name below it."""
    from fabricusd.images.labels import labelled

    columns = max(math.ceil(math.sqrt(len(tiles) * 1.5)), 1)
    side = tiles[0].pixels.shape[0]
    step, rows = side + _GAP, math.ceil(len(tiles) / columns)
    paper = np.full((rows * (step + _LINE) + _GAP, columns * step + _GAP, 3), _PAPER, np.uint8)
    labels = []
    for k, tile in enumerate(tiles):
        y, x = _GAP + k // columns * (step + _LINE), _GAP + k % columns * step
        paper[y : y + side, x : x + side] = tile.pixels
        room = side // (TEXT // 2)
        labels.append((x + 2, y + side + _LINE - 8, tile.name[:room]))
    return png_bytes(labelled(paper, labels, TEXT, _INK))


def sheet_html(title: str, tiles: Sequence[Tile]) -> str:
    """One HTML file that holds the pictures and needs nothing else."""
    cards = "\n".join(_card(tile) for tile in tiles)
    return _HTML.format(title=html.escape(title), cards=cards)


def _card(tile: Tile) -> str:
    data = base64.b64encode(png_bytes(tile.pixels)).decode()
    name, below = html.escape(tile.name), html.escape(tile.below)
    side = tile.pixels.shape[0]
    return (
        f'<figure><img width="{side}" height="{side}" alt="{name}: {below}" '
        f'src="data:image/png;base64,{data}"><figcaption><b>{name}</b><br>{below}</figcaption>'
        "</figure>"
    )


_HTML = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body {{ margin: 1rem; background: #1a1a1a; color: #ddd; font: 14px/1.4 system-ui, sans-serif }}
h1 {{ font-size: 1.1rem }}
main {{ display: grid; grid-template-columns: repeat(auto-fill, minmax(180px, 1fr)); gap: 12px }}
figure {{ margin: 0 }} img {{ width: 100%; height: auto; display: block; border-radius: 4px }}
figcaption {{ padding: 6px 2px; color: #aaa }} b {{ color: #eee }}
</style></head><body><h1>{title}</h1><main>
{cards}
</main></body></html>
"""
