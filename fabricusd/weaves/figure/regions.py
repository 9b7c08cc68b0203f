"""The regions of artwork: which of a few colours each crossing of the cloth has.

Artwork has blurred edges. The blend of two colours there may be close to a third, so the regions
are found softly: every pixel belongs to every colour by a share, pixels on an edge count for
little, and a crossing takes the colour with the largest mean share around it.
"""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fabricusd.errors import FabricError
from fabricusd.weaves.color import describe_code
from fabricusd.weaves.draft import LIMIT
from fabricusd.weaves.image.file import CodeImage

Codes = NDArray[np.uint8]
Floats = NDArray[np.float32]

MOST_PIXELS = 2**24
"""Most pixels of artwork, 4096 x 4096: all of them are in memory at once."""

SPREAD = 20.0
"""Distance of display codes at which a pixel belongs to a colour by exp(-1/2)."""

EDGE = 16.0
"""Difference of neighbouring codes at which a pixel has half its say."""

DISTINCT = 24.0
"""Smallest distance of the codes of two regions."""

ROUNDS = 12
"""Rounds of the search for the figure's colour; it settles after three or four."""


def read_artwork(path: str | os.PathLike[str]) -> Codes:
    """(h, w, 3) display codes, top row first; FabricError for a file that is not a picture."""
    image = CodeImage(path, LIMIT)
    h, w = image.shape
    if h * w > MOST_PIXELS:
        raise FabricError(
            str(path), f"is {w} x {h} pixels; artwork must have at most {MOST_PIXELS}"
        )
    codes = np.concatenate(list(image.bands()))
    return np.stack((codes >> 16, (codes >> 8) & 255, codes & 255), axis=-1).astype(np.uint8)


def border_color(art: Codes) -> Codes:
    """(3,) the commonest colour along the border of the artwork."""
    border = np.concatenate((art[0], art[-1], art[:, 0], art[:, -1]))
    found, counts = np.unique(border, axis=0, return_counts=True)
    return np.asarray(found[np.argmax(counts)])


def figure_color(art: Codes, ground: Codes, where: str) -> Codes:
    """(3,) the mean colour of what is not ground; FabricError where everything is."""
    # Colours in steps of 8 are fine enough for a mean, and few enough to count.
    steps = art.reshape(-1, 3).astype(np.uint32) >> 3
    counts = np.bincount((steps[:, 0] << 10) | (steps[:, 1] << 5) | steps[:, 2], minlength=1 << 15)
    used = np.flatnonzero(counts)
    colors = np.stack((used >> 10, (used >> 5) & 31, used & 31), axis=1) * 8.0 + 4.0
    weights = counts[used].astype(float)
    distance = np.linalg.norm(colors - ground, axis=1)
    if distance.max() < DISTINCT:
        raise FabricError(
            where,
            f"is {describe_code(ground)} everywhere; a figure must have a colour of its own",
        )
    figure = colors[np.argmax(distance)]
    for _ in range(ROUNDS):
        near = np.linalg.norm(colors - figure, axis=1) < distance
        figure = (colors[near] * weights[near, None]).sum(axis=0) / weights[near].sum()
    return np.asarray(np.clip(np.rint(figure), 0, 255), np.uint8)


def regions(art: Codes, colors: Codes, ends: int, picks: int) -> NDArray[np.intp]:
    """(ends, picks) int, the index in `colors` (k, 3) of each crossing's region.

    The top row of the artwork is the last pick, its left column the first end.
    """
    shares = np.stack(_shares(art, colors.astype(np.float32), ends, picks))
    # A pixel is smeared over a crossing's neighbours, and over a larger pixel's own width.
    blur = [max(0.6, 0.5 * n / size) for n, size in zip((picks, ends), art.shape[:2], strict=True)]
    for share in shares:
        ndimage.gaussian_filter(share, blur, mode="wrap", output=share)
    index = np.argmax(shares, axis=0)
    return np.ascontiguousarray(index[::-1].T)


def _shares(art: Codes, colors: Floats, ends: int, picks: int) -> list[Floats]:
    """(picks, ends) sums of each colour's weighted shares, top row first."""
    say = _say(art)
    sums = [np.zeros((picks, ends), np.float32) for _ in colors]
    columns, rows = _edges(art.shape[1], ends), _edges(art.shape[0], picks)
    for first in range(0, picks, 64):
        last = min(first + 64, picks)
        top, bottom = rows[0][first], rows[1][last - 1]
        block, weight = art[top:bottom].astype(np.float32), say[top:bottom]
        squares = np.stack([((block - color) ** 2).sum(axis=-1) for color in colors])
        squares -= squares.min(axis=0)
        member = np.exp(-squares / (2 * SPREAD**2))
        member *= weight / member.sum(axis=0)
        begin, end = rows[0][first:last] - top, rows[1][first:last] - top
        for total, values in zip(sums, member, strict=True):
            total[first:last] = _added(_added(values, begin, end).T, *columns).T
    return sums


def _say(art: Codes) -> Floats:
    """(h, w) weight of each pixel: small where a neighbour has another colour."""
    weight = np.zeros(art.shape[:2], np.float32)
    for axis in (0, 1):
        ahead = np.abs(art.astype(np.int16) - np.roll(art, -1, axis).astype(np.int16)).max(axis=-1)
        np.maximum(weight, ahead, out=weight)
        np.maximum(weight, np.roll(ahead, 1, axis), out=weight)
    return np.asarray(1.0 / (1.0 + (weight / EDGE) ** 2), np.float32)


def _edges(size: int, count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First pixel of each of `count` threads over `size` pixels, and the one after its last."""
    at = np.arange(count + 1) * size / count
    begin = np.floor(at[:-1]).astype(np.intp)
    return begin, np.maximum(np.floor(at[1:]).astype(np.intp), begin + 1)


def _added(values: Floats, begin: NDArray[np.intp], end: NDArray[np.intp]) -> Floats:
    """Sums of rows `begin[k]` to `end[k]` of `values`."""
    total = np.zeros((len(values) + 1, values.shape[1]), np.float64)
    np.cumsum(values, axis=0, out=total[1:])
    return np.asarray(total[end] - total[begin], np.float32)
