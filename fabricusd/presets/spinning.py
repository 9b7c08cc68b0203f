"""How yarns are spun: how uneven they are, how close their fibres lie, how flat they are in cloth.

Unevenness is what is usual for the kind of yarn in tables of evenness testers [UsterStatistics]:
finer yarns are more uneven, combing takes short fibres out, two plies even one another out. Of the
hairiness that testers find on spun yarn, singeing and pressing leave about a third in cotton cloth
and half in worsted; milling brings out more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fabricusd.weaves.yarn import PACKING


@dataclass(frozen=True, kw_only=True)
class Spinning:
    """One kind of yarn.

    words : what it is called, and where its numbers come from
    cv, count, shade, length : as in `Thread`; the length in metres
    slub : amount, length and spacing [m] of slubs; all 0 without any
    packing : share of the yarn that its fibres fill
    flatness : width over height of the yarn in cloth. Yarns are round when they are counted, and
        are pressed flat in the loom and in finishing; the section keeps its area
    plies, twist : as in `Thread`, the twist in turns per metre
    hairiness : as in `Thread`, of the yarn in finished cloth
    """

    words: str
    cv: float
    count: float
    shade: float
    length: float = 5e-3
    slub: tuple[float, float, float] = (0.0, 0.0, 0.0)
    packing: float = PACKING
    flatness: float = 1.7
    plies: int = 1
    twist: float = 0.0
    hairiness: float = 0.0

    def fields(self) -> dict[str, Any]:
        """The fields of a `Thread` that say how it is spun."""
        amount, length, spacing = self.slub
        return {
            "unevenness_cv": self.cv,
            "unevenness_length": self.length,
            "unevenness_count": self.count,
            "unevenness_shade": self.shade,
            "slub_amount": amount,
            "slub_length": length,
            "slub_spacing": spacing,
            "plies": self.plies,
            "twist": self.twist,
            "hairiness": self.hairiness,
        }


SPINNING = {
    "combed": Spinning(
        words="combed ring-spun cotton", cv=0.13, count=0.03, shade=0.03,
        hairiness=1.5,
    ),
    "carded": Spinning(
        words="carded ring-spun cotton", cv=0.16, count=0.05, shade=0.04, hairiness=2.5,
    ),
    "soft": Spinning(
        words="carded cotton, softly twisted", cv=0.15, count=0.05, shade=0.04, packing=0.55,
        hairiness=4.0,
    ),
    "plied": Spinning(
        words="carded cotton, two plies", cv=0.12, count=0.04, shade=0.04, flatness=1.5, plies=2,
        twist=-450.0, hairiness=2.0,
    ),
    "denim": Spinning(
        words="ring-spun cotton with short slubs, as denim is known for", cv=0.15, count=0.05,
        shade=0.09, slub=(0.35, 20e-3, 140e-3), hairiness=3.0,
    ),
    "rotor": Spinning(words="rotor-spun cotton", cv=0.13, count=0.03, shade=0.03, hairiness=1.5),
    "worsted": Spinning(
        words="worsted wool, two plies", cv=0.13, count=0.03, shade=0.05, flatness=1.5, plies=2,
        twist=-600.0, hairiness=2.0,
    ),
    "woollen": Spinning(
        words="woollen-spun wool, milled", cv=0.20, count=0.08, shade=0.14, length=6e-3,
        slub=(0.3, 8e-3, 90e-3), packing=0.35, flatness=1.5, hairiness=10.0,
    ),
    "bright": Spinning(
        words="continuous filament without twist, which spreads flat", cv=0.012, count=0.015,
        shade=0.015, length=10e-3, packing=0.75, flatness=6.0,
    ),
    "raw": Spinning(
        words="raw silk filament, hard twisted and therefore round", cv=0.02, count=0.06,
        shade=0.03, length=10e-3, packing=0.75, flatness=1.0,
    ),
}  # fmt: skip
"""Name -> kind of yarn; `rows` names them."""
