"""Parses a glTF 2.0 file: the container, the JSON, the buffers, and accessors as arrays."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, one_line
from fabricusd.files import readable_file

TYPES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
LARGEST = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}
"""The integers that stand for 1.0 in normalized accessors, by component type."""

MOST_ZEROS = 4_000_000
"""Largest number of zeros in an accessor without a buffer view."""

_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_COMPRESSED = ("EXT_meshopt_compression", "KHR_meshopt_compression")


class Document:
    """The JSON of `path`; callers ask for its entries by the type that they must have.

    An entry that is missing, of another type or out of range raises a `FabricError` that names it,
    as in `x.glb accessors[3].count is -1; it must be a whole number from 0`.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        content = path.read_bytes()
        self._binary: bytes | None = None
        text = self._unpacked(content) if content[:4] == b"glTF" else content
        try:
            root = json.loads(text.decode("utf-8-sig"), parse_constant=_no_constant)
        except (ValueError, RecursionError) as error:
            words = one_line(str(error), 120)
            raise FabricError(str(path), f"cannot be read as glTF: its JSON: {words}") from error
        if not isinstance(root, dict):
            raise FabricError(str(path), "cannot be read as glTF: its JSON must be an object")
        self.root: dict[str, Any] = root
        version = str(self.entry(root, "asset", dict, "", {}).get("version", "missing"))
        if not version.startswith("2."):
            self.refuse("asset.version", f"is {one_line(version, 20)}; it must be 2.0")
        self._buffers: dict[int, bytes] = {}
        self._arrays: dict[int, NDArray[Any]] = {}

    def refuse(self, where: str, problem: str) -> NoReturn:
        """Raise `FabricError` about an entry of the file."""
        raise FabricError(f"{self._path} {where}".strip(), one_line(problem))

    def _unpacked(self, content: bytes) -> bytes:
        """The JSON of a binary file; stores its binary chunk."""
        if len(content) < 20:
            self.refuse("", f"cannot be read as glTF: it ends after {len(content)} bytes")
        version, _ = struct.unpack_from("<II", content, 4)
        if version != 2:
            self.refuse("", f"is a .glb of version {version}; it must be 2")
        chunks: dict[int, bytes] = {}
        at = 12
        while at + 8 <= len(content):
            size, kind = struct.unpack_from("<II", content, at)
            if at + 8 + size > len(content):
                self.refuse(
                    "",
                    f"is cut short: a chunk should have {size} bytes, but only "
                    f"{len(content) - at - 8} are left",
                )
            chunks.setdefault(kind, content[at + 8 : at + 8 + size])
            at += 8 + size + -size % 4
        if _JSON not in chunks:
            self.refuse("", "cannot be read as glTF: it has no JSON chunk")
        self._binary = chunks.get(_BINARY)
        return chunks[_JSON]

    def entry(
        self, holder: dict[str, Any], key: str, kind: type, where: str, default: Any = None
    ) -> Any:
        """`holder[key]`, which must be of type `kind` and, if a number, at least 0.

        Returns `default` if the key is missing.
        """
        value = holder.get(key, default)
        if value is default:
            return default
        name = f"{where}.{key}".lstrip(".")
        right = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
        if not right or (kind is int and not 0 <= value < 1 << 53):
            word = {
                int: "a whole number from 0", str: "a text", bool: "true or false",
                dict: "an object", list: "a list",
            }[kind]  # fmt: skip
            self.refuse(name, f"is {_short(value)}; it must be {word}")
        return value

    def numbers(
        self, holder: dict[str, Any], key: str, count: int | None, where: str
    ) -> list[float] | None:
        """The list `holder[key]` of `count` numbers, or of any length if None; None if missing."""
        values = self.entry(holder, key, list, where)
        if values is None:
            return None
        for value in values:
            if not isinstance(value, int | float) or isinstance(value, bool):
                self.refuse(f"{where}.{key}", f"holds {_short(value)}; it must hold numbers")
        if count is not None and len(values) != count:
            self.refuse(f"{where}.{key}", f"holds {len(values)} numbers; it must hold {count}")
        return [float(min(max(value, -1e300), 1e300)) for value in values]

    def all(self, key: str) -> list[dict[str, Any]]:
        """The list of objects `key` at the root; empty if it is missing."""
        found: list[dict[str, Any]] = self.entry(self.root, key, list, "", [])
        return found

    def one(self, key: str, index: Any, where: str) -> dict[str, Any]:
        """Object number `index` of the list `key`; `where` names the entry that holds the index."""
        entries = self.all(key)
        whole = isinstance(index, int) and not isinstance(index, bool)
        if not whole or not 0 <= index < len(entries):
            self.refuse(where, f"is {_short(index)}; the file has {len(entries)} {key}")
        found = entries[index]
        if not isinstance(found, dict):
            self.refuse(f"{key}[{index}]", f"is {_short(found)}; it must be an object")
        return found

    def array(self, index: Any, where: str, types: tuple[str, ...]) -> NDArray[np.float64]:
        """(n, k) float64 values of an accessor of one of `types`, normalized if it says so."""
        values, accessor, name = self._accessor(index, where, types)
        component = accessor["componentType"]
        if self.entry(accessor, "normalized", bool, name, False) and component in LARGEST:
            return np.maximum(values / LARGEST[component], -1.0)
        return values.astype(np.float64)

    def indices(self, index: Any, where: str) -> NDArray[np.int64]:
        """(n,) int64 values of an accessor of indices."""
        values, accessor, name = self._accessor(index, where, ("SCALAR",))
        if accessor["componentType"] not in (5121, 5123, 5125):
            self.refuse(
                f"{name}.componentType",
                f"is {accessor['componentType']}; indices must be 5121, 5123 or 5125",
            )
        return values.astype(np.int64).ravel()

    def _accessor(
        self, index: Any, where: str, types: tuple[str, ...]
    ) -> tuple[NDArray[Any], dict[str, Any], str]:
        """The stored numbers, (n, k), with their accessor and its name."""
        accessor = self.one("accessors", index, where)
        name = f"accessors[{index}]"
        if accessor.get("type") not in types:
            self.refuse(
                f"{name}.type",
                f"is {_short(accessor.get('type'))}; as {where} it must be {' or '.join(types)}",
            )
        if index not in self._arrays:
            self._arrays[index] = self._read(accessor, name)
        return self._arrays[index], accessor, name

    def _read(self, accessor: dict[str, Any], name: str) -> NDArray[Any]:
        count = self.entry(accessor, "count", int, name, 0)
        width = TYPES[accessor["type"]]
        kind = self._component(accessor, name)
        view = accessor.get("bufferView")
        if view is None:
            if count * width > MOST_ZEROS:
                self.refuse(
                    f"{name}.count",
                    f"is {count}, without a buffer view; it must be at most {MOST_ZEROS // width}",
                )
            values = np.zeros((count, width), kind)
        else:
            offset = self.entry(accessor, "byteOffset", int, name, 0)
            values = self._viewed(view, offset, count, width, kind, name)
        sparse = self.entry(accessor, "sparse", dict, name)
        return values if sparse is None else self._sparse(values, sparse, f"{name}.sparse")

    def _component(self, holder: dict[str, Any], name: str) -> np.dtype[Any]:
        component = holder.get("componentType")
        if not isinstance(component, int) or component not in COMPONENTS:
            numbers = ", ".join(map(str, COMPONENTS))
            self.refuse(
                f"{name}.componentType", f"is {_short(component)}; it must be one of {numbers}"
            )
        return np.dtype(COMPONENTS[component])

    def _sparse(self, values: NDArray[Any], sparse: dict[str, Any], name: str) -> NDArray[Any]:
        """The values with those of the sparse accessor replaced."""
        count = self.entry(sparse, "count", int, name, 0)
        places = self.entry(sparse, "indices", dict, name, {})
        where = f"{name}.indices"
        at = self._viewed(
            places.get("bufferView"), self.entry(places, "byteOffset", int, where, 0), count, 1,
            self._component(places, where), where,
        ).ravel()  # fmt: skip
        new = self.entry(sparse, "values", dict, name, {})
        where = f"{name}.values"
        replaced = self._viewed(
            new.get("bufferView"), self.entry(new, "byteOffset", int, where, 0), count,
            values.shape[1], values.dtype, where,
        )  # fmt: skip
        if count and not (0 <= int(at.min()) and int(at.max()) < len(values)):
            self.refuse(
                f"{name}.indices", f"holds {int(at.max())}; the accessor has {len(values)} values"
            )
        values = values.copy()
        values[at] = replaced
        return values

    def _viewed(
        self, view: Any, offset: int, count: int, width: int, kind: np.dtype[Any], name: str
    ) -> NDArray[Any]:
        """(count, width) numbers from a buffer view, without a copy if they are tightly packed."""
        one = self.one("bufferViews", view, f"{name}.bufferView")
        where = f"bufferViews[{view}]"
        data = self._buffer(one, where)
        begin = self.entry(one, "byteOffset", int, where, 0)
        length = self.entry(one, "byteLength", int, where, 0)
        size = width * kind.itemsize
        stride = self.entry(one, "byteStride", int, where, 0) or size
        need = offset + (count - 1) * stride + size if count else 0
        if begin + length > len(data):
            self.refuse(
                where,
                f"ends at byte {begin + length}; its buffer has {len(data)}",
            )
        if need > length:
            self.refuse(name, f"takes {need} bytes for {count} values; {where} has {length}")
        if not count:
            return np.zeros((0, width), kind)
        return np.ndarray((count, width), kind, data, begin + offset, (stride, kind.itemsize))

    def _buffer(self, view: dict[str, Any], where: str) -> bytes:
        number: Any = view.get("buffer")
        buffer = self.one("buffers", number, f"{where}.buffer")
        if number in self._buffers:
            return self._buffers[number]
        name = f"buffers[{number}]"
        uri = self.entry(buffer, "uri", str, name)
        if uri is None:
            extensions = self.entry(view, "extensions", dict, where, {})
            for extension in _COMPRESSED:
                if extension in extensions:
                    self.refuse(
                        "", f"needs {extension}, which is not supported; save the file without it"
                    )
            if number != 0 or self._binary is None:
                self.refuse(name, "has no bytes in the file and names no other file")
            data = self._binary
        elif uri.startswith("data:"):
            data = self._inline(uri, name)
        else:
            data = self._beside(uri, name)
        length = self.entry(buffer, "byteLength", int, name, len(data))
        if length > len(data):
            self.refuse(f"{name}.byteLength", f"is {length}; the buffer has {len(data)} bytes")
        self._buffers[number] = data
        return data

    def _inline(self, uri: str, name: str) -> bytes:
        head, comma, body = uri.partition(",")
        if not comma or not head.endswith(";base64"):
            self.refuse(f"{name}.uri", f"is '{one_line(head, 40)}'; data must be in base64")
        try:
            return base64.b64decode(body, validate=True)
        except (binascii.Error, ValueError):
            self.refuse(f"{name}.uri", "is not valid base64")

    def _beside(self, uri: str, name: str) -> bytes:
        relative = unquote(uri)
        if "://" in uri or uri.startswith(("/", "file:")) or "\\" in relative:
            self.refuse(
                f"{name}.uri", f"is '{one_line(uri, 80)}'; it must be a relative path of a file"
            )
        file = readable_file(self._path.parent / relative, f"is missing; {self._path} needs it")
        try:
            return file.read_bytes()
        except OSError as error:
            raise FabricError(str(file), f"cannot be read: {error.strerror}") from error


def _no_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number in JSON")


def _short(value: Any) -> str:
    if value is None:
        return "missing"
    if isinstance(value, str):
        return f"'{one_line(value, 40)}'"
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 1 << 64:
        return "beyond 64 bits"
    return one_line(json.dumps(value), 40)
