"""Show a map of a bake on a page: a part of its finest level in its own range, and the legend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.bake.layout.garment import Garment
from fabricusd.bake.texels.maps import TextureMap
from fabricusd.srgb import srgb_encode

CELLS = 32
"""Cells of UV space along a side, in which the fullest part of a layout is looked for."""


GROUND = 154
"""Grey of the ground on which maps are shown: black and white stand out from it alike."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """A map as the page shows it.

    picture : (h, w, 3) uint8
    legend : what the colours stand for, in words
    low, high : values at the black and the white end of the grey scale; None for a map whose
        channels are colours
    """

    picture: NDArray[np.uint8]
    legend: str
    low: float | None = None
    high: float | None = None


def fullest(one: Garment, number: int, share: float) -> tuple[float, float]:
    """(u, v) middle of the square of side `share` [UV] that holds most of the layout.

    number : UDIM tile, 1001 for the unit square
    """
    column, row = (number - 1001) % 10, (number - 1001) // 10
    uv = one.uv - (column, row)
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    centre = uv.mean(axis=1)
    edges = np.linspace(0.0, 1.0, CELLS + 1)
    held, _, _ = np.histogram2d(centre[:, 0], centre[:, 1], (edges, edges), weights=area)
    size = min(max(round(share * CELLS), 1), CELLS)
    sums = np.zeros((CELLS + 1, CELLS + 1))
    sums[1:, 1:] = held.cumsum(axis=0).cumsum(axis=1)
    inside = sums[size:, size:] - sums[:-size, size:] - sums[size:, :-size] + sums[:-size, :-size]
    # Of equally full squares, the one in the middle.
    off = np.abs(np.arange(CELLS - size + 1) - (CELLS - size) / 2)
    inside = inside - 1e-9 * inside.max() * (off[:, None] + off)
    i, j = np.unravel_index(int(inside.argmax()), inside.shape)
    return float((i + size / 2) / CELLS), float((j + size / 2) / CELLS)


def shown(pixels: NDArray[Any], one: TextureMap, covered: NDArray[np.bool_] | None = None) -> Shown:
    """The picture of a map and its legend.

    pixels : (h, w, c) values. Colours are encoded as sRGB, directions mapped from -1..1 to black..
        white, and any other map is scaled from its least to its greatest value
    covered : (h, w) - texels inside the layout; the others are shown as GROUND and do not count
    """
    inside = np.ones(pixels.shape[:2], bool) if covered is None else covered
    if not inside.any():
        return Shown(
            picture=np.full((*pixels.shape[:2], 3), GROUND, np.uint8), legend="nothing in this part"
        )
    found = _coloured(pixels, one, inside)
    found.picture[~inside] = GROUND
    return found


def _coloured(pixels: NDArray[Any], one: TextureMap, inside: NDArray[np.bool_]) -> Shown:
    """`shown`, with whatever colours outside of the layout."""
    part = np.asarray(pixels[..., :3], np.float64)
    unit = f" {one.unit}" if one.unit and one.kind_of not in ("direction", "axis") else ""
    if one.kind_of in ("direction", "axis"):
        words = "red: along u, green: along v, blue: out of the cloth; grey is 0, full colour 1"
        return Shown(picture=_codes(0.5 * part + 0.5), legend=words)
    if one.color:
        mean = _codes(srgb_encode(part[inside].mean(axis=0)))
        words = f"colour as sRGB; mean #{mean[0]:02x}{mean[1]:02x}{mean[2]:02x}"
        return Shown(picture=_codes(srgb_encode(np.clip(part, 0.0, 1.0))), legend=words)
    low, high = float(part[inside].min()), float(part[inside].max())
    if abs(low) < 1e-3 * abs(high):
        # Rounding, not a value to read.
        low = 0.0
    if high == low:
        words = f"{_number(low)}{unit} everywhere in this part"
        return Shown(picture=np.full((*part.shape[:2], 3), 128, np.uint8), legend=words)
    scaled = (part - low) / (high - low)
    if part.shape[2] == 1:
        words = f"{_number(low)} to {_number(high)}{unit}"
        grey = _codes(np.repeat(scaled, 3, axis=2))
        return Shown(picture=grey, legend=words, low=low, high=high)
    colors = ("red", "green", "blue")[: part.shape[2]]
    if part.shape[2] == 2:
        scaled = np.concatenate((scaled, np.zeros_like(scaled[..., :1])), axis=2)
    words = (
        f"{', '.join(colors)}: one number each, {_number(low)} (dark) to {_number(high)} (bright)"
    )
    words += unit
    if len(one.channels) > 3:
        words += "; the fourth number is not shown"
    return Shown(picture=_codes(scaled), legend=words)


def _codes(share: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.asarray(np.rint(np.clip(share, 0.0, 1.0) * 255), np.uint8)


def _number(value: float) -> str:
    return f"{value:.3g}"
