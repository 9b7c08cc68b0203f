"""Mesh files for tests: areas of what was read, glTF and PLY written number by number."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

CASES = Path(__file__).resolve().parents[2] / "cases"

_COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

SQUARE = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]], "f4")
SQUARE_UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "f4")
SQUARE_TRIANGLES = np.array([0, 1, 2, 0, 2, 3], "u2")


def area(mesh: Any) -> float:
    """Of a Mesh or Piece, in its unit."""
    a, b, c = (np.asarray(mesh.points)[np.asarray(mesh.triangles)[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def uv_area(mesh: Any) -> float:
    a, b = mesh.uv[:, 1] - mesh.uv[:, 0], mesh.uv[:, 2] - mesh.uv[:, 0]
    return float(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2)


def bounds(mesh: Any) -> list[list[float]]:
    used = np.asarray(mesh.points)[np.unique(mesh.triangles)]
    return [used.min(axis=0).round(6).tolist(), used.max(axis=0).round(6).tolist()]


class Gltf:
    """A glTF file in the making: one buffer, whose accessors are added array by array."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.root: dict[str, Any] = {
            "asset": {"version": "2.0"}, "accessors": [], "bufferViews": [], "meshes": [],
            "nodes": [], "scenes": [{"nodes": [0]}], "scene": 0,
        }  # fmt: skip

    def view(self, data: bytes, **more: Any) -> int:
        self.data += bytes(-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **more}
        self.data += data
        self.root["bufferViews"].append(view)
        return len(self.root["bufferViews"]) - 1

    def add(self, array: Any, **more: Any) -> int:
        """The number of an accessor of the array's rows."""
        array = np.asarray(array)
        rows = array.reshape(len(array), -1)
        accessor = {
            "bufferView": self.view(rows.tobytes()), "count": len(rows),
            "componentType": _COMPONENTS[array.dtype.str[1:]], "type": _TYPES[rows.shape[1]],
            **more,
        }  # fmt: skip
        self.root["accessors"].append(accessor)
        return len(self.root["accessors"]) - 1

    def square(self, **more: Any) -> dict[str, Any]:
        """A primitive of 0.1 m."""
        return {
            "attributes": {"POSITION": self.add(SQUARE), "TEXCOORD_0": self.add(SQUARE_UV)},
            "indices": self.add(SQUARE_TRIANGLES), **more,
        }  # fmt: skip

    def mesh(self, *primitives: dict[str, Any], **more: Any) -> int:
        self.root["meshes"].append({"primitives": list(primitives), **more})
        return len(self.root["meshes"]) - 1

    def node(self, **more: Any) -> int:
        self.root["nodes"].append(more)
        return len(self.root["nodes"]) - 1

    def glb(self) -> bytes:
        self.root["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.root).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + bytes(-len(self.data) % 4)
        size = 12 + 8 + len(text) + 8 + len(data)
        return b"".join(
            [struct.pack("<4sII", b"glTF", 2, size), struct.pack("<I4s", len(text), b"JSON"), text,
             struct.pack("<I4s", len(data), b"BIN\0"), data]
        )  # fmt: skip

    def gltf(self, uri: str = "") -> bytes:
        """As text, its buffer in the text or in the file `uri`."""
        inline = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        self.root["buffers"] = [{"byteLength": len(self.data), "uri": uri or inline}]
        return json.dumps(self.root).encode()


def one_square(**node: Any) -> Gltf:
    """A file of one node, 'Shirt', with a square of 0.1 m."""
    made = Gltf()
    made.node(name="Shirt", mesh=made.mesh(made.square()), **node)
    return made


def ply_header(form: str, elements: dict[str, tuple[int, list[str]]]) -> bytes:
    """elements : name -> (count, properties as the header has them)."""
    lines = ["ply", f"format {form} 1.0", "comment made by a test"]
    for name, (count, properties) in elements.items():
        lines += [f"element {name} {count}", *(f"property {p}" for p in properties)]
    return "\n".join([*lines, "end_header", ""]).encode()


def ply(form: str, vertices: Any, faces: list[list[int]], names: str = "x y z") -> bytes:
    """vertices : (n, k) float; faces : lists of corners, of any length."""
    vertices = np.asarray(vertices, np.float64)
    head = ply_header(
        form,
        {
            "vertex": (len(vertices), [f"float {name}" for name in names.split()]),
            "face": (len(faces), ["list uchar int vertex_indices"]),
        },
    )
    if form == "ascii":
        rows = [" ".join(f"{x:.9g}" for x in row) for row in vertices]
        rows += [" ".join(map(str, [len(face), *face])) for face in faces]
        return head + "\n".join(rows).encode() + b"\n"
    order = ">" if "big" in form else "<"
    body = vertices.astype(f"{order}f4").tobytes()
    for face in faces:
        body += struct.pack(f"{order}B{len(face)}i", len(face), *face)
    return head + body
