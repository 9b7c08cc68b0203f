"""Give Blender's materials the groups of a stage's looks."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import bpy

from .distance import WIDTH, thread_width
from .images import Images
from .lobes import lays, lobes
from .looks import Look
from .nodes import Nodes
from .principled import NUMBERS, TITLES, principled
from .threads import Threads

LOBES, PRINCIPLED, BEST = SURFACES = ("LOBES", "PRINCIPLED", "BEST")
"""Which surface a material gets; the best is the lobes where a look has them."""

COLORS = ("base_color", "specular_tint_map", "transmission_color")
"""Maps that hold colours; the others hold data."""

LONG = 59
"""Length of names that Blender may have shortened."""


@dataclass
class Made:
    """What was built: materials by the name of their group, and what was left out."""

    groups: dict[str, list[Any]] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)


def build(
    looks: Sequence[Look], materials: Mapping[str, Sequence[Any]], surface: str = BEST
) -> Made:
    """Replace the nodes of the materials of `looks`.

    materials : Blender's materials by the path of the prim, see `materials_by_path`
    surface : one of SURFACES; a look that has not the one gets the other
    """
    made, images = Made(), Images()
    # So that objects which were just imported are where they belong.
    bpy.context.view_layer.update()
    shared: dict[Any, Any] = {}
    replaced: set[Any] = set()
    others = []
    for look in looks:
        mine = materials.get(look.path, ())
        if mine and not look.is_known:
            others.append(look.name)
            continue
        for material in mine:
            if material.node_tree is None:
                material.use_nodes = True
            group = _group(look, surface, shared, made, images)
            replaced |= _images_of(material)
            _wire(material, look, group, images)
            made.groups.setdefault(group.name, []).append(material)
    bpy.data.batch_remove([image for image in replaced if not image.users])
    if images.missing:
        made.left_out.append(f"textures that cannot be read ({', '.join(images.missing)})")
    if others:
        made.left_out.append(
            f"the fit of {', '.join(others)}, which needs a look with --surface openpbr or lobes"
        )
    return made


def materials_by_path(
    looks: Sequence[Look], prim_map: Mapping[str, Iterable[Any]], new: Iterable[Any]
) -> dict[str, list[Any]]:
    """Find Blender's materials of looks by path.

    prim_map : what Blender says it made of each prim; may be empty
    new : the materials that the import made, which are found by the prim's name if it is not said
    """
    found = {}
    for look in looks:
        mine = [m for m in prim_map.get(look.path, ()) if isinstance(m, bpy.types.Material)]
        found[look.path] = mine or [m for m in new if _is_called(m.name, look.name)]
    return found


def _is_called(name: str, prim: str) -> bool:
    """Whether Blender gave the name to a material `prim`: shortened, or with a number."""
    base = re.sub(r"\.\d{3}$", "", name)
    return base == prim or (len(base) >= LONG and prim.startswith(base))


def _images_of(material: Any) -> set[Any]:
    """Return the images that Blender's own import gave a material."""
    found = {getattr(node, "image", None) for node in material.node_tree.nodes}
    return found - {None}


def _group(look: Look, surface: str, shared: dict[Any, Any], made: Made, images: Images) -> Any:
    """Return the tree of a look's surface: one for all materials of the same fabric."""
    mixture = look.mixture if surface != PRINCIPLED or not look.values else None
    name = look.fabric or look.name
    if mixture is not None:
        key: Any = (mixture, look.transparent, look.threads)
        if key not in shared:
            near = _near(look, images)
            shared[key] = lobes(mixture, name, transparent=look.transparent, near=near)
            if look.lit_through and not (near and near[0].through):
                made.left_out.append(f"light through {name}, which lobes have not")
    else:
        textures = tuple(sorted(look.maps))
        key = (name, textures, tuple(sorted(look.values.items())), str(look.constants))
        if key not in shared:
            shared[key] = principled(look, name)
    return shared[key]


def _near(look: Look, images: Images) -> tuple[Threads, dict[str, Any]] | None:
    """Return the threads of a look and their images; None if one of these cannot be read."""
    if look.threads is None:
        return None
    found = {
        name: images(path, data=True, four="tint" not in name) for name, path in look.threads.files
    }
    return None if None in found.values() else (look.threads, found)


def _wire(material: Any, look: Look, tree: Any, images: Images) -> None:
    """Replace a material's nodes by a group, its textures and the output."""
    nodes = Nodes(material.node_tree)
    nodes.tree.nodes.clear()
    group = nodes.add("ShaderNodeGroup")
    group.node_tree, group.width = tree, 240
    output = nodes.add("ShaderNodeOutputMaterial", Surface=group.outputs[0])
    if "Weft" in group.inputs:
        for name, value in lays(look).items():
            if name in group.inputs:
                nodes.set(group.inputs[name], value)
        if look.threads and WIDTH in group.inputs:
            group.inputs[WIDTH].default_value = thread_width(material, look.threads.density)
    # Cycles would bend tilted normals back towards the viewer, and dim what they face; fits know
    # nothing of that.
    if hasattr(material, "cycles"):
        material.cycles.use_bump_map_correction = False
    for name, title in TITLES.items():
        if name in look.maps and title in group.inputs:
            image = images(look.maps[name], data=name not in COLORS)
            if image is not None:
                color = nodes.image(image)
                if name in NUMBERS:
                    color = nodes.add("ShaderNodeSeparateColor", Color=color).outputs[0]
                nodes.set(group.inputs[title], color)
    nodes.arrange()
    group.location, output.location = (300, 0), (640, 0)
