"""Weaves that have a name. To add one, write a function and decorate it with `@named(...)`.

A function takes the words after the name and returns a `Draft` without a title. Everywhere below,
`cells[i, j]` is the crossing of end `i` and pick `j`, True where the warp is on top.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.fabric import Weave
from fabricusd.weaves.draft import Draft, quoted

LARGEST = 4096
"""Most threads in the repeat of a named weave, each way."""

DARK = (0.02, 0.02, 0.02)
LIGHT = (0.8, 0.8, 0.8)


Make = Callable[[list[str]], Draft]


class Named(NamedTuple):
    """One entry of `WEAVES`: an example of how it is written, and the function that makes it."""

    form: str
    make: Make


WEAVES: dict[str, Named] = {}
"""Name -> entry, in the order in which messages and help list them."""


def named(name: str, form: str) -> Callable[[Make], Make]:
    """Register the decorated function as the weave `name`, written like `form`."""

    def register(make: Make) -> Make:
        WEAVES[name] = Named(form, make)
        return make

    return register


def parse_named(text: str) -> Draft:
    """The draft of a named weave such as `twill 2/2 S`.

    Raises FabricError for a name that is not in `WEAVES` and for words that do not fit the name.
    """
    words = text.lower().split()
    entry = WEAVES.get(words[0]) if words else None
    if entry is None:
        raise FabricError(
            f"weave {quoted(text)}", f"is not a named weave; it must be one of {forms()}"
        )
    try:
        draft = entry.make(words[1:])
    except FabricError as error:
        raise error.inside(f"weave {quoted(text)}") from None
    return replace(draft, title=draft.weave.name, source=text)


def forms() -> str:
    """An example of every named weave, for messages and help."""
    return ", ".join(entry.form for entry in WEAVES.values())


@named("plain", "plain")
def plain(words: list[str]) -> Draft:
    """One over, one under."""
    _expect_none(words, "plain")
    return Draft(weave=Weave(np.eye(2, dtype=bool), "plain"))


@named("basket", "basket 2/2")
def basket(words: list[str]) -> Draft:
    """Plain weave in blocks of `a` ends by `b` picks."""
    runs, words = _take_runs(words, "basket 2/2")
    _expect_none(words, "basket 2/2")
    if len(runs) > 2:
        raise FabricError("", f"has {len(runs)} numbers; it must have 2, ends/picks")
    a, b = (runs[0], runs[-1])
    i, j = _grid(2 * a, 2 * b)
    return Draft(weave=Weave((i // a + j // b) % 2 == 0, f"basket {a}/{b}"))


@named("twill", "twill 2/1 S")
def twill(words: list[str]) -> Draft:
    """Over and under the given numbers of picks, moved by a pick from end to end: Z up, S down."""
    runs, words = _take_runs(words, "twill 2/1 S")
    hand = _take_word(words, ("s", "z"), "z").upper()
    _expect_none(words, "twill 2/1 S")
    over = _over(runs)
    i, j = _grid(len(over), len(over))
    cells = over[(j - i if hand == "Z" else j + i) % len(over)]
    return Draft(weave=Weave(cells, f"twill {_slashes(runs)} {hand}"))


@named("satin", "satin 5 step 2 weft")
def satin(words: list[str]) -> Draft:
    """One tie in N picks, `step` picks further on each end, so that no two ties are neighbours.

    A weft-faced satin is cells = mod(step i + j, N) == 0; the warp-faced one, the default, is its
    complement. The step must be from 2 to N - 2 and coprime to N; otherwise the weave is a twill,
    or has picks without a tie (MODEL section 1).
    """
    form = "satin 5 step 2"
    if not words:
        raise FabricError("", f"is missing its number of threads; write it as in {form}")
    first, _, slash_step = words.pop(0).partition("/")
    count = _number(first, form)
    step = _number(slash_step, form) if slash_step else 0
    if words and words[0] == "step":
        if slash_step or len(words) < 2:
            raise FabricError("step", f"must be one number; write it as in {form}")
        step = _number(words[1], form)
        words = words[2:]
    face = _take_word(words, ("warp", "weft"), "warp")
    _expect_none(words, form)
    good = [s for s in range(2, count - 1) if math.gcd(s, count) == 1]
    if not good:
        raise FabricError("", "has no possible step; a satin must have 5, 7 or more threads")
    step = step or good[0]
    if step not in good:
        shown = ", ".join(map(str, good[:12])) + (", ..." if len(good) > 12 else "")
        raise FabricError("step", f"is {step}; with {count} threads it must be {shown}")
    i, j = _grid(count, count)
    tie = (step * i + j) % count == 0
    name = f"satin {count} step {step}" + (" weft" if face == "weft" else "")
    return Draft(weave=Weave(tie if face == "weft" else ~tie, name))


@named("herringbone", "herringbone 2/2 8")
def herringbone(words: list[str]) -> Draft:
    """Stripes of Z and S twill of the given number of ends; the lines break where stripes meet."""
    form = "herringbone 2/2 8"
    runs, words = _take_runs(words, form)
    over = _over(runs)
    width = _number(words.pop(0), form) if words else 2 * len(over)
    _expect_none(words, form)
    i, j = _grid(2 * width, len(over))
    t = i - width
    # Skip half a repeat at the turn: in 2/2, the two ends there are opposites of each other. This
    # cut tells a herringbone from a point twill.
    lag = np.where(t < 0, i, width - 1 + len(over) // 2 - t)
    return Draft(weave=Weave(over[(j - lag) % len(over)], f"herringbone {_slashes(runs)} {width}"))


@named("point", "point 2/2 8")
def point(words: list[str]) -> Draft:
    """Twill that reverses after the given number of ends: chevrons."""
    form = "point 2/2 8"
    runs, words = _take_runs(words, form)
    over = _over(runs)
    width = _number(words.pop(0), form) if words else len(over)
    _expect_none(words, form)
    if width < 2:
        raise FabricError("", f"turns every {width} ends; that number must be at least 2")
    i, j = _grid(2 * width - 2, len(over))
    lag = np.minimum(i, 2 * width - 2 - i)
    return Draft(weave=Weave(over[(j - lag) % len(over)], f"point {_slashes(runs)} {width}"))


@named("diamond", "diamond 2/2 8")
def diamond(words: list[str]) -> Draft:
    """Twill that reverses after a given number of ends and picks: diamonds, bird's eye if small."""
    form = "diamond 2/2 8"
    runs, words = _take_runs(words, form)
    over = _over(runs)
    width = _number(words.pop(0), form) if words else len(over)
    _expect_none(words, form)
    if width < 2:
        raise FabricError("", f"turns every {width} threads; that number must be at least 2")
    i, j = _grid(2 * width - 2, 2 * width - 2)
    lag, row = np.minimum(i, 2 * width - 2 - i), np.minimum(j, 2 * width - 2 - j)
    return Draft(weave=Weave(over[(row - lag) % len(over)], f"diamond {_slashes(runs)} {width}"))


@named("houndstooth", "houndstooth")
def houndstooth(words: list[str]) -> Draft:
    """Twill 2/2 with four dark and four light threads in turn, in warp and weft."""
    _expect_none(words, "houndstooth")
    order = (0,) * 4 + (1,) * 4
    weave = Weave(twill(["2/2"]).weave.cells, "houndstooth")
    return Draft(weave=weave, palette=(DARK, LIGHT), warp_colors=order, weft_colors=order)


@named("ripstop", "ripstop 24/3")
def ripstop(words: list[str]) -> Draft:
    """Plain weave with a grid of cords: of every so many threads, the last few weave as one."""
    form = "ripstop 24/3"
    runs, words = _take_runs(words, form)
    _expect_none(words, form)
    if len(runs) > 2:
        raise FabricError("", f"has {len(runs)} numbers; it must have 2, threads/cord")
    width, cord = runs[0], (runs[1] if len(runs) > 1 else 2)
    if not 2 <= cord <= width - 2:
        raise FabricError(
            "", f"has cords of {cord} in {width} threads; that number must be from 2 to {width - 2}"
        )
    # A cord counts as one thread: where their number is odd, the next cord is the opposite.
    taken = width - cord + 1
    count = width if taken % 2 == 0 else 2 * width
    i, j = (k // width * taken + np.minimum(k % width, taken - 1) for k in _grid(count, count))
    name = f"ripstop {width}/{cord}"
    return Draft(weave=Weave((i + j) % 2 == 0, name))


def _over(runs: list[int]) -> NDArray[np.bool_]:
    """Alternating runs of over and under: 2/1 -> [True, True, False]."""
    if len(runs) % 2:
        raise FabricError(
            f"'{_slashes(runs)}'", "must be pairs of over and under, as in 2/1 or 3/1/1/3"
        )
    return np.repeat(np.arange(len(runs)) % 2 == 0, runs)


def _grid(m: int, n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """End numbers as a column, pick numbers as a row."""
    if max(m, n) > LARGEST:
        raise FabricError("repeat", f"is {m} x {n}; it must be at most {LARGEST} each way")
    return np.arange(m)[:, None], np.arange(n)[None, :]


def _take_runs(words: list[str], form: str) -> tuple[list[int], list[str]]:
    """The numbers of the first word, which slashes separate, and the words after it."""
    if not words:
        raise FabricError("", f"is incomplete; write it as in {form}")
    runs = [_number(part, form) for part in words[0].split("/")]
    if sum(runs) > LARGEST:
        raise FabricError(
            quoted(words[0], 20), f"is {sum(runs)} threads; it must be at most {LARGEST}"
        )
    return runs, words[1:]


def _number(text: str, form: str) -> int:
    if not re.fullmatch(r"[0-9]{1,6}", text) or int(text) == 0:
        raise FabricError(
            quoted(text, 20), f"is not a whole number of at least 1; write it as in {form}"
        )
    return int(text)


def _take_word(words: list[str], choices: tuple[str, ...], default: str) -> str:
    return words.pop(0) if words and words[0] in choices else default


def _expect_none(words: list[str], form: str) -> None:
    if words:
        raise FabricError(quoted(words[0], 20), f"is not expected here; write it as in {form}")


def _slashes(runs: list[int]) -> str:
    return "/".join(map(str, runs))
