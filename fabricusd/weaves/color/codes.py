"""Display colours of drafts and images, and the linear Rec. 709 colours of threads.

WIF colour tables, palette images and `#rrggbb` are display codes; threads are linear.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fabricusd.errors import FabricError, one_line
from fabricusd.ranges import RANGES
from fabricusd.srgb import linear_from_srgb, srgb_from_linear
from fabricusd.weaves.color.notation import FORMS, RGB, parse_notation

LONGEST_ORDER = 16384
"""Most threads of one colour in a row; equal to the most threads of a draft."""


def palette_from_codes(codes: ArrayLike, low: float = 0, high: float = 255) -> tuple[RGB, ...]:
    """(n, 3) display codes between `low` and `high` -> n linear colours."""
    display = (np.asarray(codes, np.float64).reshape(-1, 3) - low) / (high - low)
    return tuple((float(r), float(g), float(b)) for r, g, b in linear_from_srgb(display))


def codes_from_palette(palette: Sequence[RGB], low: int = 0, high: int = 255) -> NDArray[np.int64]:
    """n linear colours -> (n, 3) int64, the nearest display codes; colours above 1 are clipped."""
    linear = np.clip(np.asarray(palette, np.float64).reshape(-1, 3), 0.0, 1.0)
    return np.rint(srgb_from_linear(linear) * (high - low) + low).astype(np.int64)


def parse_color(text: str, where: str = "colour", observer: int = 2) -> RGB:
    """A linear Rec. 709 colour from any of `notation.FORMS`.

    `#rgb` and `#rrggbb` are display codes. `r,g,b` are linear, at least 0. The others are under D65
    and may lie outside of Rec. 709, with numbers below 0; `observer`, 2 or 10 degrees, is theirs.

    Raises FabricError, naming `where`, for anything else.
    """
    accepted = f"it must be {FORMS}"
    word = text.strip()
    if re.fullmatch(r"#([0-9a-fA-F]{3}){1,2}", word):
        digits = word[1:] if len(word) == 7 else "".join(2 * c for c in word[1:])
        return palette_from_codes([[int(digits[k : k + 2], 16) for k in (0, 2, 4)]])[0]
    noted = parse_notation(word, where, observer)
    if noted is not None:
        return noted
    try:
        r, g, b = (float(part) for part in word.split(","))
    except ValueError:
        raise FabricError(where, f"is '{one_line(text, 40)}'; {accepted}") from None
    if not all(math.isfinite(x) and x >= 0 for x in (r, g, b)):
        raise FabricError(where, f"is '{one_line(text, 40)}'; {accepted}")
    return (r, g, b)


def color_order(items: Sequence[str], where: str, observer: int = 2) -> tuple[RGB, ...]:
    """`4*#111 4*#eee` -> linear colours of eight threads; raises FabricError, naming `where`."""
    order: list[RGB] = []
    for item in items:
        count, star, color = item.rpartition("*")
        # Python refuses to convert numbers of thousands of digits.
        whole = count.isdecimal() and len(count) < 10
        if star and not (whole and 1 <= int(count) <= LONGEST_ORDER):
            said = one_line(count, 40)
            raise FabricError(
                where, f"has the count '{said}'; it must be from 1 to {LONGEST_ORDER}"
            )
        rgb = parse_color(color, where, observer)
        for value in rgb:
            # A colour outside of Rec. 709 has numbers below 0.
            RANGES["color"].require(where, max(value, 0.0))
        order += [rgb] * (int(count) if star else 1)
    return tuple(order)


def describe_code(code: Sequence[int] | NDArray[np.uint8]) -> str:
    """`#rrggbb` for three 8-bit display codes."""
    return "#" + "".join(f"{int(c):02x}" for c in code)
