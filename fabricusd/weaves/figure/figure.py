"""A figured weave from artwork: each region of colour in its own weave, floats bounded."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, reads
from fabricusd.fabric import Weave
from fabricusd.weaves.color import RGB, codes_from_palette, describe_code, palette_from_codes
from fabricusd.weaves.draft import LIMIT, Draft
from fabricusd.weaves.figure.regions import (
    DISTINCT,
    Codes,
    border_color,
    figure_color,
    read_artwork,
    regions,
)
from fabricusd.weaves.floats import LOOM_FLOAT, bound_floats, describe_floats, floats
from fabricusd.weaves.parse import parse_weave


@dataclass(frozen=True, kw_only=True)
class Figure:
    """How artwork is woven.

    weaves : (linear colour or None, weave) of each region of the figure; None, for a figure of one
        region, finds the colour in the artwork
    ground_weave : the weave of the ground
    ground_color : linear colour of the ground; None for the commonest along the border
    ends, picks : size of the figure in threads; None for one thread a pixel, or for what keeps the
        artwork's proportions
    pitch_ratio : pitch of the ends over pitch of the picks, for those proportions
    longest : longest float; None for the longest in the regions' own weaves
    """

    weaves: Sequence[tuple[RGB | None, str]] = field(default=((None, "satin 8"),))
    ground_weave: str = "satin 8 weft"
    ground_color: RGB | None = None
    ends: int | None = None
    picks: int | None = None
    pitch_ratio: float = 1.0
    longest: int | None = None


@reads("artwork")
def read_figure(path: str | os.PathLike[str], figure: Figure | None = None) -> Draft:
    """The draft that weaves the artwork in the file `path`.

    The warp has the colour of the figure's largest region, and the weft the ground's. The draft's
    warnings say how large the repeat is, which colour is which weave, and how long the
    floats are.

    Raises FabricError for a file that is not a picture, for a weave that is not one, for colours
    that are too close to tell apart, and for a repeat that is too large.
    """
    figure = figure or Figure()
    where = str(path)
    woven = [parse_weave(figure.ground_weave)] + [parse_weave(weave) for _, weave in figure.weaves]
    weaves = [draft.weave.cells for draft in woven]
    art = read_artwork(path)
    colors = _colors(art, figure, where)
    ends, picks = _size(art, figure, weaves, where)
    region = regions(art, colors, ends, picks)
    i, j = np.arange(ends)[:, None], np.arange(picks)[None, :]
    cells = np.zeros((ends, picks), np.bool_)
    for number, weave in enumerate(weaves):
        m, n = weave.shape
        cells = np.where(region == number, weave[i % m, j % n], cells)
    longest = figure.longest or _own_longest(weaves)
    cells, ties = bound_floats(cells, longest)
    notes = _notes(region, colors, [draft.weave.name for draft in woven])
    found = floats(cells)
    tied = f", {ties} crossings tied to keep them within {longest}" if ties else ""
    notes.append(f"The floats: {describe_floats(found)}{tied}.")
    if found.longest is None or found.longest > longest:
        notes.append(
            f"Some floats stay longer than {longest} threads; allow more, or draw it coarser."
        )
    palette = palette_from_codes(colors)
    largest = 1 + int(np.argmax(np.bincount(region.ravel(), minlength=len(colors))[1:]))
    return Draft(
        weave=Weave(cells, Path(path).stem),
        palette=(palette[largest], palette[0]),
        warp_colors=(0,),
        weft_colors=(1,),
        title=Path(path).stem,
        source=Path(path).name,
        warnings=tuple(notes),
    )


def _colors(art: Codes, figure: Figure, where: str) -> Codes:
    """(k, 3) codes of the regions, the ground first."""
    told = [color for color, _ in figure.weaves]
    if len(told) > 1 and None in told:
        raise FabricError(
            "--figure-weave",
            f"has {len(told)} weaves and not a colour for each; write #c02020=WEAVE, as often as "
            "the figure has colours",
        )
    given = figure.ground_color
    ground = border_color(art) if given is None else codes_from_palette([given])[0].astype(np.uint8)
    rest = [
        figure_color(art, ground, where) if color is None else codes_from_palette([color])[0]
        for color in told
    ]
    colors = np.array([ground, *rest], np.uint8)
    for a in range(len(colors)):
        for b in range(a):
            if np.linalg.norm(colors[a].astype(float) - colors[b]) < DISTINCT:
                ground_too = " of the ground" if b == 0 else ""
                raise FabricError(
                    where,
                    f"would have regions of {describe_code(colors[a])} and "
                    f"{describe_code(colors[b])}{ground_too}; they must be at least "
                    f"{DISTINCT:g} of 255 apart",
                )
    return colors


def _size(
    art: Codes, figure: Figure, weaves: Sequence[NDArray[np.bool_]], where: str
) -> tuple[int, int]:
    """(ends, picks) of the repeat: as asked for, rounded to whole repeats of the weaves."""
    h, w = art.shape[:2]
    ends, picks = figure.ends, figure.picks
    if ends is None and picks is None:
        ends, picks = w, h
    elif picks is None:
        assert ends is not None
        picks = round(ends * h / w * figure.pitch_ratio)
    elif ends is None:
        ends = round(picks * w / h / figure.pitch_ratio)
    sizes = []
    for count, axis in ((ends, 0), (picks, 1)):
        assert count is not None
        step = math.lcm(*(weave.shape[axis] for weave in weaves))
        rounded = max(round(count / step), 1) * step
        # A repeat that is not whole breaks every weave at its border, which floats then bridge.
        sizes.append(rounded if step <= 256 else max(count, 1))
    if max(sizes) > LIMIT:
        raise FabricError(
            where, f"would repeat after {sizes[0]} x {sizes[1]} threads; at most {LIMIT} each way"
        )
    return sizes[0], sizes[1]


def _own_longest(weaves: Sequence[NDArray[np.bool_]]) -> int:
    """The longest float of the weaves themselves, at most `LOOM_FLOAT`, at least 3."""
    lengths = [floats(weave).longest or LOOM_FLOAT for weave in weaves]
    return max(3, min(max(lengths), LOOM_FLOAT))


def _notes(region: NDArray[np.intp], colors: Codes, names: Sequence[str]) -> list[str]:
    """What is woven where, and which colours are nowhere."""
    ends, picks = region.shape
    shares = np.bincount(region.ravel(), minlength=len(colors)) / region.size
    words = [
        f"{describe_code(color)} in {name}, {100 * share:.3g} %"
        for color, name, share in zip(colors, names, shares, strict=True)
    ]
    notes = [f"The repeat is {ends} ends by {picks} picks: ground {'; '.join(words)}."]
    lost = [describe_code(c) for c, share in zip(colors, shares, strict=True) if share == 0]
    if lost:
        notes.append(f"No crossing has the colour {', '.join(lost)}.")
    return notes
