"""Reads glTF 2.0: the default scene's triangles in world space, one piece per primitive of a node.

Textures, materials and lights are not read. Everything that changes geometry or its placement is
either read or refused by the name of its extension.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import one_line
from fabricusd.scene.files.gltf_document import Document
from fabricusd.scene.files.gltf_nodes import Placed, joint_matrices, placed_nodes
from fabricusd.scene.files.piece import QUIET, MeshFile, Piece, renumbered, unique_names

READ = ("KHR_mesh_quantization",)
"""Extensions that a file may require because they are read."""

_LOOKS = re.compile(r"[A-Z0-9]+_(texture|materials|lights|image|xmp|audio)(_|$)")
"""Pattern of the extensions that do not affect geometry, by Khronos's naming scheme."""

POINTS, TRIANGLES, STRIP, FAN = 0, 4, 5, 6

MOST_TRIANGLES = 10_000_000
"""Largest number of triangles of all nodes together: many nodes of a small file may use one mesh.
"""

_VECTOR, _PAIR = ("VEC3",), ("VEC2",)


@QUIET
def read_gltf(path: Path) -> MeshFile:
    """Read the file's pieces in metres, with +y up. Raises FabricError."""
    file = Document(path)
    _refuse_extensions(file)
    notes: list[tuple[str, str]] = []
    shapes: dict[int, list[_Shape]] = {}
    found: list[tuple[str, Placed, _Shape]] = []
    total = 0
    placed = placed_nodes(file)
    for node in placed:
        if node.mesh is None:
            continue
        if node.mesh not in shapes:
            shapes[node.mesh] = _shapes(file, node.mesh, notes)
        if node.instanced:
            notes.append((node.name, "is drawn once: EXT_mesh_gpu_instancing is not supported"))
        for shape in shapes[node.mesh]:
            if not len(shape.triangles):
                continue
            name = node.name if len(shapes[node.mesh]) == 1 else f"{node.name}_{shape.name}"
            found.append((name, node, shape))
            total += len(shape.triangles)
            if total > MOST_TRIANGLES:
                file.refuse(
                    "nodes",
                    f"draw more than {MOST_TRIANGLES} triangles together; that is the limit",
                )
    names = unique_names([name for name, _, _ in found])
    worlds = {node.number: node.world for node in placed}
    pieces = [
        _piece(file, name, node, shape, worlds)
        for name, (_, node, shape) in zip(names, found, strict=True)
    ]
    return MeshFile(pieces=pieces, notes=list(dict.fromkeys(notes)))


def _refuse_extensions(file: Document) -> None:
    for name in file.entry(file.root, "extensionsRequired", list, "", []):
        if not isinstance(name, str):
            file.refuse("extensionsRequired", "must hold names")
        if name not in READ and not _LOOKS.match(name):
            file.refuse(
                "",
                f"requires the extension {one_line(name, 60)}, which is not supported; save the "
                f"file without it",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Shape:
    """A primitive in its mesh's space, with arrays by vertex.

    triangles : (m, 3) int
    points : (n, 3); normals : (n, 3) or None; uv : (n, 2) or None - v upwards
    targets : morph targets, each (points, normals, uv) to add; each of these may be None
    weights : the mesh's weights of the targets, for nodes without weights of their own
    joints, weighed : (n, 4 k) or None - the skin's joints that move each vertex, and their weights
    """

    name: str
    triangles: NDArray[np.int64]
    points: NDArray[np.float64]
    normals: NDArray[np.float64] | None
    uv: NDArray[np.float64] | None
    targets: tuple[tuple[NDArray[np.float64] | None, ...], ...]
    weights: tuple[float, ...]
    joints: NDArray[np.int64] | None
    weighed: NDArray[np.float64] | None


def _shapes(file: Document, number: int, notes: list[tuple[str, str]]) -> list[_Shape]:
    """The primitives of a mesh that consist of triangles."""
    mesh = file.one("meshes", number, f"meshes[{number}]")
    mesh_name = _words(mesh.get("name")) or f"mesh_{number}"
    weights = tuple(file.numbers(mesh, "weights", None, f"meshes[{number}]") or ())
    found = []
    for k, primitive in enumerate(file.entry(mesh, "primitives", list, f"meshes[{number}]", [])):
        where = f"meshes[{number}].primitives[{k}]"
        if not isinstance(primitive, dict):
            file.refuse(where, "must be an object")
        mode = file.entry(primitive, "mode", int, where, TRIANGLES)
        if mode > FAN:
            file.refuse(f"{where}.mode", f"is {mode}; it must be from 0 to 6")
        if mode < TRIANGLES:
            noun = "points" if mode == POINTS else "lines"
            notes.append((mesh_name, f"has {noun}, which have no surface, left out"))
            continue
        attributes = file.entry(primitive, "attributes", dict, where, {})
        extensions = file.entry(primitive, "extensions", dict, where, {})
        if "POSITION" not in attributes:
            notes.append((mesh_name, f"has no POSITION in primitive {k}, left out"))
            continue
        _refuse_draco(file, primitive, attributes, extensions)
        found.append(_shape(file, primitive, attributes, where, mode, weights, k))
    return found


def _refuse_draco(
    file: Document, primitive: dict[str, Any], attributes: dict[str, Any], extensions: Any
) -> None:
    """Raise FabricError for a Draco-compressed primitive without uncompressed data."""
    if "KHR_draco_mesh_compression" not in extensions:
        return
    for index in (*attributes.values(), primitive.get("indices")):
        if index is not None:
            accessor = file.one("accessors", index, "attributes")
            if "bufferView" not in accessor and "sparse" not in accessor:
                file.refuse(
                    "",
                    "needs KHR_draco_mesh_compression, which is not supported; save the file "
                    "without it",
                )


def _shape(
    file: Document,
    primitive: dict[str, Any],
    attributes: dict[str, Any],
    where: str,
    mode: int,
    weights: tuple[float, ...],
    number: int,
) -> _Shape:
    def values(
        holder: dict[str, Any], key: str, types: tuple[str, ...], place: str
    ) -> NDArray[np.float64] | None:
        if key not in holder:
            return None
        array = file.array(holder[key], f"{place}.{key}", types)
        if len(array) != count:
            file.refuse(f"{place}.{key}", f"has {len(array)} values; POSITION has {count}")
        return array

    place = f"{where}.attributes"
    points = file.array(attributes["POSITION"], f"{place}.POSITION", _VECTOR)
    count = len(points)
    uv = values(attributes, "TEXCOORD_0", _PAIR, place)
    targets = []
    for k, target in enumerate(file.entry(primitive, "targets", list, where, [])):
        if not isinstance(target, dict):
            file.refuse(f"{where}.targets[{k}]", "must be an object")
        name = f"{where}.targets[{k}]"
        moved = (
            values(target, "POSITION", _VECTOR, name), values(target, "NORMAL", _VECTOR, name),
            values(target, "TEXCOORD_0", _PAIR, name),
        )  # fmt: skip
        targets.append((*moved[:2], None if moved[2] is None else moved[2] * (1.0, -1.0)))
    joints, weighed = [], []
    k = 0
    while f"JOINTS_{k}" in attributes and f"WEIGHTS_{k}" in attributes:
        joints.append(values(attributes, f"JOINTS_{k}", ("VEC4",), place))
        weighed.append(values(attributes, f"WEIGHTS_{k}", ("VEC4",), place))
        k += 1
    return _Shape(
        name=_material_name(file, primitive, where, number),
        triangles=_triangles(file, primitive, where, mode, count),
        points=points,
        normals=values(attributes, "NORMAL", _VECTOR, place),
        # v runs downwards in the file.
        uv=None if uv is None else uv * (1.0, -1.0) + (0.0, 1.0),
        targets=tuple(targets),
        weights=weights,
        joints=np.concatenate(joints, axis=1).astype(np.int64) if joints else None,  # type: ignore[arg-type]
        weighed=np.concatenate(weighed, axis=1) if weighed else None,  # type: ignore[arg-type]
    )


def _material_name(file: Document, primitive: dict[str, Any], where: str, number: int) -> str:
    """The name that tells a primitive from the others of its mesh."""
    index = primitive.get("material")
    if index is None:
        return str(number)
    material = file.one("materials", index, f"{where}.material")
    return _words(material.get("name")) or f"material_{index}"


def _words(name: Any) -> str:
    return one_line(name, 200) if isinstance(name, str) else ""


def _triangles(
    file: Document, primitive: dict[str, Any], where: str, mode: int, count: int
) -> NDArray[np.int64]:
    """(m, 3) vertices of the triangles of a list, a strip or a fan."""
    index = primitive.get("indices")
    if index is None:
        order = np.arange(count)
    else:
        order = file.indices(index, f"{where}.indices")
        if len(order) and int(order.max()) >= count:
            file.refuse(f"{where}.indices", f"name vertex {int(order.max())}; POSITION has {count}")
    if mode == TRIANGLES:
        if len(order) % 3:
            file.refuse(
                f"{where}.indices" if index is not None else where,
                f"holds {len(order)} corners; triangles take a multiple of 3",
            )
        return order.reshape(-1, 3)
    if len(order) < 3:
        return np.zeros((0, 3), np.int64)
    if mode == FAN:
        return np.stack([np.full(len(order) - 2, order[0]), order[1:-1], order[2:]], axis=1)
    found = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)
    # Every other triangle of a strip has the opposite winding.
    found[1::2] = found[1::2][:, [1, 0, 2]]
    a, b, c = found.T
    # Drop triangles that name a vertex twice: they only join strips.
    return found[(a != b) & (b != c) & (a != c)]


def _piece(
    file: Document,
    name: str,
    node: Placed,
    shape: _Shape,
    worlds: dict[int, NDArray[np.float64]],
) -> Piece:
    """A primitive as its node places it: morphed, then skinned or transformed."""
    used, triangles = renumbered(shape.triangles, len(shape.points))
    points, normals, uv = (
        None if values is None else values[used]
        for values in (shape.points, shape.normals, shape.uv)
    )
    assert points is not None
    for weight, (more, turned, slid) in zip(
        node.weights or shape.weights, shape.targets, strict=False
    ):
        if weight:
            points = points if more is None else points + weight * more[used]
            if normals is not None and turned is not None:
                normals = normals + weight * turned[used]
            if uv is not None and slid is not None:
                uv = uv + weight * slid[used]
    with np.errstate(all="ignore"):
        if node.skin is not None and shape.joints is not None and shape.weighed is not None:
            matrices = _blended(file, node.skin, shape.joints[used], shape.weighed[used], worlds)
        else:
            matrices = node.world[None]
        points = np.einsum("nij,nj->ni", matrices[:, :3, :3], points) + matrices[:, :3, 3]
        # Transform normals by the cofactor matrix, whose columns are cross products of columns. It
        # equals the inverse transpose times the determinant, and it also exists if the inverse does
        # not.
        x, y, z = (matrices[:, :3, k] for k in range(3))
        cofactor = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=2)
        mirrors = np.einsum("ni,ni->n", x, cofactor[:, :, 0]) < 0
        if normals is not None:
            normals = np.einsum("nij,nj->ni", cofactor, normals)
            normals *= np.where(mirrors, -1.0, 1.0)[:, None]
    if mirrors.mean() > 0.5:
        # A mirroring transform reverses the winding of every triangle.
        triangles = triangles[:, [0, 2, 1]]
    return Piece(
        name=name,
        points=points,
        triangles=triangles,
        uv=None if uv is None else uv[triangles],
        normals=None if normals is None else normals[triangles],
    )


def _blended(
    file: Document,
    skin: int,
    joints: NDArray[np.int64],
    weights: NDArray[np.float64],
    worlds: dict[int, NDArray[np.float64]],
) -> NDArray[np.float64]:
    """(n, 4, 4) for each vertex, the weighted mean of its joints' matrices."""
    matrices = joint_matrices(file, skin, worlds)
    if joints.size and int(joints.max()) >= len(matrices):
        file.refuse(
            "JOINTS_0", f"name joint {int(joints.max())}; skins[{skin}] has {len(matrices)}"
        )
    total = weights.sum(axis=1, keepdims=True)
    # Vertices without weights follow their first joint, as in other readers.
    first = np.zeros_like(weights)
    first[:, 0] = 1.0
    weights = np.where(total > 0, weights / np.where(total > 0, total, 1.0), first)
    blended = np.zeros((len(joints), 4, 4))
    for k in range(joints.shape[1]):
        blended += weights[:, k, None, None] * matrices[joints[:, k]]
    return blended
