"""Read values from an untrusted JSON file and remember where in the file each value stands.

Each accessor returns a value of the type that it names, or raises FabricError with the file, the
place, the value and what would be accepted.
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
"""Bytes of the largest file that is read. A hostile file could need 25 times as much memory; a
manifest of a hundred tiles has half a million bytes."""

MANY = 8
"""Entries of the longest list that an error shows."""

DEEP = 10_000
"""Characters of the longest string that is accepted."""


@dataclass(frozen=True, kw_only=True)
class Stated:
    """A value of a JSON file.

    file : the file it was read from
    place : keys from the file's root, joined by /
    """

    file: str
    place: str
    value: Any

    def refuse(self, wanted: str) -> NoReturn:
        """Raise FabricError: the value is not `wanted`."""
        where = self.place or "its root"
        raise FabricError(self.file, f"says {where} is {_shown(self.value)}; it must be {wanted}")

    def below(self, key: str, value: Any) -> Stated:
        """Return a value inside this one."""
        place = f"{self.place}/{key}" if self.place else key
        return Stated(file=self.file, place=place if len(place) < 200 else "...", value=value)

    def fields(self) -> dict[str, Any]:
        """Return the dictionary of a JSON object."""
        if not isinstance(self.value, dict):
            self.refuse("an object with keys")
        return self.value

    def items(self) -> Iterator[tuple[str, Stated]]:
        """Iterate over the keys and values of a JSON object."""
        for key, value in self.fields().items():
            yield key, self.below(key, value)

    def field(self, key: str) -> Stated:
        """Return the value of a required key."""
        held = self.fields()
        if key not in held:
            where = self.place or "its root"
            raise FabricError(self.file, f"has no '{key}' in {where}; bake again")
        return self.below(key, held[key])

    def entries(self, count: int | None = None) -> list[Stated]:
        """Return the entries of a list: exactly `count` of them, or at least one if None."""
        wanted = "a list of at least one entry" if count is None else f"a list of {count} entries"
        if (
            not isinstance(self.value, list)
            or not self.value
            or len(self.value) != (len(self.value) if count is None else count)
        ):
            self.refuse(wanted)
        return [self.below(str(k), value) for k, value in enumerate(self.value)]

    def text(self) -> str:
        """Return a string of printable characters."""
        if not isinstance(self.value, str) or len(self.value) > DEEP:
            self.refuse(f"a string of at most {DEEP} characters")
        if not self.value.isprintable():
            self.refuse("a string of printable characters")
        return self.value

    def flag(self) -> bool:
        """Return a truth value."""
        if not isinstance(self.value, bool):
            self.refuse("true or false")
        return self.value

    def number(self, most: float = 1e30) -> float:
        """Return a finite number whose magnitude is at most `most`."""
        value = self.value
        if type(value) not in (int, float) or not abs(value) <= most or not math.isfinite(value):
            self.refuse(f"a number from {-most:g} to {most:g}")
        return float(value)


def _shown(value: Any) -> str:
    """Return a value as JSON of at most 60 characters; for a long list or object, its length."""
    if isinstance(value, list | dict) and len(value) > MANY:
        return f"{'a list' if isinstance(value, list) else 'an object'} of {len(value)} entries"
    if isinstance(value, str):
        value = value[:60]
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


def read_stated(path: Path) -> Stated:
    """Read the root of a JSON file; raise FabricError if the file is not JSON."""
    source = readable_file(path)
    size = source.stat().st_size
    if size > LONGEST:
        raise FabricError(str(path), f"has {size} bytes; it must have at most {LONGEST}")
    try:
        value = json.loads(source.read_text("utf-8"))
    except RecursionError:
        raise FabricError(str(path), "is nested too deeply; bake again") from None
    except ValueError as error:
        raise FabricError(str(path), f"is not valid JSON ({error}); bake again") from error
    return Stated(file=str(path), place="", value=value)
