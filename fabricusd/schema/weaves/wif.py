"""Reading WIF 1.1 drafts. [WIF1.1]

Shaft, treadle and thread numbers count from 1 in the file; end 1 is our end 0 at the left, pick 1
our pick 0 at the bottom.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, reads
from fabricusd.fabric import Weave
from fabricusd.schema.weaves.color import palette_from_codes
from fabricusd.schema.weaves.draft import LIMIT, Draft, quoted
from fabricusd.schema.weaves.files import read_bytes
from fabricusd.schema.weaves.wif_syntax import (
    LARGEST_CODE,
    UNIT_ALIASES,
    UNITS,
    USUAL_RANGES,
    Section,
    decode,
    read_sections,
)

ColorTable = tuple[dict[int, int], NDArray[np.int64], tuple[int, int]]


@reads("a WIF draft")
def read_wif(path: str | os.PathLike[str]) -> Draft:
    """The draft in the WIF file `path`.

    A draft without a title is called by its file's stem. `warnings` says what was missing and
    assumed. Raises FabricError, one line naming file, section and key, for what is wrong.
    """
    return parse_wif(decode(read_bytes(path)), str(path))


def parse_wif(text: str, file: str = "draft.wif") -> Draft:
    """The draft in the WIF `text`; `file` names it in messages."""
    sections = read_sections(text, file)
    warnings: list[str] = []
    ends = _count(sections, file, "WARP", ("THREADING", "WARP COLORS"), warnings)
    picks = _count(sections, file, "WEFT", ("TREADLING", "LIFTPLAN", "WEFT COLORS"), warnings)
    cells = _drawdown(sections, file, ends, picks, warnings)
    about = sections.get("TEXT") or Section(file, "TEXT", {})
    title = about.text("title").strip() or Path(file).stem
    table = _color_table(sections, warnings)
    fields: dict[str, Any] = {}
    for label, count in (("warp", ends), ("weft", picks)):
        fields |= _colors(sections, file, label, count, table, warnings)
        fields |= _lengths(sections, file, label, count, "spacing", warnings)
        fields |= _lengths(sections, file, label, count, "thickness", warnings)
    if table is not None:
        _, codes, (low, high) = table
        fields |= {
            "palette": palette_from_codes(codes, low, high),
            "color_range": (low, high),
        }
    return Draft(
        weave=Weave(cells, title),
        title=title,
        author=about.text("author").strip(),
        notes=_notes(sections),
        source=Path(file).name,
        warnings=tuple(warnings),
        **fields,
    )


def _section(sections: dict[str, Section], file: str, name: str) -> Section:
    return sections.get(name) or Section(file, name, {})


def _count(
    sections: dict[str, Section], file: str, name: str, lists: Iterable[str], warnings: list[str]
) -> int:
    """Threads of the set `name`: as it says, else the largest that one of `lists` mentions."""
    section = _section(sections, file, name)
    stated = section.integer("Threads", 1, LIMIT)
    if stated is not None:
        return stated
    known = [_section(sections, file, other).keys(1, LIMIT) for other in lists]
    largest = max((number for keys in known for number, _ in keys), default=0)
    if not largest:
        raise FabricError(
            section.where("Threads"), f"is missing; it must be a whole number from 1 to {LIMIT}"
        )
    warnings.append(f"[{name}] does not say how many Threads it has; {largest} are mentioned.")
    return largest


def _drawdown(
    sections: dict[str, Section], file: str, ends: int, picks: int, warnings: list[str]
) -> NDArray[np.bool_]:
    """(ends, picks) bool, True where the warp is on top."""
    weaving = _section(sections, file, "WEAVING")
    rising = weaving.boolean("Rising Shed")
    if rising is None:
        warnings.append("[WEAVING] does not say whether the shed rises; it is taken to rise.")
    threading = _lists(_section(sections, file, "THREADING"), ends, weaving, "Shafts")
    if not any(len(group) for group in threading):
        raise FabricError(
            f"{file} [THREADING]", "names no shaft; it must give each end at least one"
        )
    raised = _raised(sections, file, picks, weaving, _largest(threading), warnings)
    # One bit for each pick: the cells of an end are the union of its shafts' bits.
    by_shaft = np.packbits(raised.T, axis=1)
    up = np.unpackbits(_union(by_shaft, threading), axis=1, count=picks).view(np.bool_)
    return up if rising is not False else ~up


def _raised(
    sections: dict[str, Section],
    file: str,
    picks: int,
    weaving: Section,
    shafts: int,
    warnings: list[str],
) -> NDArray[np.bool_]:
    """(picks, shafts + 1) bool: which of the threaded shafts each pick moves; shaft 0 is none.

    From tie-up and treadling, which record the loom, and else from the lift plan: many programs
    write both.
    """
    tie_up = _section(sections, file, "TIEUP")
    treadling = _section(sections, file, "TREADLING")
    plan = _section(sections, file, "LIFTPLAN")
    lifted = None
    if plan.values:
        lifted = _table(_lists(plan, picks, weaving, "Shafts"), shafts)
    if not (tie_up.values and treadling.values):
        if lifted is None:
            absent = treadling if tie_up.values else tie_up
            raise FabricError(
                absent.where(),
                "is missing; a draft must have [TIEUP] and [TREADLING], or a [LIFTPLAN]",
            )
        return lifted
    treadles = weaving.integer("Treadles", 0, LIMIT) or LIMIT
    pressed = _lists(treadling, picks, weaving, "Treadles")
    ties = _lists(tie_up, treadles, weaving, "Shafts", first=0)[: _largest(pressed) + 1]
    tied = np.packbits(_table(ties, shafts), axis=1)
    moved = np.unpackbits(_union(tied, pressed), axis=1, count=shafts + 1).view(np.bool_)
    if lifted is not None and not np.array_equal(lifted, moved):
        warnings.append("[LIFTPLAN] differs from [TIEUP] and [TREADLING], which are used.")
    return moved


def _lists(
    section: Section, count: int, weaving: Section, key: str, first: int = 1
) -> list[NDArray[np.int32]]:
    """What the lines `first` to `count` of `section` list; [WEAVING] `key` is the largest."""
    stated = weaving.integer(key, 0, LIMIT)
    hint = f", [WEAVING] {key}" if stated else ""
    groups = [np.zeros(0, np.int32)] * (count + 1 - first)
    for number, items in section.lists(count, stated or LIMIT, hint):
        groups[number - first] = items
    return groups


def _largest(groups: list[NDArray[np.int32]]) -> int:
    return max((int(items.max()) for items in groups if len(items)), default=0)


def _table(groups: list[NDArray[np.int32]], columns: int) -> NDArray[np.bool_]:
    """(len(groups), columns + 1) bool, True at the numbers up to `columns` of each group."""
    table = np.zeros((len(groups), columns + 1), np.bool_)
    for row, items in zip(table, groups, strict=True):
        row[items[items <= columns]] = True
    return table


def _union(bits: NDArray[np.uint8], groups: list[NDArray[np.int32]]) -> NDArray[np.uint8]:
    """(len(groups), w) uint8: the rows of `bits` (k, w) that each group names, or-ed together."""
    union = np.zeros((len(groups), bits.shape[1]), np.uint8)
    for row, items in zip(union, groups, strict=True):
        if len(items) == 1:
            row[:] = bits[items[0]]
        elif len(items):
            np.bitwise_or.reduce(bits[np.unique(items)], axis=0, out=row)
    return union


def _color_table(sections: dict[str, Section], warnings: list[str]) -> ColorTable | None:
    """(number in the file -> index, (n, 3) codes, (low, high)); None where there is no table."""
    table = sections.get("COLOR TABLE")
    if table is None or not table.values:
        warnings.append("There is no [COLOR TABLE]; the threads have no colours.")
        return None
    numbers: dict[int, int] = {}
    codes: list[list[int]] = []
    for number, key in sorted(table.keys(0, LARGEST_CODE)):
        parts = [part.strip() for part in table.value(key).split(",")]
        if len(parts) != 3 or not all(part.isascii() and part.isdigit() for part in parts):
            raise FabricError(
                table.where(key),
                f"is {quoted(table.value(key), 40)}; it must be red,green,blue as whole numbers",
            )
        numbers[number] = len(codes)
        codes.append([int(part) for part in parts])
    low, high = _color_range(sections, max(map(max, codes)), warnings)
    for number, code in zip(numbers, codes, strict=True):
        if not low <= min(code) <= max(code) <= high:
            raise FabricError(
                table.where(number),
                f"is {','.join(map(str, code))}; each number must be from {low} to {high}",
            )
    return numbers, np.array(codes, np.int64), (low, high)


def _color_range(
    sections: dict[str, Section], largest: int, warnings: list[str]
) -> tuple[int, int]:
    palette = sections.get("COLOR PALETTE")
    if palette is not None:
        form = palette.value("Form").lower()
        if form not in ("", "rgb", "decimal"):
            raise FabricError(palette.where("Form"), f"is {quoted(form, 40)}; it must be RGB")
        stated = palette.value("Range")
        if stated:
            parts = [part.strip() for part in stated.split(",")]
            if len(parts) == 1:  # some programs write the largest alone
                parts = ["0", *parts]
            usable = len(parts) == 2 and all(p.isascii() and p.isdigit() for p in parts)
            if not usable or not int(parts[0]) < int(parts[1]) <= LARGEST_CODE:
                raise FabricError(
                    palette.where("Range"),
                    f"is {quoted(stated, 40)}; it must be two rising numbers from 0 to "
                    f"{LARGEST_CODE}, as in 0,255",
                )
            return int(parts[0]), int(parts[1])
    high = next((high for high in USUAL_RANGES if largest <= high), LARGEST_CODE)
    warnings.append(f"[COLOR PALETTE] has no Range; the colours are taken to be from 0 to {high}.")
    return 0, high


def _colors(
    sections: dict[str, Section],
    file: str,
    label: str,
    count: int,
    table: ColorTable | None,
    warnings: list[str],
) -> dict[str, Any]:
    """`{label}_colors`: the set's default, then thread by thread."""
    if table is None:
        return {}
    numbers = table[0]
    threads = _section(sections, file, label.upper())
    each = _section(sections, file, f"{label.upper()} COLORS")
    default = _color(threads, "Color", numbers)
    colors = [0 if default is None else default] * count
    given = 0
    for number, key in each.keys(1, count):
        index = _color(each, key, numbers)
        if index is not None:
            colors[number - 1] = index
            given += 1
    if default is None and given < count:
        warnings.append(
            f"{count - given} {label} thread(s) have no colour; they take the first of the table."
        )
    return {f"{label}_colors": tuple(colors)}


def _color(section: Section, key: str, numbers: dict[int, int]) -> int | None:
    """A palette index from `3`, or from WIF 1.0's `3,255,0,0`; None where there is no value."""
    word = section.value(key).partition(",")[0].strip()
    if not word:
        return None
    if not (word.isascii() and word.isdigit() and len(word) < 9 and int(word) in numbers):
        raise FabricError(
            section.where(key),
            f"is {quoted(word, 40)}; it must be a number of [COLOR TABLE], which has "
            f"{min(numbers)} to {max(numbers)}",
        )
    return numbers[int(word)]


def _lengths(
    sections: dict[str, Section],
    file: str,
    label: str,
    count: int,
    name: str,
    warnings: list[str],
) -> dict[str, Any]:
    """The set's spacing or thickness, and those thread by thread where they differ [m]."""
    threads = _section(sections, file, label.upper())
    each = _section(sections, file, f"{label.upper()} {name.upper()}")
    if not (threads.value(name) or any(each.values.values())):
        return {}
    unit = _unit(threads)
    if unit is None:
        warnings.append(f"{threads.where('Units')} is missing; the {name} is not used.")
        return {}
    default = threads.length(name.capitalize(), unit)
    given = {number: each.length(key, unit) for number, key in each.keys(1, count)}
    known = [value for value in given.values() if value is not None]
    if not known:
        return _set_length(label, name, default, warnings)
    fill = default
    if fill is None:
        # A thread without a number is as its neighbours are on the whole.
        fill = float(np.mean(known)) if name == "spacing" else 0.0
    values = tuple(v if (v := given.get(k)) is not None else fill for k in range(1, count + 1))
    if len(set(values)) == 1:
        return _set_length(label, name, values[0], warnings)
    plural = "spacings" if name == "spacing" else "thicknesses"
    return {f"{label}_{name}": default or None, f"{label}_{plural}": values}


def _set_length(label: str, name: str, value: float | None, warnings: list[str]) -> dict[str, Any]:
    if value == 0 and name == "spacing":
        warnings.append(f"The {label} spacing is 0, which would hide it all; it is not used.")
    return {f"{label}_{name}": value or None}


def _unit(section: Section) -> Decimal | None:
    """Metres in one unit of the set's lengths, None where the file does not say."""
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


def _notes(sections: dict[str, Section]) -> str:
    """The lines of [NOTES] in the order of their numbers."""
    notes = sections.get("NOTES")
    if notes is None:
        return ""
    numbered = [key for key in notes.values if key.isascii() and key.isdigit()]
    return "\n".join(notes.text(key) for key in sorted(numbered, key=int)).strip()
