"""Reads Wavefront OBJ: polygons, UVs, normals, and the names of objects and groups.

The reader goes by kind of line instead of line by line: all `v` lines become one array of numbers,
then all `vt` lines, and so on, in blocks of limited size. Materials, curves and smoothing groups
are not read.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, one_line
from fabricusd.scene.files.number_text import is_blank, parsed, word_starts, words_per_line
from fabricusd.scene.files.piece import QUIET, MeshFile, Polygons

BYTES_AT_ONCE = 1 << 22
"""Number of bytes that are processed at once."""

V, VT, VN, F = 1, 2, 3, 4
WORDS = {b"v": V, b"vt": VT, b"vn": VN, b"f": F}
FEWEST = {V: 3, VT: 1, VN: 3}
"""Smallest number of values in a line; `vt u` means (u, 0), as the format specifies."""

NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf(inity)?)", re.IGNORECASE)
MOST_DIGITS = 18
"""Largest number of digits of an index: beyond it, 64 bits overflow, and numpy returns arbitrary
numbers."""
CORNER = re.compile(rb"N(/(N)?(/(N)?)?)?".replace(b"N", rb"[+-]?\d{1,%d}" % (MOST_DIGITS - 1)))
_NOT_A_SURFACE = {b"l": "lines", b"p": "points", b"curv": "curves", b"curv2": "curves"}
_FREE_FORM = (b"surf",)


@QUIET
def read_obj(path: Path) -> MeshFile:
    """Read the file's pieces, one for each name of an object or group. Raises FabricError."""
    text = _Text(path)
    numbers = {kind: text.numbers(kind) for kind in (V, VT, VN)}
    faces = text.faces()
    points = numbers[V]
    counts = {kind: len(numbers[kind]) for kind in (V, VT, VN)}
    index = [text.resolved(faces, slot, kind, counts[kind]) for slot, kind in _SLOTS]
    notes = text.notes()
    if (faces.counts < 3).any():
        notes.append(
            ("", f"has {int((faces.counts < 3).sum())} faces below three corners, left out")
        )
    uv, normals = (
        None if not (k >= 0).any() else values[np.maximum(k, 0)]
        for k, values in ((index[1], numbers[VT]), (index[2], numbers[VN]))
    )
    names, piece = text.pieces(faces.lines)
    polygons = Polygons(
        points=points, counts=faces.counts, corners=index[0],
        uv=uv, uv_given=index[1] >= 0, normals=normals, normal_given=index[2] >= 0,
    )  # fmt: skip
    return MeshFile(pieces=polygons.pieces(names, piece), notes=notes)


_SLOTS = ((0, V), (1, VT), (2, VN))
_NAMES = {V: "v", VT: "vt", VN: "vn"}


@dataclass(frozen=True, kw_only=True, eq=False)
class _Faces:
    """The faces of a file.

    lines : (f,) int - line numbers of the `f` lines; counts : (f,) int - corners of each face
    index : (c, 3) int64 - v, vt and vn of each corner as written in the file, 0 if missing
    """

    lines: NDArray[np.int64]
    counts: NDArray[np.int64]
    index: NDArray[np.int64]


class _Text:
    """The file's bytes, split into lines of known kinds."""

    def __init__(self, path: Path) -> None:
        self._path = path
        original = path.read_bytes()
        if b"\n" not in original:
            original = original.replace(b"\r", b"\n")
        if original.startswith(b"\xef\xbb\xbf"):
            original = b"   " + original[3:]
        self._original = original
        if b"\\" in original:
            # A backslash continues a line. Replacing it by blanks keeps every byte where it was.
            original = re.sub(rb"\\[ \t]*\r?\n", lambda m: b" " * len(m[0]), original)
        self._bytes = original
        data = np.frombuffer(original + b"\n\n\n", np.uint8)
        breaks = np.flatnonzero(data[: len(original)] == 10)
        self._starts = np.concatenate([[0], breaks + 1])
        self._ends = np.concatenate([breaks, [len(original)]])
        self._kinds = self._classify(data)

    def _classify(self, data: NDArray[np.uint8]) -> NDArray[np.int8]:
        """(lines,) the kind of each line, 0 for lines without numbers."""
        first, second, third = (data[self._starts + k] for k in range(3))
        kinds = np.zeros(len(self._starts), np.int8)
        kinds[(first == ord("v")) & is_blank(second)] = V
        kinds[(first == ord("f")) & is_blank(second)] = F
        for letter, kind in ((b"t", VT), (b"n", VN)):
            kinds[(first == ord("v")) & (second == ord(letter)) & is_blank(third)] = kind
        for line in np.flatnonzero(is_blank(first) & (self._ends > self._starts)):
            words = self._line(line).split(None, 1)
            kinds[line] = WORDS.get(words[0], 0) if words else 0
        others = (kinds == 0) & (self._ends > self._starts) & (first != ord("#"))
        self._others = [
            (line, words)
            for line in np.flatnonzero(others)
            if (words := self._line(line).split(None, 1))
        ]
        return kinds

    def _line(self, line: Any) -> bytes:
        return self._bytes[self._starts[line] : self._ends[line]]

    def _where(self, line: Any) -> str:
        return f"{self._path}:{self._original.count(10, 0, int(self._starts[line])) + 1}"

    def _blocks(self, kind: int) -> Any:
        """Yield blocks: (line numbers, the bytes of these lines of the kind without keywords)."""
        lines = np.flatnonzero(self._kinds == kind)
        sizes = np.cumsum(self._ends[lines] - self._starts[lines] + 1)
        last = 0
        while last < len(lines):
            done = sizes[last - 1] if last else 0
            first, last = last, max(int(np.searchsorted(sizes, done + BYTES_AT_ONCE)), last + 1)
            part = lines[first:last]
            yield part, self._joined(part, 1 if kind in (V, F) else 2)

    def _joined(self, lines: NDArray[np.int64], keyword: int) -> NDArray[np.uint8]:
        """The bytes of `lines`, each ending with a line feed; keywords and comments are blanked."""
        # Copy runs of consecutive lines in one piece.
        breaks = np.flatnonzero(np.diff(lines) != 1) + 1
        firsts = lines[np.concatenate([[0], breaks])]
        lasts = lines[np.concatenate([breaks - 1, [len(lines) - 1]])]
        runs = zip(self._starts[firsts].tolist(), self._ends[lasts].tolist(), strict=True)
        joined = b"\n".join([self._bytes[a:b] for a, b in runs]) + b"\n"
        if b"#" in joined:
            joined = re.sub(rb"#[^\n]*", lambda m: b" " * len(m[0]), joined)
        data = np.frombuffer(bytearray(joined), np.uint8)
        begins = np.concatenate([[0], np.flatnonzero(data == 10)[:-1] + 1])
        if is_blank(data[begins]).any():
            # In indented lines, blanks stand where the keyword would be.
            words = np.flatnonzero(word_starts(data))
            begins = words[np.searchsorted(words, begins)]
        for k in range(keyword):
            data[begins + k] = 32
        return data

    def numbers(self, kind: int) -> NDArray[np.float64]:
        """(k, 3) float64 numbers of all lines of the kind; (k, 2) for `vt` lines."""
        width = 2 if kind == VT else 3
        parts = []
        for lines, data in self._blocks(kind):
            counts = words_per_line(data)
            values = parsed(data, np.float64)
            if values is None or len(values) != counts.sum() or (counts < FEWEST[kind]).any():
                raise self._bad_number(lines, kind)
            begins = np.cumsum(counts) - counts
            if (counts == counts[0]).all() and counts[0] >= width:
                parts.append(values.reshape(len(lines), -1)[:, :width])
                continue
            table = np.zeros((len(lines), width))
            for k in range(width):
                has = counts > k
                table[has, k] = values[begins[has] + k]
            parts.append(table)
        return np.concatenate(parts) if parts else np.zeros((0, width))

    def _bad_number(self, lines: NDArray[np.int64], kind: int) -> FabricError:
        for line in lines:
            words = self._line(line).split(b"#")[0].split()[1:]
            bad = next((w for w in words if not NUMBER.fullmatch(w)), None)
            if bad is not None:
                return FabricError(
                    self._where(line), f"has '{_text(bad)}'; {_NAMES[kind]} takes numbers"
                )
            if len(words) < FEWEST[kind]:
                return FabricError(
                    self._where(line),
                    f"has {len(words)} numbers; {_NAMES[kind]} needs at least {FEWEST[kind]}",
                )
        return FabricError(self._where(int(lines[0])), "and the lines below cannot be read")

    def faces(self) -> _Faces:
        """All `f` lines, with indices as written in the file."""
        lines, counts, index = [], [], []
        for part, data in self._blocks(F):
            found = _corners(data)
            if found is None:
                raise self._bad_corner(part)
            lines.append(part)
            counts.append(words_per_line(data))
            index.append(found)
        if not lines:
            return _Faces(
                lines=np.zeros(0, np.int64), counts=np.zeros(0, np.int64),
                index=np.zeros((0, 3), np.int64),
            )  # fmt: skip
        return _Faces(
            lines=np.concatenate(lines), counts=np.concatenate(counts), index=np.concatenate(index)
        )

    def _bad_corner(self, lines: NDArray[np.int64]) -> FabricError:
        for line in lines:
            for word in self._line(line).split(b"#")[0].split()[1:]:
                zero = any(
                    part.lstrip(b"+-").strip(b"0") == b"" for part in word.split(b"/") if part
                )
                if not CORNER.fullmatch(word) or zero:
                    return FabricError(
                        self._where(line),
                        f"has the corner '{_text(word)}'; it must look like 7, 7/3, 7//2 or 7/3/2, "
                        "with numbers from 1 up or from -1 down",
                    )
        return FabricError(self._where(int(lines[0])), "and the lines below cannot be read")

    def resolved(self, faces: _Faces, slot: int, kind: int, total: int) -> NDArray[np.int64]:
        """(c,) zero-based index of each corner's v, vt or vn; -1 if the corner has none.

        Negative numbers in the file count back from the line in which they stand.
        """
        index = faces.index[:, slot]
        if (index < 0).any():
            before = np.searchsorted(np.flatnonzero(self._kinds == kind), faces.lines)
            before = np.repeat(before, faces.counts)
            # An index that counts back beyond the first line stays negative and is refused; it must
            # not be mistaken for a missing one.
            found = np.where(index < 0, before + index, index - 1)
            wrong = (index != 0) & ((found < 0) | (found >= total))
        else:
            found, wrong = index - 1, index > total
        if wrong.any():
            corner = int(np.argmax(wrong))
            face = int(np.searchsorted(np.cumsum(faces.counts), corner, "right"))
            line = int(faces.lines[face])
            words = self._line(line).split(b"#")[0].split()[1:]
            word = words[corner - int(faces.counts[:face].sum())]
            given = word.split(b"/")[slot]
            name = _NAMES[kind]
            there = f"{total} {name} lines"
            if given.startswith(b"-"):
                there = f"{int(before[corner])} {name} lines before it"
            raise FabricError(
                self._where(line),
                f"has the corner '{_text(word)}' with {name} {_text(given)}; there are {there}",
            )
        return np.asarray(found)

    def pieces(self, lines: NDArray[np.int64]) -> tuple[list[str], NDArray[np.int64]]:
        """The names of the pieces, and the piece to which each face line belongs.

        A piece is named by its object and the group within it. A new object ends the group.
        """
        numbers: dict[str, int] = {"": 0}
        begins, which = [0], [0]
        whole = group = ""
        for line, (keyword, *rest) in self._others:
            if keyword not in (b"o", b"g"):
                continue
            name = _text(rest[0] if rest else b"", 200)
            if keyword == b"o":
                whole, group = name, ""
            else:
                group = name
            together = ".".join(dict.fromkeys(n for n in (whole, group) if n))
            begins.append(int(line))
            which.append(numbers.setdefault(together, len(numbers)))
        at = np.searchsorted(begins, lines, "right") - 1
        return list(numbers), np.array(which, np.int64)[at]

    def notes(self) -> list[tuple[str, str]]:
        """Notes about what the file holds besides polygons."""
        found: dict[str, int] = {}
        for _, (keyword, *_) in self._others:
            noun = _NOT_A_SURFACE.get(keyword)
            if keyword in _FREE_FORM:
                noun = "free-form surfaces"
            if noun:
                found[noun] = found.get(noun, 0) + 1
        return [("", f"has {count} {noun}, left out") for noun, count in found.items()]


def _text(word: bytes, longest: int = 60) -> str:
    """Decode a name or word as UTF-8, or else as Latin-1, into one printable line."""
    try:
        return one_line(word.decode("utf-8"), longest)
    except UnicodeDecodeError:
        return one_line(word.decode("latin-1"), longest)


def _corners(data: NDArray[np.uint8]) -> NDArray[np.int64] | None:
    """(c, 3) int64 v, vt and vn of the corners in `data`, 0 if missing; None if any corner is
    malformed."""
    starts = word_starts(data)
    slash = data == 47
    digit = ((data >= 48) & (data <= 57)) | (data == 43) | (data == 45)
    if not (slash | digit | is_blank(data)).all():
        return None
    number = digit.copy()
    number[1:] &= ~digit[:-1]
    at = np.flatnonzero(number)
    ends = digit.copy()
    ends[:-1] &= ~digit[1:]
    if len(at) and int((np.flatnonzero(ends) - at).max()) >= MOST_DIGITS:
        return None
    word = np.cumsum(starts, dtype=np.int32)[at] - 1
    slashes = np.cumsum(slash, dtype=np.int32)
    slot = slashes[at] - slashes[starts][word] if slash.any() else np.zeros(len(at), np.int32)
    values = parsed(np.where(slash, np.uint8(32), data), np.int64)
    words = int(starts.sum())
    # Every word must begin with the number of its point.
    if values is None or len(values) != len(at) or not digit[starts].all():
        return None
    if (slot > 2).any() or (values == 0).any():
        return None
    table = np.zeros((words, 3), np.int64)
    table[word, slot] = values
    return table
