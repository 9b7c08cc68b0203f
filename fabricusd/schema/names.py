"""Make valid names for prims."""

from __future__ import annotations

import re
from collections.abc import Container

from pxr import Sdf


def prim_name(text: str, *, ascii_only: bool = False) -> str:
    """The nearest valid prim name: letters, digits and _ of any script, no digit first.

    ascii_only : for names that go into MaterialX too, which has no other letters
    """
    name = re.sub(r"\W+", "_", text.strip()) or "Fabric"
    # Python counts more characters as letters than USD does.
    ascii_name = re.sub(r"[^A-Za-z0-9_]", "_", name)
    spellings: tuple[str, ...] = (ascii_name, f"_{ascii_name}")
    if not ascii_only:
        spellings = (name, f"_{name}", *spellings)
    return next(spelling for spelling in spellings if Sdf.Path.IsValidIdentifier(spelling))


def free_name(name: str, taken: Container[str]) -> str:
    """Return `name`, with a number after it if it is `taken`."""
    candidate, count = name, 1
    while candidate in taken:
        count += 1
        candidate = f"{name}_{count}"
    return candidate
