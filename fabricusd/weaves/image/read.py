"""Weaves from an image: a pixel for each crossing, its colour that of the thread on top.

The top row of the image is the last pick, the left column the first end. A black-and-white image
is a drawdown as weavers draw it: black is warp on top, white is weft. An image of more colours is
the cloth seen from above, one colour a thread: which colours are warp follows from the rule that
a column has one warp colour and a row one weft colour, or is told.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, reads
from fabricusd.fabric import Weave
from fabricusd.weaves.color import (
    RGB,
    codes_from_palette,
    describe_code,
    palette_from_codes,
)
from fabricusd.weaves.draft import LIMIT, Draft
from fabricusd.weaves.image.file import CodeImage
from fabricusd.weaves.image.threads import find_threads

T = TypeVar("T", bound=np.generic)

MODES = ("auto", "black-white", "colors")

WHITE, BLACK, GREY = 191, 64, 24
"""White has all channels from 191, black up to 64, within 24 of each other: compressed images
blur their edges, and a quarter of the range each way is blur."""

MOST_COLORS = 64
"""More colours than this are a photograph, not threads."""


@reads("a draft")
def read_image(
    path: str | os.PathLike[str],
    *,
    mode: str = "auto",
    invert: bool = False,
    warp_colors: Sequence[RGB] = (),
    weft_colors: Sequence[RGB] = (),
) -> Draft:
    """The draft in the image `path`, in any format that OpenImageIO reads.

    mode : str - `black-white`, `colors`, or `auto`: black-white where every pixel is one of them
        and no colours are given
    invert : bool - white is warp on top; in colours, warp is looked for among the lightest
    warp_colors, weft_colors : linear colours of the threads of each set, where the image alone
        does not tell; one of the two is enough

    Transparent pixels are white. Raises FabricError for what is not an image of 1 to `LIMIT`
    pixels a side and at most `image_file.MOST_PIXELS` altogether, and for the first pixel that
    cannot be told to be warp or weft.
    """
    if mode not in MODES:
        raise FabricError("mode", f"is '{mode}'; it must be one of {', '.join(MODES)}")
    image = CodeImage(path, LIMIT)
    found = np.flatnonzero(_marked(image))
    colors = np.stack((found >> 16, (found >> 8) & 255, found & 255), axis=1).astype(np.uint8)
    name, where = Path(path).stem, str(path)
    noticed = ("The file holds several pictures; the first is read.",) if image.several else ()
    told = bool(warp_colors or weft_colors)
    light, dark = (colors >= WHITE).all(axis=1), (colors <= BLACK).all(axis=1)
    plain = (light | dark) & (np.ptp(colors.astype(int), axis=1) <= GREY)
    if mode == "black-white" or (mode == "auto" and not told and bool(plain.all())):
        if not plain.all():
            wrong = int(np.argmax(_looked_up(image, found, ~plain)))
            y, x = (int(n) for n in np.unravel_index(wrong, image.shape))
            code = f"#{image.pixel(x, y):06x}"
            raise FabricError(f"{where} pixel ({x}, {y})", f"is {code}; it must be black or white")
        warp_on_top = _looked_up(image, found, np.asarray(light if invert else dark))
        return Draft(
            weave=Weave(_cells(warp_on_top), name),
            title=name,
            source=Path(path).name,
            warnings=noticed,
        )
    if len(colors) > MOST_COLORS:
        raise FabricError(
            where, f"has {len(colors)} colours; it must have at most {MOST_COLORS}, one a thread"
        )
    threads = find_threads(
        where,
        _looked_up(image, found, np.arange(len(colors), dtype=np.uint8)),
        colors,
        _indices(warp_colors, colors, "warp"),
        _indices(weft_colors, colors, "weft"),
        lightest_first=invert,
    )
    return Draft(
        weave=Weave(_cells(threads.warp_on_top), name),
        palette=palette_from_codes(colors),
        warp_colors=tuple(threads.columns.tolist()),
        weft_colors=tuple(threads.rows[::-1].tolist()),
        title=name,
        source=Path(path).name,
        warnings=(*noticed, *threads.warnings),
    )


def _cells(warp_on_top: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(h, w) image, top row first -> (w, h) cells, first pick first, read-only."""
    cells = np.ascontiguousarray(warp_on_top[::-1].T)
    cells.flags.writeable = False
    return cells


def _marked(image: CodeImage) -> NDArray[np.bool_]:
    """(2^24,) bool: which colours there are. A table is ten times as fast as sorting them."""
    seen = np.zeros(1 << 24, np.bool_)
    for codes in image.bands():
        for row in codes:
            seen[row] = True
    return seen


def _looked_up(image: CodeImage, found: NDArray[np.intp], values: NDArray[T]) -> NDArray[T]:
    """`values[k]` at each pixel of the colour `found[k]`, (h, w)."""
    table = np.zeros(1 << 24, values.dtype)
    table[found] = values
    result = np.empty(image.shape, values.dtype)
    begin = 0
    for codes in image.bands():
        end = begin + len(codes)
        for row, into in zip(codes, result[begin:end], strict=True):
            np.take(table, row, out=into, mode="clip")
        begin = end
    return result


def _indices(wanted: Sequence[RGB], colors: NDArray[np.uint8], label: str) -> list[int]:
    """Where the linear colours `wanted` stand in `colors`."""
    indices = []
    for code in codes_from_palette(wanted):
        match = np.flatnonzero((colors == code).all(axis=1))
        if not len(match):
            raise FabricError(
                f"{label} colour {describe_code(code)}",
                "is not in the image; it must be one of "
                + ", ".join(describe_code(c) for c in colors[:12])
                + (", ..." if len(colors) > 12 else ""),
            )
        indices.append(int(match[0]))
    return indices
