"""Threadcounts: the orders of colours in which tartans and stripes are written, `B24 W4 R/6`.

A threadcount is a list of stripes, each a colour code and a number of threads. The first and the
last stripe are pivots: the order runs to the last stripe and back to the first, and neither pivot
is doubled. Pivots may be marked with a slash, as in the Scottish Register of Tartans, and are
pivots without one, too. A threadcount that begins or ends with `...` repeats instead of turning.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from fabricusd.errors import FabricError
from fabricusd.weaves.color import RGB, parse_color
from fabricusd.weaves.draft import LIMIT, quoted

CODES = {
    "LR": "#e87878", "R": "#c80000", "DR": "#880000",
    "LO": "#ec8048", "O": "#d87c00", "DO": "#be7832",
    "LY": "#f8e38c", "Y": "#e8c000", "DY": "#bc8c00",
    "LG": "#289c18", "G": "#006818", "DG": "#003820",
    "LB": "#98c8e8", "B": "#2c2c80", "DB": "#202060", "A": "#5c8ca8",
    "LP": "#a8ace8", "P": "#780078", "DP": "#440044",
    "LN": "#c8c8c8", "N": "#888888", "DN": "#505050",
    "LT": "#a08858", "T": "#603800", "DT": "#441800",
    "W": "#e0e0e0", "CW": "#fcfcfc", "K": "#101010", "M": "#901c38",
}  # fmt: skip
"""Code -> one shade of it. The codes are those of the Scottish Register of Tartans, which leaves
the shade to the weaver and lists several for each code."""

FORM = "B24 W4 B24 R2 K24"

_STRIPE = re.compile(r"([A-Za-z]+)\s*(/?)\s*([0-9]+)")


def parse_threadcount(
    text: str, colors: Mapping[str, RGB] | None = None, where: str = "the threadcount"
) -> tuple[RGB, ...]:
    """The linear colour of each thread of one repeat.

    colors : code -> linear colour, before those of `CODES`

    Raises FabricError, naming `where` and the stripe, for anything that is not a threadcount, for a
    code without a colour, and for a repeat of more than `LIMIT` threads.
    """
    body = text.strip().replace("…", "...")
    repeats = body.startswith("...") or body.endswith("...")
    body = body.removeprefix("...").removesuffix("...").strip()
    stripes = [_stripe(part, colors or {}, where) for part in _parts(body, where)]
    for number, (part, pivot, _, _) in enumerate(stripes):
        if pivot and (repeats or 0 < number < len(stripes) - 1):
            raise FabricError(
                where,
                f"marks {quoted(part, 20)} as a pivot; only the first and the last stripe of a "
                "threadcount without ... can be",
            )
    runs = [(count, color) for _, _, count, color in stripes]
    if not repeats:
        runs += runs[-2:0:-1]
    total = sum(count for count, _ in runs)
    if total > LIMIT:
        raise FabricError(where, f"repeats after {total} threads; that must be at most {LIMIT}")
    return tuple(color for count, color in runs for _ in range(count))


def parse_codes(items: Sequence[str], where: str = "--palette") -> dict[str, RGB]:
    """`B=#1f2a4d` -> {"B": linear colour}."""
    colors: dict[str, RGB] = {}
    for item in items:
        code, equals, color = item.partition("=")
        if not equals or not re.fullmatch(r"[A-Za-z]+", code.strip()):
            raise FabricError(
                where, f"has {quoted(item, 40)}; write a code and its colour: B=#1f2a4d"
            )
        colors[code.strip().upper()] = parse_color(color, f"{where} {code.strip()}")
    return colors


def _parts(body: str, where: str) -> list[str]:
    """The stripes of a threadcount, each as it was written."""
    parts: list[str] = []
    at = 0
    for found in _STRIPE.finditer(body):
        between = body[at : found.start()].strip(" ,\t")
        if between:
            break
        parts.append(found.group())
        at = found.end()
    rest = body[at:].strip(" ,\t")
    if rest or not parts:
        problem = f"has {quoted(rest, 20)}" if rest else "is empty"
        raise FabricError(where, f"{problem}; write colour codes and counts, as in {FORM}")
    return parts


def _stripe(part: str, colors: Mapping[str, RGB], where: str) -> tuple[str, bool, int, RGB]:
    """(as written, whether it is marked as a pivot, threads, linear colour)."""
    code, slash, digits = _STRIPE.fullmatch(part).groups()  # type: ignore[union-attr]
    code = code.upper()
    if code not in colors and code not in CODES:
        known = ", ".join(dict.fromkeys([*colors, *CODES]))
        raise FabricError(
            where,
            f"has the colour {quoted(code, 20)}; it must be one of {known}, or be given a colour: "
            f"--palette {code[:8]}=#1f2a4d",
        )
    # Python refuses to convert numbers of thousands of digits.
    if len(digits) > 6 or not 1 <= int(digits) <= LIMIT:
        raise FabricError(where, f"has {quoted(part, 20)}; a count must be from 1 to {LIMIT}")
    return part, bool(slash), int(digits), colors.get(code) or parse_color(CODES[code])
