"""Parses a PLY file: its header, and the numbers and lists of every element.

Rows with the same layout are read all at once; binary rows with lists of different lengths are read
one by one.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NoReturn

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, one_line
from fabricusd.scene.files.number_text import is_blank, parsed, word_starts

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
FORMATS = ("ascii", *ORDERS)

LONGEST_HEADER = 1 << 20
"""Largest number of bytes of a header."""


@dataclass(frozen=True, kw_only=True)
class Property:
    """A property of an element.

    kind : numpy type of the numbers; length : numpy type of a list's count, None for a single
        number
    """

    name: str
    kind: str
    length: str | None = None


@dataclass(frozen=True, kw_only=True)
class Element:
    """An element of the header: `count` rows with the same properties."""

    name: str
    count: int
    properties: tuple[Property, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """The values of an element's n rows.

    single : property -> (n,) float64; lists : property -> ((n,) int lengths, all values in a row)
    """

    single: dict[str, NDArray[np.float64]]
    lists: dict[str, tuple[NDArray[np.int64], NDArray[np.float64]]]


class PlyBody:
    """A PLY file whose elements are read one after another."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._data = path.read_bytes()
        found = re.search(
            rb"(?:\r\n|\r|\n)end_header[ \t]*(\r\n|\n|\r)", self._data[:LONGEST_HEADER]
        )
        if not re.match(rb"ply[ \t]*[\r\n]", self._data) or found is None:
            self.refuse("cannot be read as PLY: it must begin with 'ply' and have an end_header")
        self._at = found.end()
        lines = re.split(rb"\r\n|\n|\r", self._data[: found.start()])[1:]
        self.form, self.elements = self._header([line.decode("latin-1") for line in lines])
        self._order: Literal["<", ">"] = ">" if self.form == "binary_big_endian" else "<"
        if self.form == "ascii":
            self._lines = _Lines(self._data[self._at :], len(lines) + 3)

    def refuse(self, problem: str, where: str = "") -> NoReturn:
        """Raise `FabricError` about the file."""
        raise FabricError(f"{self._path}{where}", one_line(problem))

    def _header(self, lines: list[str]) -> tuple[str, list[Element]]:
        form = ""
        elements: list[tuple[str, int, list[Property]]] = []
        for number, line in enumerate(lines, 2):
            words = line.split()
            where = f":{number}"
            if not words or words[0] in ("comment", "obj_info"):
                continue
            if words[0] == "format" and len(words) == 3 and words[1] in FORMATS:
                form = words[1]
            elif words[0] == "element" and len(words) == 3 and re.fullmatch(r"\d{1,18}", words[2]):
                elements.append((words[1], int(words[2]), []))
            elif words[0] == "property" and elements:
                elements[-1][2].append(self._property(words[1:], where))
            else:
                self.refuse(f"says '{one_line(line, 60)}', which is not valid in a header", where)
        if not form:
            self.refuse(f"has no format; it must be one of {', '.join(FORMATS)}")
        return form, [
            Element(name=name, count=count, properties=tuple(properties))
            for name, count, properties in elements
        ]

    def _property(self, words: list[str], where: str) -> Property:
        if len(words) == 2 and words[0] in TYPES:
            return Property(name=words[1], kind=TYPES[words[0]])
        if len(words) == 4 and words[0] == "list" and words[1] in TYPES and words[2] in TYPES:
            if TYPES[words[1]][0] == "f":
                self.refuse(f"counts a list by '{words[1]}'; it must be an integer type", where)
            return Property(name=words[3], kind=TYPES[words[2]], length=TYPES[words[1]])
        self.refuse(
            f"says 'property {one_line(' '.join(words), 60)}'; it must be 'property', a type and a "
            "name, or 'property list', two types and a name",
            where,
        )

    def read(self, element: Element) -> Table:
        """Read all rows of the next element."""
        if not element.properties or not element.count:
            return Table(single={}, lists={})
        least = sum(np.dtype(p.length or p.kind).itemsize for p in element.properties)
        left = len(self._data) - self._at
        if self.form == "ascii":
            least, left = 2 * len(element.properties), self._lines.left + 1
        if element.count * least > left:
            self.refuse(
                f"says it has {element.count} rows of '{element.name}', which take at least "
                f"{element.count * least} bytes; {left} are left"
            )
        if self.form == "ascii":
            return self._read_ascii(element)
        return self._read_binary(element)

    def _read_ascii(self, element: Element) -> Table:
        values, words = self._lines.numbers(self, element)
        begins = np.cumsum(words) - words
        # Where each row's next property begins, in `values`.
        at = begins.copy()
        single: dict[str, NDArray[np.float64]] = {}
        lists: dict[str, tuple[NDArray[np.int64], NDArray[np.float64]]] = {}
        padded = np.concatenate([values, [0.0]])
        for one in element.properties:
            short = at >= begins + words
            if short.any():
                self._wrong_row(element, int(np.argmax(short)), int(words[np.argmax(short)]))
            first = padded[at]
            at = at + 1
            if one.length is None:
                single[one.name] = first
                continue
            wrong = ~((first >= 0) & (first <= begins + words - at) & (first == np.floor(first)))
            if wrong.any():
                row = int(np.argmax(wrong))
                self._wrong_list(element, one, row, first[row])
            counts = first.astype(np.int64)
            lists[one.name] = counts, values[_spans(at, counts)]
            at = at + counts
        over = at != begins + words
        if over.any():
            self._wrong_row(element, int(np.argmax(over)), int(words[np.argmax(over)]))
        return Table(single=single, lists=lists)

    def _wrong_row(self, element: Element, row: int, words: int) -> NoReturn:
        self.refuse(
            f"has {words} numbers, which does not match the header's '{element.name}'",
            f":{self._lines.number(row)}",
        )

    def _wrong_list(self, element: Element, one: Property, row: int, count: float) -> NoReturn:
        where = f":{self._lines.number(row)}" if self.form == "ascii" else ""
        self.refuse(
            f"says that list '{one.name}' of '{element.name}' {row} has {count:.6g} values, which "
            "are not there",
            where,
        )

    def _read_binary(self, element: Element) -> Table:
        """Read the rows as one array if all have lists of the same lengths, else one by one."""
        if all(one.length is None for one in element.properties):
            return self._alike(element, {})
        lengths = self._first_row(element)
        if lengths is not None:
            table = self._alike(element, lengths)
            if all((table.lists[n][0] == length).all() for n, length in lengths.items()):
                return table
            self._at = self._begin
        return self._row_by_row(element)

    def _first_row(self, element: Element) -> dict[str, int] | None:
        """Lengths of the lists in the first row; None if not all rows can have these lengths."""
        self._begin = at = self._at
        lengths: dict[str, int] = {}
        for one in element.properties:
            kind = np.dtype(one.length or one.kind).newbyteorder(self._order)
            if at + kind.itemsize > len(self._data):
                return None
            if one.length is not None:
                count = int(np.frombuffer(self._data, kind, 1, at)[0])
                if count < 0:
                    return None
                lengths[one.name] = count
                at += count * np.dtype(one.kind).itemsize
            at += kind.itemsize
        fits = (at - self._at) * element.count <= len(self._data) - self._at
        return lengths if fits else None

    def _alike(self, element: Element, lengths: dict[str, int]) -> Table:
        """Read all rows as if their lists had these `lengths`; the caller checks that they have."""
        fields: list[Any] = []
        for k, one in enumerate(element.properties):
            kind = self._order + one.kind
            if one.length is None:
                fields.append((f"{k}", kind))
            else:
                fields.append((f"{k}n", self._order + one.length))
                fields.append((f"{k}", kind, (lengths[one.name],)))
        rows = np.frombuffer(self._data, np.dtype(fields), element.count, self._at)
        self._at += rows.nbytes
        single = {
            one.name: rows[f"{k}"].astype(np.float64)
            for k, one in enumerate(element.properties) if one.length is None
        }  # fmt: skip
        lists = {
            one.name: (rows[f"{k}n"].astype(np.int64), rows[f"{k}"].astype(np.float64).ravel())
            for k, one in enumerate(element.properties) if one.length is not None
        }  # fmt: skip
        return Table(single=single, lists=lists)

    def _row_by_row(self, element: Element) -> Table:
        data, at, end = self._data, self._at, len(self._data)
        order = "little" if self._order == "<" else "big"
        steps = [
            (k, np.dtype(one.kind).itemsize, one.length and np.dtype(one.length).itemsize,
             one.length is not None and one.length[0] == "i")
            for k, one in enumerate(element.properties)
        ]  # fmt: skip
        places: list[list[int]] = [[] for _ in steps]
        counts: list[list[int]] = [[] for _ in steps]
        for row in range(element.count):
            for k, size, length, signed in steps:
                if length:
                    if at + length > end:
                        self._cut_short(element, row)
                    count = int.from_bytes(data[at : at + length], order, signed=signed)  # type: ignore[arg-type]
                    at += length
                    if count < 0 or at + count * size > end:
                        self._wrong_list(element, element.properties[k], row, count)
                    counts[k].append(count)
                    size *= count
                places[k].append(at)
                at += size
            if at > end:
                self._cut_short(element, row)
        self._at = at
        raw = np.frombuffer(data, np.uint8)
        single: dict[str, NDArray[np.float64]] = {}
        lists: dict[str, tuple[NDArray[np.int64], NDArray[np.float64]]] = {}
        for k, one in enumerate(element.properties):
            number = np.array(counts[k] if one.length else [1] * element.count, np.int64)
            kind = np.dtype(self._order + one.kind)
            taken = raw[_spans(np.array(places[k], np.int64), number * kind.itemsize)]
            values = taken.view(kind).astype(np.float64)
            if one.length is None:
                single[one.name] = values
            else:
                lists[one.name] = number, values
        return Table(single=single, lists=lists)

    def _cut_short(self, element: Element, row: int) -> NoReturn:
        self.refuse(f"is cut short in '{element.name}' {row} of {element.count}")


class _Lines:
    """The rows of an ascii body, one per line; empty lines are skipped."""

    def __init__(self, text: bytes, first: int) -> None:
        if b"\n" not in text:
            text = text.replace(b"\r", b"\n")
        self._text = text = text + b"\n"
        data = np.frombuffer(text, np.uint8)
        ends = np.flatnonzero(data == 10)
        begins = np.concatenate([[0], ends[:-1] + 1])
        full = np.add.reduceat(~is_blank(data), begins, dtype=np.int32) > 0
        self._begins, self._ends = begins[full], ends[full]
        self._numbers = np.flatnonzero(full) + first
        self._next = self._last = 0

    @property
    def left(self) -> int:
        """Number of bytes that have not been read yet."""
        if self._next >= len(self._begins):
            return 0
        return len(self._text) - int(self._begins[self._next])

    def number(self, row: int) -> int:
        """The line number in the file of a row of the element that was read last."""
        return int(self._numbers[self._last + row])

    def numbers(self, body: PlyBody, element: Element) -> tuple[NDArray[np.float64], NDArray[Any]]:
        """All numbers in the element's rows, and the count in each row."""
        self._last, self._next = self._next, self._next + element.count
        if self._next > len(self._begins):
            body.refuse(
                f"says it has {element.count} rows of '{element.name}'; "
                f"{len(self._begins) - self._last} lines are left"
            )
        begin, end = int(self._begins[self._last]), int(self._ends[self._next - 1])
        text = self._text[begin:end] + b"\n"
        data = np.frombuffer(text, np.uint8)
        total = np.cumsum(word_starts(data), dtype=np.int32)
        words = np.diff(total[self._ends[self._last : self._next] - begin], prepend=0)
        values = parsed(data, np.float64)
        if values is None or len(values) != int(total[-1]):
            self._refuse(body)
        return values, words.astype(np.int64)

    def _refuse(self, body: PlyBody) -> NoReturn:
        for row in range(self._next - self._last):
            k = self._last + row
            for word in self._text[self._begins[k] : self._ends[k]].split():
                try:
                    float(word.replace(b"_", b"?"))
                except ValueError:
                    body.refuse(
                        f"holds '{one_line(word.decode('latin-1'), 40)}'; it must hold numbers",
                        f":{self.number(row)}",
                    )
        body.refuse("and the lines below hold numbers that cannot be read", f":{self.number(0)}")


def _spans(begins: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Concatenate, for each k, the `counts[k]` integers that start at `begins[k]`."""
    total = int(counts.sum())
    ends = np.cumsum(counts)
    return np.arange(total) + np.repeat(begins - (ends - counts), counts)
