"""Give garments and fabrics names that are valid as file names on any system and as prim names.

The files of two garments must never collide, whatever the file system does to their names: some
file systems ignore case, some ignore accents, and Windows reserves some names for devices.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

from fabricusd.schema.names import prim_name

LONGEST = 120
"""Bytes of a name in UTF-8. File names may have 255; a map, a tile and a suffix are appended."""

_DEVICES = ("con", "prn", "aux", "nul", "conin$", "conout$")
_PORTS = [f"{port}{k}" for port in ("com", "lpt") for k in range(10)]
RESERVED = frozenset((*_DEVICES, *_PORTS, "fabrics", "manifest", "report", "look"))
"""Names that Windows reserves for devices, whatever their suffix, and stems of a bake's own files.
"""


def file_stem(text: str, instead: str = "mesh") -> str:
    """Turn `text` into a portable file name: letters, digits, _ and -, not starting with -.

    instead : the name if nothing of `text` remains
    """
    name = re.sub(r"[^\w-]", "_", unicodedata.normalize("NFC", text.strip()))
    name = re.sub(r"^-", "_", name)
    name = name.encode("utf-8", "replace")[:LONGEST].decode("utf-8", "ignore")
    return name or instead


def is_file_stem(text: str) -> bool:
    """Whether `different_names` could have returned this name."""
    return bool(text) and file_stem(text) == text and text.casefold() not in RESERVED


def folded(name: str) -> frozenset[str]:
    """Return the forms in which two names must differ: as file systems, prims and materials see
    them."""
    return frozenset(
        (
            unicodedata.normalize("NFKD", name).casefold(),
            prim_name(name).casefold(),
            prim_name(name, ascii_only=True).casefold(),
        )
    )


def different_names(wanted: Sequence[str]) -> list[str]:
    """Return a name for each of `wanted`, such that no two names collide in any form of `folded`.

    The first to want a name keeps it; later ones get a number appended.
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
    """Append the smallest number to `name` that makes it differ from all `taken` names."""
    count = 2
    while True:
        tail = f"_{count}"
        short = name.encode()[: LONGEST - len(tail)].decode("utf-8", "ignore")
        if taken.isdisjoint(folded(short + tail)):
            return short + tail
        count += 1
