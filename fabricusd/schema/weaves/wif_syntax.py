"""The syntax of WIF: encodings, sections, and the values in them. [WIF1.1]

What is read here is what files hold and not only what the specification asks for: sections and
keys in any case, blanks anywhere, comments after numbers, keys that come twice (the last one
counts), lines without `=`, all three line ends.
"""

from __future__ import annotations

import codecs
import configparser
import re
from collections.abc import Iterator
from decimal import Decimal, InvalidOperation

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.schema.weaves.draft import LARGEST_LENGTH, SMALLEST_LENGTH, quoted

TRUE = ("true", "on", "yes", "1")
FALSE = ("false", "off", "no", "0")

UNITS = {
    "decipoints": Decimal("0.0254") / 720,
    "inches": Decimal("0.0254"),
    "centimeters": Decimal("0.01"),
}
"""WIF's units of length [m]; a decipoint is a tenth of a point of 1/72 inch."""

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
"""Largest display codes that programs write, tried in turn where the file does not say."""

_DIGITS = str.maketrans("", "", "0123456789,")


def decode(data: bytes) -> str:
    """Text of UTF-16 or UTF-8 with a byte order mark, else UTF-8, else Windows code page 1252."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Its five unused bytes are replaced; they can only stand in a title or in notes.
        return data.decode("cp1252", errors="replace")


class Section:
    """One section: keys in lower case -> text. `where(key)` names a line of it in a message."""

    def __init__(self, file: str, name: str, values: dict[str, str]) -> None:
        self.file = file
        self.name = name
        self.values = values

    def where(self, key: str | int = "") -> str:
        """`draft.wif [WARP] Threads`."""
        return f"{self.file} [{self.name}] {key}".strip()

    def text(self, key: str) -> str:
        """A string value; a semicolon is part of it. Empty where there is none."""
        return self.values.get(key.lower(), "")

    def value(self, key: str) -> str:
        """A value that is not a string, without the comment after it."""
        return _uncommented(self.text(key))

    def boolean(self, key: str) -> bool | None:
        """True, False, or None where there is no value."""
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
        """A whole number from `low` to `high`, or None where there is no value."""
        word = self.value(key)
        if not word:
            return None
        if not re.fullmatch(r"[+-]?[0-9]{1,18}", word) or not low <= int(word) <= high:
            raise FabricError(
                self.where(key),
                f"is {quoted(word, 40)}; it must be a whole number from {low} to {high}",
            )
        return int(word)

    def length(self, key: str, unit: Decimal) -> float | None:
        """A length [m] written in `unit`; 0 is allowed, None where there is no value."""
        word = self.value(key)
        if not word:
            return None
        # Some programs write the decimal comma of their country.
        number = word.replace(",", ".") if word.count(",") == 1 and "." not in word else word
        try:
            written = Decimal(number)
        except InvalidOperation:
            written = Decimal("nan")
        if written == 0:
            return 0.0
        # In decimals, so that 0.0185 cm is the float nearest to 0.000185 m and can be written
        # back as what it was.
        low, high = Decimal(str(SMALLEST_LENGTH)) / unit, Decimal(str(LARGEST_LENGTH)) / unit
        if not written.is_finite() or not low <= written <= high:
            raise FabricError(
                self.where(key),
                f"is {quoted(word, 40)}; it must be 0, or a number from {float(low):.4g} to "
                f"{float(high):.4g} of its unit",
            )
        return min(max(float(written * unit), SMALLEST_LENGTH), LARGEST_LENGTH)

    def lists(
        self, keys: int, largest: int, hint: str = ""
    ) -> Iterator[tuple[int, NDArray[np.int32]]]:
        """(key, numbers) of each line `key=n,n,n`; 0 and an empty value are no number.

        Keys must be whole numbers from 1 to `keys`, numbers at most `largest`; `hint` says why.
        """
        for key, text in self.values.items():
            number = self._key(key, 1, keys)
            word = _uncommented(text).rstrip(", \t")
            if any(c in word for c in " \t"):
                word = re.sub(r"\s*,\s*", ",", word)
            if word.translate(_DIGITS) or ",," in word or word.startswith(","):
                raise FabricError(
                    self.where(number),
                    f"is {quoted(word, 40)}; it must be whole numbers with commas between",
                )
            items = np.fromstring(word, np.int64, sep=",") if word else np.zeros(0, np.int64)
            items = items[items != 0]
            if len(items) and items.max() > largest:
                raise FabricError(
                    self.where(number), f"names {items.max()}; it must be from 0 to {largest}{hint}"
                )
            yield number, items.astype(np.int32)

    def keys(self, low: int, high: int) -> Iterator[tuple[int, str]]:
        """(number, key) of each line, for sections whose keys are whole numbers."""
        for key in self.values:
            yield self._key(key, low, high), key

    def _key(self, key: str, low: int, high: int) -> int:
        if not re.fullmatch(r"[0-9]{1,9}", key) or not low <= int(key) <= high:
            raise FabricError(
                self.where(),
                f"has the key {quoted(key, 40)}; it must be a whole number from {low} to {high}",
            )
        return int(key)


def read_sections(text: str, file: str) -> dict[str, Section]:
    """Name in upper case -> section. A section that comes twice is read as one.

    Raises FabricError where there is no section `[WIF]`, which every WIF file starts with.
    """
    parser = configparser.RawConfigParser(
        delimiters=("=",),
        comment_prefixes=(";",),
        inline_comment_prefixes=None,
        strict=False,
        empty_lines_in_values=False,
        allow_no_value=True,
        default_section="  ",  # what `_lines` can never make
    )
    try:
        parser.read_file(_lines(text), source=file)
    except configparser.Error as error:
        reason = str(error).split("\n")[0]
        raise FabricError(file, f"is not a WIF file ({reason}); it must be one") from None
    sections = {
        name: Section(file, name, {key: value or "" for key, value in parser.items(name)})
        for name in parser.sections()
    }
    if "WIF" not in sections:
        raise FabricError(file, "has no section [WIF]; it must be a WIF file, which has one")
    return sections


def _lines(text: str) -> Iterator[str]:
    """Lines from the first section on, without the indentation that means more to an INI parser
    than to WIF, section names in upper case with single blanks."""
    # Not str.splitlines, which would also split at the form feeds and such of a title, and not
    # re.split, which takes twice as long over a jacquard.
    started = False
    for line in text.replace("\r\n", "\n").replace("\r", "\n").split("\n"):
        line = line.strip(" \t\0\f\v")
        if line.startswith("[") and "]" in line:
            started = True
            line = "[" + " ".join(line[1 : line.index("]")].upper().split()) + "]"
            if line == "[]":
                line = "[?]"
        if started and not line.startswith("="):
            yield line


def _uncommented(text: str) -> str:
    return text.partition(";")[0].strip()
