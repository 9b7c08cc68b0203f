"""The lines of a WIF file, sorted into sections within fixed bounds.

Nothing is stored that is never read: private sections, unknown keys, numbers beyond any thread. The
memory for a file is therefore bounded by what a draft can hold, whatever else the file holds.
"""

from __future__ import annotations

import codecs
import io
import os
from collections.abc import Iterable, Iterator

from fabricusd.errors import FabricError
from fabricusd.files import readable_file
from fabricusd.weaves.draft import LIMIT, quoted
from fabricusd.weaves.other_drafts import refuse_other_drafts
from fabricusd.weaves.wif.syntax import LARGEST_CODE, Section, Unused, Wif

LARGEST = 256 * 1024 * 1024
"""Most bytes of a file: six times a lift plan of 4096 x 4096."""

MOST_LINES = 1_000_000
"""Most lines of a file: three times as many as the sections of the largest draft can have."""

LONGEST = 1_000_000
"""Most characters in a line: ten times the line of a lift plan that raises 16384 shafts."""

MOST_NOTES = 1_000_000
"""Most characters of [NOTES]; the rest is left out with a warning."""

KEYS = {
    "WIF": (),
    "TEXT": ("title", "author"),
    "WEAVING": ("shafts", "treadles", "rising shed"),
    "WARP": ("threads", "color", "units", "spacing", "thickness"),
    "WEFT": ("threads", "color", "units", "spacing", "thickness"),
    "COLOR PALETTE": ("form", "range"),
}
"""Section -> the keys that are read."""

NUMBERED = {
    "COLOR TABLE": LARGEST_CODE,
    "TIEUP": LIMIT,
    "THREADING": LIMIT,
    "TREADLING": LIMIT,
    "LIFTPLAN": LIMIT,
    "WARP COLORS": LIMIT,
    "WARP SPACING": LIMIT,
    "WARP THICKNESS": LIMIT,
    "WEFT COLORS": LIMIT,
    "WEFT SPACING": LIMIT,
    "WEFT THICKNESS": LIMIT,
    "NOTES": MOST_LINES,
}
"""Section whose keys are whole numbers -> the largest number that has a meaning."""

NOT_READ = (
    "CONTENTS", "TRANSLATIONS", "BITMAP IMAGE", "BITMAP FILE",
    *(
        f"{label} {name}"
        for label in ("WARP", "WEFT")
        for name in ("SYMBOL PALETTE", "SYMBOL TABLE", "SYMBOLS", "SPACING ZOOM", "THICKNESS ZOOM")
    ),
)  # fmt: skip
"""Sections of WIF that say nothing about the cloth. All others are private or unknown."""

BLANK = "\0\ufeff" + "".join(c for c in map(chr, range(0x3001)) if c.isspace())
"""Characters without meaning around sections, keys and values."""


def file_lines(path: str | os.PathLike[str]) -> Iterator[str]:
    """The decoded lines of the file `path`, with any of the three kinds of line end.

    UTF-8, -16 and -32 are recognised by their byte order marks, UTF-16 without a mark by its zeros.
    Other files are UTF-8, or, if they are not valid UTF-8, Windows code page 1252. Raises
    FabricError for a file of more than `LARGEST` bytes, before it is read, and for a file that is
    known not to be WIF.
    """
    source = readable_file(path)
    size = source.stat().st_size
    with source.open("rb") as stream:
        head = stream.read(256)
        refuse_other_drafts(path, head)
        if size > LARGEST:
            raise FabricError(
                str(path), f"has {size} bytes; a WIF draft must have at most {LARGEST}"
            )
        stream.seek(0)
        encoding = _encoding(head) or _utf_8_or_windows(stream)
        stream.seek(0)
        # Five bytes are undefined in code page 1252; they can only occur in a title or in notes.
        with io.TextIOWrapper(stream, encoding, errors="replace", newline=None) as text:
            yield from _bounded(text, str(path))


def text_lines(text: str, file: str) -> Iterator[str]:
    """The lines of `text`, with any of the three kinds of line end."""
    return _bounded(io.StringIO(text, newline=None), file)


def _bounded(text: io.TextIOBase, file: str) -> Iterator[str]:
    for number in range(1, MOST_LINES + 2):
        line = text.readline(LONGEST + 1)
        if not line:
            return
        if len(line) > LONGEST and not line.endswith("\n"):
            raise FabricError(
                f"{file} line {number}",
                f"is too long for a WIF draft; it must have at most {LONGEST} characters",
            )
        yield line
    raise FabricError(
        file, f"has too many lines for a WIF draft; it must have at most {MOST_LINES}"
    )


def _encoding(head: bytes) -> str:
    """The encoding that the first bytes reveal, or "" if they do not."""
    # UTF-32 first: its byte order mark begins with that of UTF-16.
    if head.startswith((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)):
        return "utf-32"
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    first = head[:16]
    if len(first) >= 4 and any(first[0::2]) != any(first[1::2]):
        return "utf-16-le" if any(first[0::2]) else "utf-16-be"
    return ""


def _utf_8_or_windows(stream: io.BufferedReader) -> str:
    decoder = codecs.getincrementaldecoder("utf-8")()
    try:
        while chunk := stream.read(1 << 20):
            decoder.decode(chunk)
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def read_sections(lines: Iterable[str], file: str) -> Wif:
    """The sections of a draft, as far as they are read. Sections of the same name are merged.

    The numbers of threads and shafts are checked at the end of their section, so that a draft with
    too many is refused before its lines are read. Lines that nothing uses are counted and become
    warnings. Raises FabricError if there is no section `[WIF]`, which every WIF file has.
    """
    sorter = _Sorter(file)
    for line in lines:
        sorter.add(line.strip(BLANK))
    return sorter.done()


class _Sorter:
    """Sorts lines into sections, and counts the lines that belong nowhere."""

    def __init__(self, file: str) -> None:
        self.wif = Wif(file)
        self.section: Section | None = None
        self.begun = False
        self.notes = 0
        self.early = Unused()
        self.without_value = Unused()
        self.unknown = Unused()

    def add(self, line: str) -> None:
        """Sort one line, stripped of the blanks around it."""
        if not line or line[0] in ";#":
            return
        if line[0] == "[" and "]" in line:
            self._begin(" ".join(line[1 : line.index("]")].upper().split()))
        elif not self.begun:
            self.early.add(line)
        elif self.section is not None:
            key, equals, value = line.partition("=")
            key = key.strip(BLANK)
            if equals and key:
                self._keep(self.section, key, value.strip(BLANK))
            else:
                self.without_value.add(line)

    def _begin(self, name: str) -> None:
        self._judge()
        self.begun = True
        self.section = None
        if name in KEYS or name in NUMBERED:
            self.section = self.wif.sections.setdefault(name, Section(self.wif.file, name))
        elif name not in NOT_READ and not name.startswith("PRIVATE"):
            self.unknown.add(name)

    def _keep(self, section: Section, key: str, value: str) -> None:
        if section.name in KEYS:
            key = " ".join(key.lower().split())
            if key in KEYS[section.name]:
                section.values[key] = value
            return
        # Python refuses to convert numbers of thousands of digits.
        number = int(key) if key.isascii() and key.isdigit() and len(key) < 20 else -1
        if not 0 <= number <= NUMBERED[section.name]:
            section.strays.add(key)
        elif section.name == "NOTES":
            self.notes += len(value)
            if self.notes <= MOST_NOTES:
                section.numbered[number] = value
        else:
            value = value.partition(";")[0].strip(BLANK)
            # A value that is not ASCII is not a number, and only a message will quote it. Cut it:
            # such a string can take four times the memory.
            section.numbered[number] = value if value.isascii() else value[:60]

    def _judge(self) -> None:
        if self.section is None:
            return
        if self.section.name in ("WARP", "WEFT"):
            self.section.integer("Threads", 1, LIMIT)
        elif self.section.name == "WEAVING":
            self.section.integer("Shafts", 0, LIMIT)

    def done(self) -> Wif:
        """The sections, once all lines are added."""
        self._judge()
        wif = self.wif
        if "WIF" not in wif.sections:
            raise FabricError(
                wif.file, "has no section [WIF]; it must be a WIF draft, and all of those have one"
            )
        for unused, what in (
            (self.early, "line(s) before the first section are"),
            (self.without_value, "line(s) are not KEY=VALUE and are"),
            (self.unknown, "section(s) are not part of WIF and are"),
        ):
            if unused.count:
                wif.warn(f"{unused.count} {what} not used, such as {quoted(unused.first, 40)}.")
        if self.notes > MOST_NOTES:
            wif.warn(f"[NOTES] has {self.notes} characters; those after {MOST_NOTES} are left out.")
        return wif
