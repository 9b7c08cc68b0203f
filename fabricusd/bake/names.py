"""Names of garments and fabrics in a bake folder: of files on any system, and of prims.

The files of two garments must never meet, whatever the file system makes of their names: some fold
case, some fold accents, Windows keeps some names for its devices.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

from fabricusd.schema.names import prim_name

LONGEST = 120
"""Bytes of a name in UTF-8: file names may have 255, and a map, a tile and a suffix follow."""

_DEVICES = ("con", "prn", "aux", "nul", "conin$", "conout$")
_PORTS = [f"{port}{k}" for port in ("com", "lpt") for k in range(10)]
RESERVED = frozenset((*_DEVICES, *_PORTS, "fabrics", "manifest", "report", "look"))
"""Names that Windows keeps for devices, whatever their suffix, and stems of a bake's own files."""


def file_stem(text: str, instead: str = "mesh") -> str:
    """The nearest name of a file on any system: letters, digits, _ and -, no - first.

    instead : where nothing is left of `text`
    """
    name = re.sub(r"[^\w-]", "_", unicodedata.normalize("NFC", text.strip()))
    name = re.sub(r"^-", "_", name)
    name = name.encode("utf-8", "replace")[:LONGEST].decode("utf-8", "ignore")
    return name or instead


def is_file_stem(text: str) -> bool:
    """Whether `different_names` could have made the name."""
    return bool(text) and file_stem(text) == text and text.casefold() not in RESERVED


def folded(name: str) -> frozenset[str]:
    """What must differ between two names: as file systems and as prims and materials fold them."""
    return frozenset(
        (
            unicodedata.normalize("NFKD", name).casefold(),
            prim_name(name).casefold(),
            prim_name(name, ascii_only=True).casefold(),
        )
    )


def different_names(wanted: Sequence[str]) -> list[str]:
    """A name for each that is `wanted`, no two alike however they are folded.

    Each name stays with the first that wants it; only the others get a number after it.
    """
    taken: set[str] = set(RESERVED)
    names: dict[int, str] = {}
    for k, name in enumerate(wanted):
        if taken.isdisjoint(folded(name)):
            names[k] = name
            taken |= folded(name)
    for k, name in enumerate(wanted):
        if k not in names:
            names[k] = _numbered(name, taken)
            taken |= folded(names[k])
    return [names[k] for k in range(len(wanted))]


def _numbered(name: str, taken: set[str]) -> str:
    """`name` with the least number after it that makes it differ from those `taken`."""
    count = 2
    while True:
        tail = f"_{count}"
        short = name.encode()[: LONGEST - len(tail)].decode("utf-8", "ignore")
        if taken.isdisjoint(folded(short + tail)):
            return short + tail
        count += 1
