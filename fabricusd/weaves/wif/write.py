"""Writing WIF 1.1 drafts. [WIF1.1]"""

from __future__ import annotations

import os
from collections.abc import Iterable
from decimal import Decimal

import numpy as np

import fabricusd
from fabricusd.errors import FabricError
from fabricusd.files import whole_file
from fabricusd.weaves.color import codes_from_palette, palette_from_codes
from fabricusd.weaves.draft import LIMIT, Draft, Side
from fabricusd.weaves.loom import thread_loom
from fabricusd.weaves.wif.syntax import USUAL_RANGES

MOST_SHAFTS = 40
"""Most shafts of a draft that is written as tie-up and treadling; a jacquard gets a lift plan."""

SECTIONS = (
    "COLOR PALETTE", "TEXT", "WEAVING", "WARP", "WEFT", "NOTES", "TIEUP", "COLOR TABLE",
    "THREADING", "WARP THICKNESS", "WARP SPACING", "WARP COLORS", "TREADLING", "LIFTPLAN",
    "WEFT THICKNESS", "WEFT SPACING", "WEFT COLORS",
)  # fmt: skip
"""The sections that may be written, in WIF's order."""


def write_wif(draft: Draft, path: str | os.PathLike[str], *, clobber: bool = True) -> None:
    """Write `draft` to the file `path`, whole or not at all; `clobber` allows replacing it.

    Raises FabricError if it cannot be written.
    """
    text = wif_text(draft)
    with whole_file(path, clobber=clobber) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def wif_text(draft: Draft) -> str:
    """The text of a WIF file, to be encoded as UTF-8, which `parse_wif` reads back as `draft`.

    Colours are written exactly in the draft's own range or else in a usual one, if either can hold
    them, and otherwise as the nearest 16-bit codes. Lengths are written in centimetres, exactly. If
    colours and weave repeat after different lengths, both are written out in full. Raises
    FabricError if that makes more than `LIMIT` threads.
    """
    ends, picks = _full(draft.warp), _full(draft.weft)
    cells = draft.weave.cells
    repeats = (ends // draft.weave.ends, picks // draft.weave.picks)
    loom = thread_loom(cells)
    # Copies of the repeat use the same shafts, so they add no cells.
    threading = np.tile(loom.threading, repeats[0])
    treadling = np.tile(loom.treadling, repeats[1])
    title = _line(draft.title or draft.weave.name)
    sections: dict[str, list[str]] = {
        "TEXT": [f"Title={title}"] + ([f"Author={_line(draft.author)}"] if draft.author else []),
        "NOTES": _numbered(_line(line) for line in draft.notes.splitlines()),
        "WEAVING": [f"Shafts={loom.shafts}", f"Treadles={loom.treadles}", "Rising Shed=true"],
        "THREADING": _numbered(threading + 1),
    }
    names = np.array([str(k + 1) for k in range(loom.shafts)], dtype=object)
    raised = [",".join(names[row]) for row in loom.tie_up]
    if loom.shafts <= MOST_SHAFTS:
        sections["TIEUP"] = _numbered(word or "0" for word in raised)
        sections["TREADLING"] = _numbered(treadling + 1)
    else:
        sections["LIFTPLAN"] = _numbered(raised[k] or "0" for k in treadling)
    for side, count in ((draft.warp, ends), (draft.weft, picks)):
        sections |= _set(side, count)
    if draft.colored:
        sections |= _colors(draft)
    listed = [name for name in SECTIONS if sections.get(name)]
    head = [
        "[WIF]",
        "Version=1.1",
        "Date=April 20, 1997",  # the constant that the specification asks for
        "Developers=fabricusd",
        "Source Program=fabricusd",
        f"Source Version={fabricusd.__version__}",
        "",
        "[CONTENTS]",
        *(f"{name}=true" for name in listed),
    ]
    for name in listed:
        head += ["", f"[{name}]", *sections[name]]
    return "\n".join(head) + "\n"


def _full(side: Side) -> int:
    """Threads after which weave and colours repeat together."""
    total = int(np.lcm(side.threads, len(side.colors) or 1))
    if total > LIMIT:
        raise FabricError(
            f"{side.label} colours",
            f"repeat after {len(side.colors)} and the weave after {side.threads} threads, "
            f"together after {total}; a WIF file must have at most {LIMIT}",
        )
    return total


def _set(side: Side, count: int) -> dict[str, list[str]]:
    """[WARP] or [WEFT], and the sections that go with it."""
    name = side.label.upper()
    lines = [f"Threads={count}"]
    if side.spacing or side.thickness or side.spacings or side.thicknesses:
        lines.append("Units=Centimeters")
    if side.spacing:
        lines.append(f"Spacing={_centimetres(side.spacing)}")
    if side.thickness:
        lines.append(f"Thickness={_centimetres(side.thickness)}")
    copies = count // side.threads
    sections = {name: lines}
    if side.spacings:
        sections[f"{name} SPACING"] = _numbered(map(_centimetres, side.spacings * copies))
    if side.thicknesses:
        sections[f"{name} THICKNESS"] = _numbered(map(_centimetres, side.thicknesses * copies))
    if side.colors:
        colors = side.colors * (count // len(side.colors))
        usual = max(set(colors), key=colors.count)
        lines.append(f"Color={usual + 1}")
        sections[f"{name} COLORS"] = _numbered(color + 1 for color in colors)
    return sections


def _colors(draft: Draft) -> dict[str, list[str]]:
    """The palette, in the first range that holds it to float32, which is what USD stores."""
    for low, high in (draft.color_range, *((0, high) for high in USUAL_RANGES)):
        codes = codes_from_palette(draft.palette, low, high)
        if np.allclose(palette_from_codes(codes, low, high), draft.palette, rtol=1e-6, atol=1e-9):
            break
    return {
        "COLOR PALETTE": [f"Entries={len(codes)}", "Form=RGB", f"Range={low},{high}"],
        "COLOR TABLE": _numbered(",".join(map(str, code)) for code in codes.tolist()),
    }


def _numbered(values: Iterable[object]) -> list[str]:
    return [f"{k}={value}" for k, value in enumerate(values, start=1)]


def _centimetres(metres: float) -> str:
    """The shortest decimal that reads back as `metres`."""
    return f"{(Decimal(repr(metres)) * 100).normalize():f}"


def _line(text: str) -> str:
    return " ".join(text.split())
