"""Drawing a draft in a terminal, the way weavers draw it.

The threading runs across the top (shaft 1 lowest), the tie-up is in the corner, the treadling at
the right, and the drawdown below the threading: a square is filled where the warp is on top. End 1
is at the left and pick 1 at the bottom, so that the drawdown looks like the cloth, U to the right
and V up.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fabricusd.fabric import Fabric
from fabricusd.weaves.color import codes_from_palette
from fabricusd.weaves.convert import from_fabric
from fabricusd.weaves.draft import Draft
from fabricusd.weaves.loom import Loom, thread_loom

MOST_SHAFTS = 40
"""Most shafts that are drawn: a weave with more is a jacquard, whose threading says nothing."""

SMALLEST = 8
"""Fewest threads that are drawn: smaller repeats are drawn several times over."""

BLANK, EMPTY, FILLED, FIRST_COLOR = 0, 1, 2, 3
"""Values of a square in the drawing; FIRST_COLOR + k is colour k of the palette."""

INK, PAPER = (24, 24, 24), (232, 232, 232)

Squares = NDArray[np.int64]


def draw(
    fabric: Fabric,
    width: int | None = 80,
    height: int | None = 40,
    color: bool = False,
    ascii_only: bool = False,
) -> str:
    """The draft of `fabric`, at most `width` characters by `height` lines; None means no limit.

    color : bool - draw each square of the drawdown in the colour of the thread on top, by 24-bit
        colour escapes, if the threads have more than one colour
    ascii_only : bool - draw with `#` and `.`, one character a square, instead of half blocks
    """
    return draw_draft(from_fabric(fabric), width, height, color, ascii_only)


def draw_draft(
    draft: Draft,
    width: int | None = 80,
    height: int | None = 40,
    color: bool = False,
    ascii_only: bool = False,
) -> str:
    """Like `draw`, for a draft."""
    ends, picks = (
        _total(draft.weave.ends, draft.warp_colors),
        _total(draft.weave.picks, draft.weft_colors),
    )
    columns = max(width, SMALLEST) if width is not None else ends + picks + 10**6
    lines = max(height - 3, SMALLEST) if height is not None else ends + picks + 10**6
    rows = lines * (1 if ascii_only else 2)
    loom = thread_loom(draft.weave.cells)
    words = _caption(draft, loom)
    frame = (loom.treadles + 1, loom.shafts + 1)
    # Leave out a frame that would take too much room from the cloth.
    framed = loom.shafts <= MOST_SHAFTS
    framed = framed and columns - frame[0] >= min(ends, max(columns // 3, SMALLEST))
    framed = framed and rows - frame[1] >= min(picks, max(rows // 3, SMALLEST))
    if framed:
        columns, rows = columns - frame[0], rows - frame[1]
    shown = min(ends, columns), min(picks, rows)
    canvas = _drawdown(draft, *shown, color=color)
    if framed:
        canvas = _framed(canvas, loom)
    palette = _palette(draft)
    text = [_line(pair, palette, color, ascii_only) for pair in _pairs(canvas, ascii_only)]
    sets = zip((ends, picks), shown, ("ends", "picks"), strict=True)
    left = [f"{total - part} {word}" for total, part, word in sets if total > part]
    if left:
        text.append(("..." if ascii_only else "…") + f" and {', '.join(left)} more")
    return "\n".join([*text, *words])


def _total(threads: int, colors: tuple[int, ...]) -> int:
    """Threads after which weave and colours repeat together, repeated up to at least SMALLEST."""
    total = math.lcm(threads, len(colors) or 1)
    return total * -(-SMALLEST // total)


def _caption(draft: Draft, loom: Loom) -> list[str]:
    weave = draft.weave
    words = [f"{weave.name or 'weave'}: {weave.ends} ends x {weave.picks} picks"]
    if loom.shafts <= MOST_SHAFTS:
        words[0] += f", {loom.shafts} shafts, {loom.treadles} treadles"
    words.append("end 1 at the left, pick 1 at the bottom; filled: warp on top")
    return words


def _drawdown(draft: Draft, ends: int, picks: int, color: bool) -> Squares:
    """(picks, ends) squares of the first ends and picks, the last pick in the top row."""
    i, j = np.arange(ends), np.arange(picks)
    cells = draft.weave.cells[np.ix_(i % draft.weave.ends, j % draft.weave.picks)]
    squares = np.where(cells, FILLED, EMPTY)
    if color and len(draft.palette) > 1:
        warp = np.array(draft.warp_colors)[i % len(draft.warp_colors)]
        weft = np.array(draft.weft_colors)[j % len(draft.weft_colors)]
        squares = FIRST_COLOR + np.where(cells, warp[:, None], weft[None, :])
    return squares.T[::-1]


def _framed(drawdown: Squares, loom: Loom) -> Squares:
    """`drawdown` with threading above, treadling to the right and the tie-up in the corner."""
    picks, ends = drawdown.shape
    canvas = np.full((loom.shafts + 1 + picks, ends + 1 + loom.treadles), BLANK)
    top, right = slice(0, loom.shafts), slice(ends + 1, None)
    threading = loom.threading[np.arange(ends) % len(loom.threading)]
    treadling = loom.treadling[np.arange(picks) % len(loom.treadling)]
    shafts, treadles = np.arange(loom.shafts)[::-1], np.arange(loom.treadles)
    canvas[top, :ends] = np.where(shafts[:, None] == threading, FILLED, EMPTY)
    canvas[top, right] = np.where(loom.tie_up[:, shafts].T, FILLED, EMPTY)
    canvas[loom.shafts + 1 :, right] = np.where(treadles == treadling[::-1, None], FILLED, EMPTY)
    canvas[loom.shafts + 1 :, :ends] = drawdown
    return canvas


def _palette(draft: Draft) -> list[tuple[int, int, int] | None]:
    """The 8-bit display colour of each value of a square; None is the terminal's own colour."""
    colors = [(int(r), int(g), int(b)) for r, g, b in codes_from_palette(draft.palette)]
    return [None, PAPER, INK, *colors]


def _pairs(canvas: Squares, ascii_only: bool) -> list[tuple[Squares, Squares | None]]:
    """The rows of squares that share a line of text: two, or one in ASCII."""
    if ascii_only:
        return [(row, None) for row in canvas]
    if len(canvas) % 2:
        canvas = np.vstack([np.full_like(canvas[:1], BLANK), canvas])
    return list(zip(canvas[::2], canvas[1::2], strict=True))


def _line(
    pair: tuple[Squares, Squares | None],
    palette: list[tuple[int, int, int] | None],
    color: bool,
    ascii_only: bool,
) -> str:
    """One line of text for one or two rows of squares."""
    upper, lower = pair
    if not color:
        if lower is None:
            return "".join(" .#"[square] for square in upper).rstrip()
        both = 2 * (upper == FILLED) + (lower == FILLED)
        return "".join(" ▄▀█"[k] for k in both).rstrip()
    text, style = [], ""
    for k, top in enumerate(upper.tolist()):
        bottom = top if lower is None else int(lower[k])
        mark, wanted = _mark(palette[top], palette[bottom], ascii_only)
        if wanted != style:
            text.append(f"\x1b[0{wanted}m")
            style = wanted
        text.append(mark)
    return "".join(text) + ("\x1b[0m" if style else "")


def _mark(
    top: tuple[int, int, int] | None, bottom: tuple[int, int, int] | None, ascii_only: bool
) -> tuple[str, str]:
    """(character, colour escape) for two squares, one above the other."""
    if top is None and bottom is None:
        return " ", ""
    if top is None or bottom is None:
        r, g, b = top or bottom or INK
        return ("▀" if bottom is None else "▄"), f";38;2;{r};{g};{b}"
    if top == bottom:
        return " ", ";48;2;{};{};{}".format(*top)
    return "▀", ";38;2;{};{};{};48;2;{};{};{}".format(*top, *bottom)
