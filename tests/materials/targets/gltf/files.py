"""A binary glTF file taken apart without the library that wrote it."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

KINDS = {5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class GlbFile:
    """The JSON of a file and its buffer; every read stays within its buffer view."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.said: dict[str, Any] = json.loads(data[20 : 20 + size])
        begin = 20 + size
        size, kind = struct.unpack_from("<I4s", data, begin)
        assert kind == b"BIN\0"
        self.buffer = data[begin + 8 :]
        assert len(self.buffer) == size == self.said["buffers"][0]["byteLength"]

    def view(self, number: int) -> bytes:
        one = self.said["bufferViews"][number]
        begin = one["byteOffset"]
        assert begin % 4 == 0
        assert begin + one["byteLength"] <= len(self.buffer)
        return self.buffer[begin : begin + one["byteLength"]]

    def accessor(self, number: int) -> NDArray[Any]:
        one = self.said["accessors"][number]
        flat = np.frombuffer(self.view(one["bufferView"]), KINDS[one["componentType"]])
        assert len(flat) == one["count"] * WIDTHS[one["type"]]
        return flat.reshape(one["count"], -1)

    def primitives(self) -> list[tuple[dict[str, NDArray[Any]], NDArray[Any], dict[str, Any]]]:
        """(attributes, (m, 3) triangles, what the file says) of each primitive."""
        return [
            (
                {name: self.accessor(k) for name, k in one["attributes"].items()},
                self.accessor(one["indices"]).reshape(-1, 3),
                one,
            )
            for mesh in self.said["meshes"]
            for one in mesh["primitives"]
        ]

    def material(self, name: str) -> dict[str, Any]:
        return next(one for one in self.said["materials"] if one["name"] == name)
