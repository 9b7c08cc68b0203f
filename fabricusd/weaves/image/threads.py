"""The threads in an image of a cloth: a warp colour per column, a weft colour per row."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.weaves.color import describe_code


class Threads(NamedTuple):
    """The threads of an image: palette indices, and where the warp is on top.

    warp_on_top : (h, w) bool
    columns : (w,) int - colour of the warp thread in each column
    rows : (h,) int - colour of the weft thread in each row, top first
    warnings : what had to be assumed
    """

    warp_on_top: NDArray[np.bool_]
    columns: NDArray[np.intp]
    rows: NDArray[np.intp]
    warnings: tuple[str, ...]


def find_threads(
    where: str,
    index: NDArray[np.uint8],
    colors: NDArray[np.uint8],
    warp: Sequence[int] = (),
    weft: Sequence[int] = (),
    lightest_first: bool = False,
) -> Threads:
    """The threads of an image, given as indices `index` (h, w) into `colors` (k, 3).

    `index` is overwritten.

    Each colour belongs to the warp or to the weft. If `warp` or `weft` is given, it says which; if
    only one of them is, all other colours belong to the other set. If neither is, the image
    decides, and where it leaves a choice, the darkest colour is warp, as in a black-and-white
    draft. Raises FabricError, naming a pixel, if a column would have two warp colours, a row two
    weft colours, or if a colour would belong to both sets.
    """
    shown_in_column = np.zeros((index.shape[1], len(colors)), np.bool_)
    shown_in_row = np.zeros((index.shape[0], len(colors)), np.bool_)
    columns_of_row = np.arange(index.shape[1])
    for number, line in enumerate(index):
        shown_in_column[columns_of_row, line] = True
        shown_in_row[number, line] = True
    warnings: list[str] = []
    if warp or weft:
        is_warp = _told(where, index, colors, warp, weft)
    else:
        is_warp = _inferred(
            where, index, colors, shown_in_column, shown_in_row, lightest_first, warnings
        )
    columns = _threads(where, index, colors, shown_in_column & is_warp, "column", warnings)
    rows = _threads(where, index, colors, shown_in_row & ~is_warp, "row", warnings)
    for line in index:  # in place: a second array of this size would be the peak of memory use
        line[:] = is_warp[line]
    return Threads(index.view(np.bool_), columns, rows, tuple(warnings))


def _told(
    where: str,
    index: NDArray[np.uint8],
    colors: NDArray[np.uint8],
    warp: Sequence[int],
    weft: Sequence[int],
) -> NDArray[np.bool_]:
    in_warp, in_weft = (np.isin(np.arange(len(colors)), told) for told in (warp, weft))
    if not len(weft):
        in_weft = ~in_warp
    if not len(warp):
        in_warp = ~in_weft
    unclear = in_warp == in_weft
    if unclear.any():
        x, y, code = _first(index, unclear, colors)
        both = in_warp[index[y, x]]
        raise FabricError(
            f"{where} pixel ({x}, {y})",
            f"is {code}, a colour of {'both sets' if both else 'neither set'}; it must be a "
            "colour of the warp or of the weft",
        )
    return np.asarray(in_warp)


def _inferred(
    where: str,
    index: NDArray[np.uint8],
    colors: NDArray[np.uint8],
    shown_in_column: NDArray[np.bool_],
    shown_in_row: NDArray[np.bool_],
    lightest_first: bool,
    warnings: list[str],
) -> NDArray[np.bool_]:
    """(k,) bool, True for warp: of two colours in a column at least one is weft, and of two in a
    row at least one is warp."""
    share_column = shown_in_column.T.astype(int) @ shown_in_column > 0
    share_row = shown_in_row.T.astype(int) @ shown_in_row > 0
    np.fill_diagonal(share_column, False)
    np.fill_diagonal(share_row, False)
    order = np.argsort(colors.astype(int).sum(axis=1), kind="stable")
    if lightest_first:
        order = order[::-1]
    known: dict[int, bool] = {}
    free = []
    for color in order.tolist():
        if color in known:
            continue
        # Every constraint is between two colours, so a choice that leads to no contradiction can
        # be kept, whatever is chosen for the colours that it does not reach.
        as_warp = _followed(known, color, True, share_column, share_row)
        as_weft = _followed(known, color, False, share_column, share_row)
        chosen = as_warp if as_warp is not None else as_weft
        if chosen is None:
            x, y, code = _first(index, np.arange(len(colors)) == color, colors)
            raise FabricError(
                f"{where} pixel ({x}, {y})",
                f"is {code}, which can be neither warp nor weft throughout the image; give the "
                "colours of the warp or of the weft",
            )
        if as_warp is not None and as_weft is not None:
            free.append(describe_code(colors[color]))
        known = chosen
    if free:
        warnings.append(
            f"The image does not say whether {', '.join(free)} is warp or weft; taken as warp."
        )
    return np.array([known[k] for k in range(len(colors))])


def _followed(
    known: dict[int, bool],
    color: int,
    warp: bool,
    share_column: NDArray[np.bool_],
    share_row: NDArray[np.bool_],
) -> dict[int, bool] | None:
    """`known`, with `color` decided and all that follows from that; None for a contradiction."""
    known = dict(known)
    todo = [(color, warp)]
    while todo:
        k, is_warp = todo.pop()
        if k in known:
            if known[k] != is_warp:
                return None
            continue
        known[k] = is_warp
        follows = share_column[k] if is_warp else share_row[k]
        todo += [(int(other), not is_warp) for other in np.flatnonzero(follows)]
    return known


def _threads(
    where: str,
    index: NDArray[np.uint8],
    colors: NDArray[np.uint8],
    shown: NDArray[np.bool_],
    line: str,
    warnings: list[str],
) -> NDArray[np.intp]:
    """(lines,) int: the one colour of its set in each line; the commonest if a line has none."""
    counts = shown.sum(axis=1)
    label = "warp" if line == "column" else "weft"
    if not counts.any():
        raise FabricError(
            where, f"shows no {label} thread; it must show the {label} in at least one {line}"
        )
    if counts.max() > 1:
        number = int(np.argmax(counts > 1))
        first, second = np.flatnonzero(shown[number])[:2]
        place = index[:, number] if line == "column" else index[number]
        at = int(np.argmax(place == second))
        x, y = (number, at) if line == "column" else (at, number)
        raise FabricError(
            f"{where} pixel ({x}, {y})",
            f"is {describe_code(colors[second])}, but its {line} shows the {label} colour "
            f"{describe_code(colors[first])} too; a thread must have one colour",
        )
    usual = int(np.argmax(shown.sum(axis=0)))
    hidden = int((counts == 0).sum())
    if hidden:
        warnings.append(
            f"{hidden} {line}(s) show no {label}; the {label} is taken to be "
            f"{describe_code(colors[usual])} there."
        )
    return np.where(counts > 0, np.argmax(shown, axis=1), usual)


def _first(
    index: NDArray[np.uint8], wanted: NDArray[np.bool_], colors: NDArray[np.uint8]
) -> tuple[int, int, str]:
    """(x, y, colour as #rrggbb) of the first pixel that has a wanted colour."""
    y, x = np.unravel_index(int(np.argmax(wanted[index])), index.shape)
    return int(x), int(y), describe_code(colors[index[y, x]])
