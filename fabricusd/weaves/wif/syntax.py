"""The syntax of a WIF file: its sections, and the values in them. [WIF1.1]

This accepts what real files hold, which is more than the specification allows: sections and keys in
upper or lower case, blanks anywhere, comments after numbers, repeated keys (the last one counts),
and keys beyond any thread.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.weaves.draft import LARGEST_LENGTH, SMALLEST_LENGTH, quoted

TRUE = ("true", "on", "yes", "1")
FALSE = ("false", "off", "no", "0")

UNITS = {
    "decipoints": Decimal("0.0254") / 720,
    "inches": Decimal("0.0254"),
    "centimeters": Decimal("0.01"),
}
"""WIF's units of length [m]; a decipoint is a tenth of a point, which is 1/72 inch."""

UNIT_ALIASES = {
    "decipoint": "decipoints",
    "inch": "inches",
    "in": "inches",
    "centimeter": "centimeters",
    "centimetres": "centimeters",
    "centimetre": "centimeters",
    "cm": "centimeters",
}


LARGEST_CODE = 65535
"""Largest display code of a colour: 16 bits."""

USUAL_RANGES = (255, 999, LARGEST_CODE)
"""Largest display codes that programs use, tried in turn if the file does not state a range."""

_DIGITS = str.maketrans("", "", "0123456789,")


@dataclass
class Unused:
    """Count of the things that nothing uses, and the first of them."""

    count: int = 0
    first: str = ""

    def add(self, text: str) -> None:
        """Count one more."""
        self.first = self.first if self.count else text[:60]
        self.count += 1


class Section:
    """One section: `values`, by key in lower case, and `numbered`, by keys that are whole numbers.

    `where(key)` names one of its lines in a message.
    """

    def __init__(self, file: str, name: str) -> None:
        self.file = file
        self.name = name
        self.values: dict[str, str] = {}
        self.numbered: dict[int, str] = {}
        self.strays = Unused()

    def where(self, key: str | int = "") -> str:
        """`draft.wif [WARP] Threads`."""
        return f"{self.file} [{self.name}] {key}".strip()

    def text(self, key: str | int) -> str:
        """A string value, of which a semicolon is part; empty if the key is missing."""
        if isinstance(key, int):
            return self.numbered.get(key, "")
        return self.values.get(key.lower(), "")

    def value(self, key: str | int) -> str:
        """A value other than a string, without the comment after it."""
        return self.text(key).partition(";")[0].strip()

    def boolean(self, key: str) -> bool | None:
        """True, False, or None if there is no value."""
        word = self.value(key).lower()
        if not word:
            return None
        if word not in TRUE + FALSE:
            raise FabricError(
                self.where(key),
                f"is {quoted(word, 40)}; it must be one of {', '.join(TRUE + FALSE)}",
            )
        return word in TRUE

    def integer(self, key: str, low: int, high: int) -> int | None:
        """A whole number from `low` to `high`, or None if there is no value."""
        word = self.value(key)
        if not word:
            return None
        if not re.fullmatch(r"[+-]?[0-9]{1,18}", word) or not low <= int(word) <= high:
            raise FabricError(
                self.where(key),
                f"is {quoted(word, 40)}; it must be a whole number from {low} to {high}",
            )
        return int(word)

    def length(self, key: str | int, unit: Decimal) -> float | None:
        """A length [m] that is written in `unit`; it may be 0. None if there is no value."""
        word = self.value(key)
        if not word:
            return None
        # Some programs write a decimal comma.
        number = word.replace(",", ".") if word.count(",") == 1 and "." not in word else word
        try:
            written = Decimal(number)
        except InvalidOperation:
            written = Decimal("nan")
        if written == 0:
            return 0.0
        # Convert in decimals, so that 0.0185 cm becomes the float nearest to 0.000185 m and is
        # written back unchanged.
        low, high = Decimal(str(SMALLEST_LENGTH)) / unit, Decimal(str(LARGEST_LENGTH)) / unit
        if not written.is_finite() or not low <= written <= high:
            raise FabricError(
                self.where(key),
                f"is {quoted(word, 40)}; it must be 0, or a number from {float(low):.4g} to "
                f"{float(high):.4g} of its unit",
            )
        return min(max(float(written * unit), SMALLEST_LENGTH), LARGEST_LENGTH)

    def numbers(self, low: int, high: int) -> Iterator[int]:
        """The keys from `low` to `high` that are present, in the order of the file."""
        return (number for number in self.numbered if low <= number <= high)

    def beyond(self, low: int, high: int) -> Unused:
        """The keys that are not whole numbers from `low` to `high`."""
        found = Unused(self.strays.count, self.strays.first)
        for number in self.numbered:
            if not low <= number <= high:
                found.add(str(number))
        return found

    def list(self, number: int, largest: int, hint: str = "") -> NDArray[np.int32]:
        """(k,) numbers of the line `number=n,n,n`; zeros and empty values are skipped.

        Numbers must be at most `largest`; `hint` says in a message where that limit comes from.
        """
        word = self.value(number).rstrip(", \t")
        if any(c in word for c in " \t"):
            word = re.sub(r"\s*,\s*", ",", word)
        if word.translate(_DIGITS) or ",," in word or word.startswith(","):
            raise FabricError(
                self.where(number),
                f"is {quoted(word, 40)}; it must be whole numbers, separated by commas",
            )
        items = np.fromstring(word, np.int64, sep=",") if word else np.zeros(0, np.int64)
        items = items[items != 0]
        if len(items) and items.max() > largest:
            raise FabricError(
                self.where(number), f"names {items.max()}; it must be from 0 to {largest}{hint}"
            )
        return np.asarray(items, np.int32)


@dataclass(frozen=True)
class Wif:
    """The sections of a file, by their names in upper case, and the warnings from reading them."""

    file: str
    sections: dict[str, Section] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def section(self, name: str) -> Section:
        """The section `name`, empty where the file has none."""
        return self.sections.get(name) or Section(self.file, name)

    def warn(self, text: str) -> None:
        """Add a warning, one line."""
        self.warnings.append(text)

    def warn_of_beyond(self, name: str, count: int, noun: str, first: int = 1) -> None:
        """Warn about the lines of section `name` that belong to none of its `count` things."""
        unused = self.section(name).beyond(first, count)
        if unused.count:
            self.warn(
                f"[{name}] has {unused.count} line(s) for {noun}s outside {first} to {count}, such "
                f"as {quoted(unused.first, 40)}; they are not used."
            )
