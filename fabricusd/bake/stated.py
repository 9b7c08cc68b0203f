"""A value of a JSON file that somebody else may have written, and where in the file it stands.

Each question either gives a value of the type that it names or raises FabricError, which says the
file, the place, the value, and what would be accepted.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from fabricusd.errors import FabricError
from fabricusd.files import readable_file

LONGEST = 6 << 20
"""Bytes of a file that is read: a hostile one could take 25 times as many of memory, and a manifest
of a hundred tiles has half a million."""

MANY = 8
"""Entries of a list that an error shows."""

DEEP = 10_000
"""Characters of a text at most."""


@dataclass(frozen=True, kw_only=True)
class Stated:
    """file : where it was read, place : keys from the file's root, joined by /"""

    file: str
    place: str
    value: Any

    def refuse(self, wanted: str) -> NoReturn:
        """Raise what is said about a value that is not `wanted`."""
        where = self.place or "its root"
        raise FabricError(self.file, f"says {where} is {_shown(self.value)}; it must be {wanted}")

    def below(self, key: str, value: Any) -> Stated:
        """A value inside this one."""
        place = f"{self.place}/{key}" if self.place else key
        return Stated(file=self.file, place=place if len(place) < 200 else "...", value=value)

    def fields(self) -> dict[str, Any]:
        """An object's keys and values."""
        if not isinstance(self.value, dict):
            self.refuse("an object with keys")
        return self.value

    def items(self) -> Iterator[tuple[str, Stated]]:
        """An object's keys, and its values."""
        for key, value in self.fields().items():
            yield key, self.below(key, value)

    def field(self, key: str) -> Stated:
        """The value of a key that must be there."""
        held = self.fields()
        if key not in held:
            where = self.place or "its root"
            raise FabricError(self.file, f"has no '{key}' in {where}; bake again")
        return self.below(key, held[key])

    def entries(self, count: int | None = None) -> list[Stated]:
        """A list's entries, `count` of them or at least one."""
        wanted = "a list of at least one entry" if count is None else f"a list of {count} entries"
        if (
            not isinstance(self.value, list)
            or not self.value
            or len(self.value) != (len(self.value) if count is None else count)
        ):
            self.refuse(wanted)
        return [self.below(str(k), value) for k, value in enumerate(self.value)]

    def text(self) -> str:
        """A text of printable characters."""
        if not isinstance(self.value, str) or len(self.value) > DEEP:
            self.refuse("a text")
        if not self.value.isprintable():
            self.refuse("a text of printable characters")
        return self.value

    def flag(self) -> bool:
        """True or false."""
        if not isinstance(self.value, bool):
            self.refuse("true or false")
        return self.value

    def number(self, most: float = 1e30) -> float:
        """A finite number, at most `most` in size."""
        value = self.value
        if type(value) not in (int, float) or not abs(value) <= most or not math.isfinite(value):
            self.refuse(f"a number of at most {most:g}")
        return float(value)


def _shown(value: Any) -> str:
    """A value in JSON's words, at most 60 characters; a great list or object by its size alone."""
    if isinstance(value, list | dict) and len(value) > MANY:
        return f"{'a list' if isinstance(value, list) else 'an object'} of {len(value)} entries"
    if isinstance(value, str):
        value = value[:60]
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


def read_stated(path: Path) -> Stated:
    """The root of a JSON file; FabricError for one that is none."""
    source = readable_file(path)
    size = source.stat().st_size
    if size > LONGEST:
        raise FabricError(str(path), f"has {size} bytes; it must have at most {LONGEST}")
    try:
        value = json.loads(source.read_text("utf-8"))
    except RecursionError:
        raise FabricError(str(path), "is nested too deeply; bake again") from None
    except ValueError as error:
        raise FabricError(str(path), f"is no JSON ({error}); bake again") from error
    return Stated(file=str(path), place="", value=value)
