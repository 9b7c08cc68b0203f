"""Reading WIF 1.1 drafts. [WIF1.1]

Shafts, treadles and threads are counted from 1 in the file. End 1 is our end 0, at the left; pick 1
is our pick 0, at the bottom. A line that nothing uses causes a warning, whatever it holds; a line
that is used must be right.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fabricusd.errors import FabricError, reads
from fabricusd.fabric import Weave
from fabricusd.weaves.color import palette_from_codes
from fabricusd.weaves.draft import LIMIT, Draft
from fabricusd.weaves.wif.drawdown import drawdown
from fabricusd.weaves.wif.lines import (
    MOST_LINES,
    file_lines,
    read_sections,
    text_lines,
)
from fabricusd.weaves.wif.syntax import Wif
from fabricusd.weaves.wif.threads import color_table, colors, lengths


@reads("a WIF draft")
def read_wif(path: str | os.PathLike[str]) -> Draft:
    """The draft in the WIF file `path`.

    A draft without a title takes the stem of the file's name. `warnings` says what was missing,
    assumed or not used. Raises FabricError, naming file, section and key, for a mistake in a line
    that is used, and for a file beyond the bounds of `wif.lines`.
    """
    return _draft(file_lines(path), str(path))


def parse_wif(text: str, file: str = "draft.wif") -> Draft:
    """The draft in the WIF `text`; `file` names it in messages."""
    return _draft(text_lines(text, file), file)


def _draft(lines: Iterable[str], file: str) -> Draft:
    wif = read_sections(lines, file)
    ends = _count(wif, "WARP", ("THREADING", "WARP COLORS"))
    picks = _count(wif, "WEFT", ("TREADLING", "LIFTPLAN", "WEFT COLORS"))
    cells = drawdown(wif, ends, picks)
    about = wif.section("TEXT")
    # Other kinds of blanks would be lost in writing.
    title = " ".join(about.text("title").split()) or Path(file).stem
    table = color_table(wif)
    fields: dict[str, Any] = {}
    for label, count in (("warp", ends), ("weft", picks)):
        fields |= colors(wif, label, count, table)
        fields |= lengths(wif, label, count, "spacing")
        fields |= lengths(wif, label, count, "thickness")
    if table is not None:
        table.warn_of_unused(wif)
        fields |= {
            "palette": palette_from_codes(table.codes, *table.range),
            "color_range": table.range,
        }
    return Draft(
        weave=Weave(cells, title),
        title=title,
        author=" ".join(about.text("author").split()),
        notes=_notes(wif),
        source=Path(file).name,
        warnings=tuple(wif.warnings),
        **fields,
    )


def _count(wif: Wif, name: str, lists: Iterable[str]) -> int:
    """Threads of the set `name`: the number it states, else the largest that `lists` mention."""
    section = wif.section(name)
    stated = section.integer("Threads", 1, LIMIT)
    if stated is not None:
        return stated
    largest = max((n for other in lists for n in wif.section(other).numbers(1, LIMIT)), default=0)
    if not largest:
        raise FabricError(
            section.where("Threads"), f"is missing; it must be a whole number from 1 to {LIMIT}"
        )
    wif.warn(
        f"[{name}] does not say how many Threads it has; {largest}, the most that other sections "
        "mention, are assumed."
    )
    return largest


def _notes(wif: Wif) -> str:
    """The lines of [NOTES], in order of their numbers."""
    wif.warn_of_beyond("NOTES", MOST_LINES, "note", first=0)
    notes = wif.section("NOTES").numbered
    return "\n".join(notes[number] for number in sorted(notes)).strip()
