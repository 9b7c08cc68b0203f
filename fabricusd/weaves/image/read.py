"""Weaves from an image, with one pixel for each crossing in the colour of the thread on top.

The top row of the image is the last pick, the left column the first end. A black-and-white image
is a drawdown as weavers draw it: black means warp on top, white means weft. An image with more
colours shows the cloth from above, and each thread has one colour. Which colours are warp is given
by the caller, or follows from the rule that a column has one warp colour and a row one weft colour.
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
from fabricusd.weaves.floats import LOOM_FLOAT, long_float_words
from fabricusd.weaves.image.file import CodeImage
from fabricusd.weaves.image.threads import find_threads

T = TypeVar("T", bound=np.generic)

MODES = ("auto", "black-white", "colors")

WHITE, BLACK, GREY = 191, 64, 24
"""White has every channel at 191 or above, black at 64 or below, all within 24 of each other:
compression blurs the edges of an image, so a quarter of the range at each end is allowed for."""

MOST_COLORS = 64
"""Most colours of an image of threads; an image with more is a photograph."""


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

    mode : str - `black-white`, `colors`, or `auto`: black-white if every pixel is black or white
        and no colours are given
    invert : bool - white means warp on top; in colours, prefer the lightest as warp
    warp_colors, weft_colors : linear colours of the threads of each set, for an image that does not
        determine them; one of the two is enough

    Transparent pixels are white. Raises FabricError for a file that is not an image of 1 to `LIMIT`
    pixels a side and at most `image.file.MOST_PIXELS` altogether, and for the first pixel that
    can be neither warp nor weft.
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
        cells = _cells(_looked_up(image, found, np.asarray(light if invert else dark)))
        return Draft(
            weave=Weave(cells, name),
            title=name,
            source=Path(path).name,
            warnings=(*noticed, *_too_long(cells)),
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
    cells = _cells(threads.warp_on_top)
    return Draft(
        weave=Weave(cells, name),
        palette=palette_from_codes(colors),
        warp_colors=tuple(threads.columns.tolist()),
        weft_colors=tuple(threads.rows[::-1].tolist()),
        title=name,
        source=Path(path).name,
        warnings=(*noticed, *threads.warnings, *_too_long(cells)),
    )


def _too_long(cells: NDArray[np.bool_]) -> tuple[str, ...]:
    """A warning of floats that no loom would make, as artwork has that is taken for a drawdown."""
    words = long_float_words(cells)
    if not words:
        return ()
    return (
        f"The floats are long: {words}. A loom ties them after {LOOM_FLOAT} at most; if this is "
        "artwork and not a drawdown, use --figure.",
    )


def _cells(warp_on_top: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(h, w) image, top row first -> (w, h) cells, first pick first, read-only."""
    cells = np.ascontiguousarray(warp_on_top[::-1].T)
    cells.flags.writeable = False
    return cells


def _marked(image: CodeImage) -> NDArray[np.bool_]:
    """(2^24,) bool: which colours occur. A table is ten times as fast as sorting the pixels."""
    seen = np.zeros(1 << 24, np.bool_)
    for codes in image.bands():
        for row in codes:
            seen[row] = True
    return seen


def _looked_up(image: CodeImage, found: NDArray[np.intp], values: NDArray[T]) -> NDArray[T]:
    """(h, w) - `values[k]` at each pixel that has the colour `found[k]`."""
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
    """Indices of the linear colours `wanted` in `colors`."""
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
