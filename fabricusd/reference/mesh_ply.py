"""PLY: ascii and binary, polygons of any size, triangle strips, UVs of vertices and of corners.

Rows of numbers are read at once where they are alike; lists of several lengths row after row.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, one_line
from fabricusd.reference.mesh_piece import MeshFile, Polygons

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
FORMATS = ("ascii", *ORDERS)

UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
INDEX_NAMES = ("vertex_indices", "vertex_index")

LONGEST_HEADER = 1 << 20
"""Bytes in which a header must end."""


def read_ply(path: Path) -> MeshFile:
    """The file's one piece. Raises FabricError."""
    body = _Body(path)
    tables: dict[str, _Table] = {}
    for element in body.elements:
        table = body.read(element)
        if element.name in ("vertex", "face", "tristrips"):
            tables.setdefault(element.name, table)
        if element.name == "face" or "face" in tables and "vertex" in tables:
            break
    points, uv, normals = _vertices(body, tables.get("vertex"))
    counts, corners, corner_uv = _faces(body, tables, len(points))
    notes = []
    if (counts < 3).any():
        notes.append(("", f"has {int((counts < 3).sum())} faces below three corners, left out"))
    given = None
    if corner_uv is not None:
        coordinates, given = corner_uv
    else:
        coordinates = None if uv is None else uv[corners]
    polygons = Polygons(
        points=points, counts=counts, corners=corners, uv=coordinates, uv_given=given,
        normals=None if normals is None else normals[corners],
    )  # fmt: skip
    return MeshFile(pieces=polygons.pieces([""], np.zeros(len(counts), np.int64)), notes=notes)


@dataclass(frozen=True, kw_only=True)
class _Property:
    """kind : of the numbers; length : of a list's count, None for a single number."""

    name: str
    kind: str
    length: str | None = None


@dataclass(frozen=True, kw_only=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Table:
    """single : property -> (n,) float64; lists : property -> ((n,) int lengths, their values)."""

    single: dict[str, NDArray[np.float64]]
    lists: dict[str, tuple[NDArray[np.int64], NDArray[np.float64]]]


class _Body:
    """What follows the header, read element by element."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._data = path.read_bytes()
        found = re.search(rb"(?:^|[\r\n])end_header[ \t]*(\r\n|\n|\r)", self._data[:LONGEST_HEADER])
        if not re.match(rb"ply[ \t]*[\r\n]", self._data) or found is None:
            self.refuse("cannot be read as PLY: it must begin with 'ply' and have an end_header")
        self._at = found.end()
        lines = re.split(rb"\r\n|\n|\r", self._data[: found.start()])[1:]
        self.form, self.elements = self._header([line.decode("latin-1") for line in lines])
        self._order = ORDERS.get(self.form, "=")
        self._line = len(lines) + 2
        if self.form == "ascii":
            self._lines = _Lines(self._data[self._at :], self._line)

    def refuse(self, problem: str, where: str = "") -> NoReturn:
        """Raise `FabricError` about the file."""
        raise FabricError(f"{self._path}{where}", problem)

    def _header(self, lines: list[str]) -> tuple[str, list[_Element]]:
        form = ""
        elements: list[tuple[str, int, list[_Property]]] = []
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
                self.refuse(f"says '{one_line(line, 60)}', which is no line of a PLY header", where)
        if not form:
            self.refuse(f"has no format; it must be one of {', '.join(FORMATS)}")
        return form, [
            _Element(name=name, count=count, properties=tuple(properties))
            for name, count, properties in elements
        ]

    def _property(self, words: list[str], where: str) -> _Property:
        if len(words) == 2 and words[0] in TYPES:
            return _Property(name=words[1], kind=TYPES[words[0]])
        if len(words) == 4 and words[0] == "list" and words[1] in TYPES and words[2] in TYPES:
            if TYPES[words[1]][0] == "f":
                self.refuse(f"counts a list by '{words[1]}'; it must be a whole number", where)
            return _Property(name=words[3], kind=TYPES[words[2]], length=TYPES[words[1]])
        self.refuse(
            f"says 'property {one_line(' '.join(words), 60)}'; it must be a type and a name, or "
            f"list, two types and a name",
            where,
        )

    def read(self, element: _Element) -> _Table:
        """All rows of the element that comes next."""
        if not element.properties or not element.count:
            return _Table(single={}, lists={})
        least = sum(np.dtype(p.length or p.kind).itemsize for p in element.properties)
        left = len(self._data) - self._at
        if self.form == "ascii":
            least, left = 2 * len(element.properties), self._lines.left + 1
        if element.count * least > left:
            self.refuse(
                f"says it has {element.count} of '{element.name}', which take {element.count * least} "
                f"bytes or more; {left} are there"
            )
        if self.form == "ascii":
            return self._read_ascii(element)
        return self._read_binary(element)

    def _read_ascii(self, element: _Element) -> _Table:
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
        return _Table(single=single, lists=lists)

    def _wrong_row(self, element: _Element, row: int, words: int) -> NoReturn:
        self.refuse(
            f"has {words} numbers, which is not what the header says of '{element.name}'",
            f":{self._lines.number(row)}",
        )

    def _wrong_list(self, element: _Element, one: _Property, row: int, count: float) -> NoReturn:
        where = f":{self._lines.number(row)}" if self.form == "ascii" else ""
        self.refuse(
            f"says that list '{one.name}' of '{element.name}' {row} has {count:.6g} values; "
            "so many are not there",
            where,
        )

    def _read_binary(self, element: _Element) -> _Table:
        """Rows as one array where all lists are as long as the first row's, else row by row."""
        if all(one.length is None for one in element.properties):
            return self._alike(element, {})
        lengths = self._first_row(element)
        if lengths is not None:
            table = self._alike(element, lengths)
            if all((table.lists[n][0] == length).all() for n, length in lengths.items()):
                return table
            self._at = self._begin
        return self._row_by_row(element)

    def _first_row(self, element: _Element) -> dict[str, int] | None:
        """Lengths of the first row's lists; None where the rows cannot all be like it."""
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

    def _alike(self, element: _Element, lengths: dict[str, int]) -> _Table:
        """All rows, whose lists are as long as `lengths` says; the caller checks that they are."""
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
        return _Table(single=single, lists=lists)

    def _row_by_row(self, element: _Element) -> _Table:
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
        return _Table(single=single, lists=lists)

    def _cut_short(self, element: _Element, row: int) -> NoReturn:
        self.refuse(f"is cut short in '{element.name}' {row} of {element.count}")


class _Lines:
    """The rows of an ascii body, one a line; empty lines do not count."""

    def __init__(self, text: bytes, first: int) -> None:
        if b"\n" not in text:
            text = text.replace(b"\r", b"\n")
        self._text = text = text + b"\n"
        data = np.frombuffer(text, np.uint8)
        ends = np.flatnonzero(data == 10)
        begins = np.concatenate([[0], ends[:-1] + 1])
        full = np.add.reduceat(~_blank(data), begins, dtype=np.int32) > 0
        self._begins, self._ends = begins[full], ends[full]
        self._numbers = np.flatnonzero(full) + first
        self._next = self._last = 0

    @property
    def left(self) -> int:
        """Bytes that are not read yet."""
        if self._next >= len(self._begins):
            return 0
        return len(self._text) - int(self._begins[self._next])

    def number(self, row: int) -> int:
        """The file's line of a row of the element that was read last."""
        return int(self._numbers[self._last + row])

    def numbers(self, body: _Body, element: _Element) -> tuple[NDArray[np.float64], NDArray[Any]]:
        """All numbers of the element's rows, and how many each row has."""
        self._last, self._next = self._next, self._next + element.count
        if self._next > len(self._begins):
            body.refuse(
                f"says it has {element.count} of '{element.name}'; "
                f"{len(self._begins) - self._last} lines are there"
            )
        begin, end = int(self._begins[self._last]), int(self._ends[self._next - 1])
        text = self._text[begin:end] + b"\n"
        data = np.frombuffer(text, np.uint8)
        blank = _blank(data)
        starts = ~blank
        starts[1:] &= blank[:-1]
        total = np.cumsum(starts, dtype=np.int32)
        words = np.diff(total[self._ends[self._last : self._next] - begin], prepend=0)
        with warnings.catch_warnings():
            # Until numpy raises ValueError for what is no number, it warns.
            warnings.simplefilter("error")
            try:
                values = np.fromstring(text, np.float64, sep=" ")
            except (DeprecationWarning, ValueError):
                values = np.zeros(0)
        if len(values) != int(total[-1]):
            self._refuse(body)
        return values, words.astype(np.int64)

    def _refuse(self, body: _Body) -> NoReturn:
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
        body.refuse("cannot be read: its numbers", f":{self.number(0)}")


def _blank(data: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Where the bytes are white space as `bytes.split` has it."""
    return np.asarray((data == 32) | ((data >= 9) & (data <= 13)))


def _spans(begins: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """begins[k], begins[k] + 1, ... for each k, `counts[k]` of them."""
    total = int(counts.sum())
    ends = np.cumsum(counts)
    return np.arange(total) + np.repeat(begins - (ends - counts), counts)


def _vertices(
    body: _Body, table: _Table | None
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Points, UVs and normals of the vertices."""
    single = {} if table is None else table.single
    if not all(axis in single for axis in "xyz"):
        body.refuse("has no vertices with x, y and z")
    points = np.stack([single[axis] for axis in "xyz"], axis=1)
    uv = next(
        (np.stack([single[a], single[b]], axis=1) for a, b in UV_NAMES
         if a in single and b in single),
        None,
    )  # fmt: skip
    normals = None
    if all(axis in single for axis in ("nx", "ny", "nz")):
        normals = np.stack([single[axis] for axis in ("nx", "ny", "nz")], axis=1)
    return points, uv, normals


def _faces(
    body: _Body, tables: dict[str, _Table], points: int
) -> tuple[
    NDArray[np.int64], NDArray[np.int64], tuple[NDArray[np.float64], NDArray[np.bool_]] | None
]:
    """Corners of each face, their vertices, and the corners' own UVs with who has them."""
    lists = tables["face"].lists if "face" in tables else {}
    name = next((n for n in INDEX_NAMES if n in lists), None)
    if name is None:
        if "tristrips" not in tables:
            return np.zeros(0, np.int64), np.zeros(0, np.int64), None
        counts, corners = _strips(tables["tristrips"])
    else:
        counts, corners = lists[name]
    whole = (corners >= 0) & (corners < points) & (corners == np.floor(corners))
    if not whole.all():
        at = int(np.argmin(whole))
        face = int(np.searchsorted(np.cumsum(counts), at, "right"))
        body.refuse(f"has face {face} with vertex {corners[at]:.15g}; there are {points}")
    corners = corners.astype(np.int64)
    if name is None or "texcoord" not in lists:
        return counts, corners, None
    lengths, values = lists["texcoord"]
    given = lengths == 2 * counts
    uv = np.zeros((len(corners), 2))
    has = np.repeat(given, counts)
    uv[has] = values[np.repeat(given, lengths)].reshape(-1, 2)
    return counts, corners, (uv, has)


def _strips(table: _Table) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Triangles of strips that -1 parts from one another."""
    found = [np.zeros((0, 3))]
    name = next((n for n in INDEX_NAMES if n in table.lists), None)
    counts, values = table.lists[name] if name else (np.zeros(0, np.int64), np.zeros(0))
    ends = np.cumsum(counts)
    cuts = np.unique(np.concatenate([ends, np.flatnonzero(values == -1), [len(values)]]))
    begin = 0
    for cut in cuts:
        strip = values[begin:cut]
        strip = strip[1:] if len(strip) and strip[0] == -1 else strip
        begin = int(cut)
        if len(strip) >= 3:
            three = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
            three[1::2] = three[1::2][:, [1, 0, 2]]
            a, b, c = three.T
            found.append(three[(a != b) & (b != c) & (a != c)])
    corners = np.concatenate(found)
    return np.full(len(corners), 3, np.int64), corners.ravel()
