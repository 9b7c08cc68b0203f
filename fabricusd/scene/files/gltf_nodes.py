"""Walks the node tree of a glTF scene: where each node is placed, and what it draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import one_line
from fabricusd.scene.files.gltf_document import Document


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """A node of the scene with its transform.

    world : (4, 4) float64 - from the node's space to world space [m]
    mesh, skin : numbers of the node's mesh and skin, or None
    weights : weights of the mesh's morph targets; empty if the mesh's own weights apply
    instanced : whether the node carries EXT_mesh_gpu_instancing
    """

    number: int
    name: str
    world: NDArray[np.float64]
    mesh: int | None
    skin: int | None
    weights: tuple[float, ...]
    instanced: bool


def placed_nodes(file: Document) -> list[Placed]:
    """The nodes of the default scene, or else of the first, with parents before their children.

    Raises FabricError for a node below two parents or below itself: nodes must form a tree.
    """
    found: list[Placed] = []
    seen: set[int] = set()
    waiting = [(number, np.eye(4), "scenes.nodes") for number in reversed(_roots(file))]
    while waiting:
        number, above, where = waiting.pop()
        node = file.one("nodes", number, where)
        name = f"nodes[{number}]"
        if number in seen:
            file.refuse(name, "is named twice; nodes must form a tree, each below one parent")
        seen.add(number)
        with np.errstate(all="ignore"):
            world = above @ _matrix(file, node, name)
        found.append(_placed(file, node, number, name, world))
        children = file.entry(node, "children", list, name, [])
        waiting += [(child, world, f"{name}.children") for child in reversed(children)]
    return found


def _roots(file: Document) -> list[Any]:
    scenes = file.all("scenes")
    if scenes:
        number = file.entry(file.root, "scene", int, "", 0)
        scene = file.one("scenes", number, "scene")
        roots: list[Any] = file.entry(scene, "nodes", list, f"scenes[{number}]", [])
        return roots
    # Without a scene, start at all nodes that are no other node's children.
    below: set[Any] = set()
    for k, node in enumerate(file.all("nodes")):
        if isinstance(node, dict):
            children = file.entry(node, "children", list, f"nodes[{k}]", [])
            below |= {child for child in children if isinstance(child, int)}
    return [k for k in range(len(file.all("nodes"))) if k not in below]


def _placed(
    file: Document, node: dict[str, Any], number: int, name: str, world: NDArray[np.float64]
) -> Placed:
    mesh = file.entry(node, "mesh", int, name)
    names = [node.get("name")]
    if mesh is not None:
        names.append(file.one("meshes", mesh, f"{name}.mesh").get("name"))
    words = [one_line(own, 200) for own in names if isinstance(own, str) and own.strip()]
    return Placed(
        number=number,
        name=words[0] if words else f"node_{number}",
        world=world,
        mesh=mesh,
        skin=file.entry(node, "skin", int, name),
        weights=tuple(file.numbers(node, "weights", None, name) or ()),
        instanced="EXT_mesh_gpu_instancing" in file.entry(node, "extensions", dict, name, {}),
    )


def _matrix(file: Document, node: dict[str, Any], name: str) -> NDArray[np.float64]:
    """(4, 4) a node's own transform."""
    given = file.numbers(node, "matrix", 16, name)
    if given is not None:
        # The file stores the matrix column by column.
        return np.array(given).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = file.numbers(node, "rotation", 4, name) or (0.0, 0.0, 0.0, 1.0)
    length = float(np.sqrt(x * x + y * y + z * z + w * w))
    if length > 0:
        x, y, z, w = (part / length for part in (x, y, z, w))
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    matrix[:3, :3] *= np.array(file.numbers(node, "scale", 3, name) or (1.0, 1.0, 1.0))
    matrix[:3, 3] = file.numbers(node, "translation", 3, name) or (0.0, 0.0, 0.0)
    return matrix


def joint_matrices(
    file: Document, skin: int, worlds: dict[int, NDArray[np.float64]]
) -> NDArray[np.float64]:
    """(joints, 4, 4) for each joint of a skin, the transform from the bind pose to the world."""
    name = f"skins[{skin}]"
    one = file.one("skins", skin, "skin")
    joints = file.entry(one, "joints", list, name, [])
    if not joints:
        file.refuse(f"{name}.joints", "is empty; it must name nodes")
    matrices = np.stack([_world(file, joint, name, worlds) for joint in joints])
    if "inverseBindMatrices" in one:
        inverse = file.array(one["inverseBindMatrices"], f"{name}.inverseBindMatrices", ("MAT4",))
        if len(inverse) < len(joints):
            file.refuse(
                f"{name}.inverseBindMatrices",
                f"holds {len(inverse)}; there are {len(joints)} joints",
            )
        matrices = matrices @ inverse[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
    return np.asarray(matrices)


def _world(
    file: Document, joint: Any, name: str, worlds: dict[int, NDArray[np.float64]]
) -> NDArray[np.float64]:
    file.one("nodes", joint, f"{name}.joints")
    if joint not in worlds:
        file.refuse(f"{name}.joints", f"names node {joint}, which is not in the scene")
    return worlds[joint]
