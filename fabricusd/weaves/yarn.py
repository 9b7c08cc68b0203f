"""Yarn counts: how heavy a yarn is for its length, in every unit of the trade, and how thick.

A direct count (tex, dtex, denier) is a weight per length and grows with the yarn; an indirect one
(Ne, Nm) is a length per weight and falls. The diameter follows Peirce: the yarn is a cylinder of
fibres that fill a share of it, the packing [Peirce1937].
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from fabricusd.errors import FabricError
from fabricusd.weaves.draft import quoted

TEX = 1e-6
"""1 tex [kg/m]: a gram per kilometre."""

NE_TEX = 0.45359237 / (840 * 0.9144) / TEX
"""Tex of an Ne 1: a pound has 840 yards, the English cotton count. 590.5."""

FIBRES = {
    "cotton": 1520.0, "linen": 1500.0, "wool": 1310.0, "silk": 1340.0, "viscose": 1520.0,
    "polyester": 1380.0, "nylon": 1140.0, "acrylic": 1170.0, "acetate": 1320.0,
}  # fmt: skip
"""Density of fibres [kg/m3], [MortonHearle2008] chapter 5."""

DEFAULT_FIBRE = "cotton"

PACKING = 0.6
"""Share of a yarn that its fibres fill: with cotton it gives Peirce's 1.1 cm3/g, and with that
his diameter of 1/(28 sqrt(Ne)) inch. Hard-twisted and filament yarns are denser."""

FINEST, COARSEST = 0.1 * TEX, 100_000 * TEX
"""Range of counts [kg/m], from a single microfibre to a rope; one outside it is a slip."""

FORM = "20 tex, 330 dtex, 150 den, Ne 30, Ne 30/2, Nm 2/60"

_UNITS: dict[str, Callable[[float], float]] = {
    "tex": lambda n: n * TEX,
    "dtex": lambda n: n * TEX / 10,
    "ktex": lambda n: n * TEX * 1000,
    "den": lambda n: n * TEX / 9,
    "denier": lambda n: n * TEX / 9,
    "td": lambda n: n * TEX / 9,
    "d": lambda n: n * TEX / 9,
    "ne": lambda n: NE_TEX * TEX / n,
    "nec": lambda n: NE_TEX * TEX / n,
    "nm": lambda n: 1000 * TEX / n,
}
"""Unit -> function from a count in it to kg/m."""

INDIRECT = ("ne", "nec", "nm")


_NUMBER = r"[0-9]{1,7}(?:\.[0-9]{1,7})?"
_COUNT = re.compile(
    rf"(?P<unit>[a-z]+)?\s*(?P<first>{_NUMBER})"
    rf"(?:\s*(?P<sign>[/x*])\s*(?P<second>{_NUMBER}))?\s*(?P<after>[a-z]+)?"
)
_PLIED = re.compile(
    rf"(?P<first>{_NUMBER})\s*(?P<unit>[a-z]+?)\s*(?P<sign>[x*])\s*(?P<second>{_NUMBER})"
)


def parse_count(text: str, where: str = "the yarn count") -> float:
    """Linear density [kg/m] of `20 tex`, `Ne 30`, `30Ne`, `Nm 2/60`, `20 tex x 2`.

    Plies are a second number: after a slash in an indirect count, the smaller of the two, whose
    order is one way in Ne and the other in Nm; after an x in a direct one.

    Raises FabricError, naming `where`, for anything else.
    """
    word = text.strip().lower()
    found = _PLIED.fullmatch(word) or _COUNT.fullmatch(word)
    parts = found.groupdict() if found else {}
    unit, sign, second = (
        parts.get("unit") or parts.get("after"),
        parts.get("sign"),
        parts.get("second"),
    )
    if unit not in _UNITS or (parts.get("unit") and parts.get("after")):
        raise FabricError(where, f"is {quoted(text, 40)}; write a count and its unit, as in {FORM}")
    count, plies = float(parts["first"]), float(second or 1)
    if unit in INDIRECT and second:
        count, plies = max(count, plies), min(count, plies)
    if sign and (sign == "/") != (unit in INDIRECT):
        told = "Ne 30/2" if unit in INDIRECT else "20 tex x 2"
        raise FabricError(where, f"is {quoted(text, 40)}; write plies as in {told}")
    density = _UNITS[unit](count) * plies if count > 0 else 0.0
    if plies != int(plies) or not FINEST <= density <= COARSEST:
        raise FabricError(
            where,
            f"is {quoted(text, 40)}; it must be from {FINEST / TEX:g} to {COARSEST / TEX:g} tex, "
            "of a whole number of plies",
        )
    return density


def fibre_density(fibre: str, where: str = "--fibre") -> float:
    """Density of a fibre [kg/m3] by its name; FabricError, naming `where`, for one not known."""
    if fibre.lower() not in FIBRES:
        raise FabricError(where, f"is {quoted(fibre, 40)}; it must be one of {', '.join(FIBRES)}")
    return FIBRES[fibre.lower()]


def diameter(
    linear_density: float, fibre: float = FIBRES[DEFAULT_FIBRE], packing: float = PACKING
) -> float:
    """Diameter [m] of a yarn of `linear_density` [kg/m], of fibres of density `fibre` [kg/m3].

    [Peirce1937]: the yarn's section is that of the fibres over the packing.
    """
    return math.sqrt(4.0 * linear_density / (math.pi * fibre * packing))


def linear_density(
    thickness: float, fibre: float = FIBRES[DEFAULT_FIBRE], packing: float = PACKING
) -> float:
    """Linear density [kg/m] of a yarn of diameter `thickness` [m]; the inverse of `diameter`."""
    return math.pi / 4.0 * thickness**2 * fibre * packing


def count_words(linear_density: float) -> str:
    """`19.7 tex, Ne 30, Nm 50.8, 177 denier` for a linear density [kg/m]."""
    tex = linear_density / TEX
    return f"{tex:.3g} tex, Ne {NE_TEX / tex:.3g}, Nm {1000 / tex:.3g}, {9 * tex:.3g} denier"
