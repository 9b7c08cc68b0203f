"""How many threads a pixel spans: where lobes near by become the cloth from afar.

Cycles tells a shader nothing of the width of a ray. The distance to the camera is known, the angle
of a pixel follows from the active camera by drivers, and the width of a thread from the mesh.
"""

from __future__ import annotations

import math
import re
from typing import Any

import bpy
import numpy as np

from .nodes import UV, Group

BLUR, WHOLE = 0.8, 3.2
"""Threads that a pixel spans where the cloth from afar begins to show, and where it shows alone."""

STEEP = 0.05
"""Least cosine of a view: the more a cloth is turned away, the more of it a pixel spans."""

WIDTH = "Thread Width"
"""Input of a group: metres of a thread, 0 to leave `Afar` alone."""

PIXEL, FORM = "fabricusd pixel", "fabricusd_pixel"
"""Name of the group that says the width of a pixel, and the property that marks it."""

CAMERA = {
    "l": ("camera.data.lens", 50.0), "u": ("camera.data.sensor_width", 36.0),
    "v": ("camera.data.sensor_height", 24.0), "f": ("camera.data.sensor_fit", 0.0),
    "t": ("camera.data.type", 0.0), "o": ("camera.data.ortho_scale", 6.0),
    "x": ("render.resolution_x", 1920.0), "y": ("render.resolution_y", 1080.0),
    "p": ("render.resolution_percentage", 100.0),
}  # fmt: skip
"""Variables of the drivers: properties of the active scene, and what stands for them while it has
no camera, without which a driver would be switched off for good."""

PIXELS = "((x if f==1 else y if f==2 else max(x,y))*p/100)"
"""Pixels along the side that the sensor fits: 0 is AUTO, 1 the width, 2 the height."""

PER_METRE = f"(0 if t==1 else 6.2832/x/p*100 if t==2 else (v if f==2 else u)/l/{PIXELS})"
"""Width of a pixel at a distance of 1. t is 0 for perspective, 1 orthographic, 2 panoramic."""

ALONE = f"(o/{PIXELS} if t==1 else 0)"
"""Width of a pixel at any distance."""


def afar(group: Group) -> Any:
    """Return how much of the cloth from afar shows: the input `Afar`, or more by the distance."""
    least = group.input("Afar", 0.0, low=0.0, high=1.0)
    width = group.input(WIDTH, 0.0, low=0.0, length=True)
    node = group.add("ShaderNodeGroup")
    node.node_tree = _pixel()
    span = group.math("DIVIDE", node.outputs[0], group.math("MAXIMUM", width, 1e-9))
    octaves = group.math("LOGARITHM", group.math("MAXIMUM", span, 1e-6), WHOLE / BLUR)
    start = math.log(BLUR) / math.log(WHOLE / BLUR)
    share = group.math(
        "MINIMUM", group.math("MAXIMUM", group.math("SUBTRACT", octaves, start), 0.0), 1.0
    )
    share = group.math("MULTIPLY", share, group.math("GREATER_THAN", width, 0.0))
    return group.math("MAXIMUM", least, share)


def thread_width(material: Any, density: float) -> float:
    """Return metres of a thread on the meshes of a material, 0 if they have no area.

    density : threads along u or v, for a UV of 1: the geometric mean of both sets
    """
    areas = np.zeros(2)
    for one in bpy.data.objects:
        if one.type == "MESH" and any(slot.material == material for slot in one.material_slots):
            areas += _areas(one, material)
    in_world, in_uv = areas
    threads = density * math.sqrt(in_uv)
    return float(math.sqrt(in_world) / threads) if threads > 0.0 else 0.0


def _areas(one: Any, material: Any) -> Any:
    """(2,) area of the triangles of a material on an object, in the world and in UVs."""
    mesh = one.data
    mesh.calc_loop_triangles()
    layer = mesh.uv_layers.get(UV)
    if layer is None:
        return np.zeros(2)
    count = len(mesh.loop_triangles)
    corner, vertex = np.empty((count, 3), np.int32), np.empty((count, 3), np.int32)
    slot = np.empty(count, np.int32)
    mesh.loop_triangles.foreach_get("loops", corner.ravel())
    mesh.loop_triangles.foreach_get("vertices", vertex.ravel())
    mesh.loop_triangles.foreach_get("material_index", slot)
    places = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", places.ravel())
    uv = np.empty((len(mesh.loops), 2), np.float32)
    layer.data.foreach_get("uv", uv.ravel())
    places = places @ np.array(one.matrix_world)[:3, :3].T
    mine = [k for k, held in enumerate(one.material_slots) if held.material == material]
    chosen = np.isin(slot, mine)
    sides = np.diff(places[vertex[chosen]], axis=1)
    flat = np.diff(uv[corner[chosen]].astype(np.float64), axis=1)
    turned = flat[:, 0, 0] * flat[:, 1, 1] - flat[:, 0, 1] * flat[:, 1, 0]
    world = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return 0.5 * np.array([world.sum(), np.abs(turned).sum()])


def _pixel() -> Any:
    """Return the tree that says how wide a pixel is on the surface [m], which all fabrics share."""
    found = next((one for one in bpy.data.node_groups if one.get(FORM) == 1), None)
    if found is not None:
        return found
    group = Group(PIXEL)
    group.tree[FORM] = 1
    distance = group.add("ShaderNodeCameraData").outputs["View Distance"]
    per_metre, alone = _driven(group, PER_METRE), _driven(group, ALONE)
    geometry = group.add("ShaderNodeNewGeometry")
    turned = group.vector("DOT_PRODUCT", geometry.outputs["Normal"], geometry.outputs["Incoming"])
    steep = group.math("SQRT", group.math("MAXIMUM", turned, STEEP))
    wide = group.math("MULTIPLY_ADD", distance, per_metre, alone)
    return group.end_number("Width", group.math("DIVIDE", wide, steep))


def _driven(group: Group, expression: str) -> Any:
    """Return a number of the active scene's camera; the expression needs no Python to run."""
    node = group.add("ShaderNodeValue")
    node.outputs[0].default_value = 0.0
    driver = node.outputs[0].driver_add("default_value").driver
    words = set(re.findall("[a-z]+", expression))
    for letter, (path, instead) in CAMERA.items():
        if letter in words:
            variable = driver.variables.new()
            variable.name, variable.type = letter, "CONTEXT_PROP"
            target = variable.targets[0]
            target.context_property, target.data_path = "ACTIVE_SCENE", path
            target.use_fallback_value, target.fallback_value = True, instead
    driver.expression = expression
    return node.outputs[0]
