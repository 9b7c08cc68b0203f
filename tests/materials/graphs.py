"""What a shading network gives at a point of a mesh, with constants for its textures."""

from __future__ import annotations

import numpy as np

from fabricusd.materials.networks.graph import Link, Parameter, Value

MATH = {
    "multiply": np.multiply, "add": np.add, "subtract": np.subtract, "divide": np.divide,
    "min": np.minimum, "max": np.maximum, "power": np.power,
}  # fmt: skip


def value_of(graph, source, world, look):
    """The value of a source.

    world : the mesh's own `tangent`, `bitangent` and `normal`, in world space
    look : values of the material's parameters
    """
    if isinstance(source, Value):
        return source.value
    if isinstance(source, Parameter):
        return getattr(look, source.name)
    assert isinstance(source, Link)
    node = graph.node(source.node)
    given = {k: value_of(graph, s, world, look) for k, s in node.inputs.items()}
    if node.category in MATH:
        return MATH[node.category](np.asarray(given["in1"]), np.asarray(given["in2"]))
    if node.category == "clamp":
        return np.clip(given["in"], given["low"], given["high"])
    if node.category == "extract":
        return given["in"][given["index"]]
    if node.category == "normalize":
        return given["in"] / np.linalg.norm(given["in"])
    if node.category == "convert":
        return (given["in"],) * 3
    if node.category == "normalmap":
        # As MaterialX's mx_normalmap: T x + B y + N z.
        x, y, z = 2.0 * np.asarray(given["in"]) - 1.0
        found = world["tangent"] * x + world["bitangent"] * y + world["normal"] * z
        return found / np.linalg.norm(found)
    return world[node.category]


def alphas(kind, given):
    """(along the tangent, across it) as the model's specification computes them."""
    if kind == "openpbr":
        r, a = given["specular_roughness"], given["specular_roughness_anisotropy"]
        along = r * r * np.sqrt(2.0 / (1.0 + (1.0 - a) ** 2))
        return along, (1.0 - a) * along
    if kind == "standard_surface":
        aspect = np.sqrt(1.0 - given["specular_anisotropy"])
        square = given["specular_roughness"] ** 2
        return square / aspect, square * aspect
    across = given["roughness"] ** 2
    s = given["anisotropy_strength"] ** 2
    return across * (1.0 - s) + s, across
