"""Colour, spacing and thickness of the threads in a WIF draft."""

from __future__ import annotations

from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError
from fabricusd.weaves.draft import quoted
from fabricusd.weaves.wif.syntax import (
    LARGEST_CODE,
    UNIT_ALIASES,
    UNITS,
    USUAL_RANGES,
    Section,
    Wif,
)


@dataclass(frozen=True, kw_only=True)
class ColorTable:
    """The valid colours of a draft, and the errors of the others.

    indices : number in the file -> index into `codes`
    codes : (n, 3) int64 display codes
    range : (low, high) - smallest and largest display code
    wrong : number in the file -> the error to raise if a thread uses it
    """

    indices: dict[int, int]
    codes: NDArray[np.int64]
    range: tuple[int, int]
    wrong: dict[int, FabricError] = field(default_factory=dict)

    def index(self, section: Section, key: str | int) -> int | None:
        """A palette index from `3`, or from WIF 1.0's `3,255,0,0`; None if there is no value."""
        word = section.value(key).partition(",")[0].strip()
        if not word:
            return None
        number = int(word) if word.isascii() and word.isdigit() and len(word) < 9 else -1
        if number in self.wrong:
            raise self.wrong[number]
        if number not in self.indices:
            raise FabricError(
                section.where(key),
                f"is {quoted(word, 40)}; it must be a colour of [COLOR TABLE], whose numbers are "
                f"from {min(self.indices)} to {max(self.indices)}",
            )
        return self.indices[number]

    def warn_of_unused(self, wif: Wif) -> None:
        """Warn about the wrong colours; if a thread used one, the draft was refused before."""
        if self.wrong:
            first = next(iter(self.wrong.values()))
            wif.warn(f"{len(self.wrong)} colour(s) are wrong, but no thread uses them: {first}.")


def color_table(wif: Wif) -> ColorTable | None:
    """The colours of [COLOR TABLE]; None if there is no such section."""
    table = wif.section("COLOR TABLE")
    if not table.numbered:
        if table.strays.count:
            raise FabricError(
                table.where(),
                f"has the key {quoted(table.strays.first, 40)}; it must be a whole number from 0 "
                f"to {LARGEST_CODE}",
            )
        wif.warn("There is no [COLOR TABLE]; the threads have no colours.")
        return None
    wif.warn_of_beyond("COLOR TABLE", LARGEST_CODE, "colour", first=0)
    known: dict[int, tuple[int, ...]] = {}
    wrong: dict[int, FabricError] = {}
    for number in sorted(table.numbered):
        text = table.value(number)
        parts = [part.strip() for part in text.split(",")]
        if len(parts) == 3 and all(p.isascii() and p.isdigit() and len(p) < 10 for p in parts):
            known[number] = tuple(map(int, parts))
        else:
            wrong[number] = FabricError(
                table.where(number),
                f"is {quoted(text, 40)}; it must be red,green,blue as whole numbers",
            )
    low, high = _color_range(wif, max(map(max, known.values()), default=0))
    for number, code in list(known.items()):
        if not low <= min(code) <= max(code) <= high:
            wrong[number] = FabricError(
                table.where(number),
                f"is {','.join(map(str, code))}; each number must be from {low} to {high}",
            )
            del known[number]
    if not known:
        raise next(iter(wrong.values()))
    indices = {number: index for index, number in enumerate(known)}
    codes = np.array(list(known.values()), np.int64)
    return ColorTable(indices=indices, codes=codes, range=(low, high), wrong=wrong)


def _color_range(wif: Wif, largest: int) -> tuple[int, int]:
    palette = wif.section("COLOR PALETTE")
    form = palette.value("Form").lower()
    if form not in ("", "rgb", "decimal"):
        raise FabricError(palette.where("Form"), f"is {quoted(form, 40)}; it must be RGB")
    stated = palette.value("Range")
    if stated:
        parts = [part.strip() for part in stated.split(",")]
        if len(parts) == 1:  # some programs write only the largest
            parts = ["0", *parts]
        usable = len(parts) == 2 and all(p.isascii() and p.isdigit() and len(p) < 10 for p in parts)
        if not usable or not int(parts[0]) < int(parts[1]) <= LARGEST_CODE:
            raise FabricError(
                palette.where("Range"),
                f"is {quoted(stated, 40)}; it must be two rising numbers from 0 to "
                f"{LARGEST_CODE}, as in 0,255",
            )
        return int(parts[0]), int(parts[1])
    high = next((high for high in USUAL_RANGES if largest <= high), LARGEST_CODE)
    wif.warn(f"[COLOR PALETTE] has no Range; 0 to {high} is assumed.")
    return 0, high


def colors(wif: Wif, label: str, count: int, table: ColorTable | None) -> dict[str, Any]:
    """`{label}_colors` of a Draft: each thread's own colour, else the default of the set."""
    if table is None:
        return {}
    name = f"{label.upper()} COLORS"
    each = wif.section(name)
    own = {number: table.index(each, number) for number in each.numbers(1, count)}
    wif.warn_of_beyond(name, count, "end" if label == "warp" else "pick")
    without = count - sum(index is not None for index in own.values())
    default = _default_color(wif, label, table, without)
    if default is None and without:
        wif.warn(f"{without} {label} thread(s) have no colour; they take the first of the table.")
    found = (own.get(number) for number in range(1, count + 1))
    return {
        f"{label}_colors": tuple(index if index is not None else default or 0 for index in found)
    }


def _default_color(wif: Wif, label: str, table: ColorTable, without: int) -> int | None:
    """The colour for the `without` threads that have none of their own; None if there is none."""
    section = wif.section(label.upper())
    try:
        return table.index(section, "Color")
    except FabricError as error:
        # WIF counts from 1, so 0 may mean here that there is no default.
        if without and section.value("Color").partition(",")[0].strip().strip("0"):
            raise
        wif.warn(f"{error}; it is not used.")
        return None


def lengths(wif: Wif, label: str, count: int, name: str) -> dict[str, Any]:
    """The spacing or thickness of the set, and of each thread if they differ [m]."""
    threads = wif.section(label.upper())
    each = wif.section(f"{label.upper()} {name.upper()}")
    if each.numbered or each.strays.count:
        wif.warn_of_beyond(each.name, count, "end" if label == "warp" else "pick")
    if not (threads.value(name) or any(each.value(k) for k in each.numbers(1, count))):
        return {}
    unit = _unit(threads)
    if unit is None:
        wif.warn(f"{threads.where('Units')} is missing; the {name} is not used.")
        return {}
    given = {number: each.length(number, unit) for number in each.numbers(1, count)}
    known = [value for value in given.values() if value is not None]
    default = _default_length(wif, threads, name, unit, count - len(known))
    if not known:
        return _set_length(wif, label, name, default)
    fill = default
    if fill is None:
        # A thread without a spacing takes the mean of the others.
        fill = float(np.mean(known)) if name == "spacing" else 0.0
    values = tuple(v if (v := given.get(k)) is not None else fill for k in range(1, count + 1))
    if len(set(values)) == 1:
        return _set_length(wif, label, name, values[0])
    plural = "spacings" if name == "spacing" else "thicknesses"
    return {f"{label}_{name}": default or None, f"{label}_{plural}": values}


def _default_length(
    wif: Wif, threads: Section, name: str, unit: Decimal, without: int
) -> float | None:
    """The length [m] for the `without` threads that have none of their own."""
    try:
        return threads.length(name.capitalize(), unit)
    except FabricError as error:
        if without:
            raise
        wif.warn(f"{error}; it is not used.")
        return None


def _set_length(wif: Wif, label: str, name: str, value: float | None) -> dict[str, Any]:
    if value == 0 and name == "spacing":
        wif.warn(f"The {label} spacing is 0, which would hide every thread; it is not used.")
    return {f"{label}_{name}": value or None}


def _unit(section: Section) -> Decimal | None:
    """Metres per unit of the set's lengths; None if the file does not say."""
    word = section.value("Units").lower()
    if not word:
        return None
    unit = UNITS.get(UNIT_ALIASES.get(word, word))
    if unit is None:
        raise FabricError(
            section.where("Units"),
            f"is {quoted(word, 40)}; it must be Decipoints, Inches or Centimeters",
        )
    return unit
