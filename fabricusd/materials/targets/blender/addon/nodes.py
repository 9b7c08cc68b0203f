"""Node trees, node by node."""

from __future__ import annotations

from typing import Any

import bpy

UV = "st"
"""The UV map of a look."""


class Nodes:
    """Adds nodes to a tree; values are constants or sockets of other nodes."""

    def __init__(self, tree: Any) -> None:
        self.tree = tree

    def add(self, kind: str, **inputs: Any) -> Any:
        """Add a node with `inputs` by their names, `_` for a space; return it."""
        node = self.tree.nodes.new(kind)
        for name, value in inputs.items():
            self.set(node.inputs[name.replace("_", " ")], value)
        return node

    def set(self, socket: Any, value: Any) -> None:
        """Connect an input to a socket, or set it to a constant."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        elif socket.type == "RGBA":
            socket.default_value = (*value[:3], 1.0)
        else:
            socket.default_value = value

    def math(self, operation: str, *values: Any) -> Any:
        """Add a Math node; return its output."""
        node = self.add("ShaderNodeMath")
        node.operation = operation
        for socket, value in zip(node.inputs, values, strict=False):
            self.set(socket, value)
        return node.outputs[0]

    def vector(self, operation: str, *values: Any) -> Any:
        """Add a Vector Math node; return its output."""
        node = self.add("ShaderNodeVectorMath")
        node.operation = operation
        for socket, value in zip(node.inputs, values, strict=False):
            self.set(socket, value)
        return node.outputs["Value" if operation == "DOT_PRODUCT" else "Vector"]

    def scaled(self, vector: Any, by: Any) -> Any:
        """Return a vector or a colour times a number."""
        node = self.add("ShaderNodeVectorMath")
        node.operation = "SCALE"
        self.set(node.inputs[0], vector)
        self.set(node.inputs["Scale"], by)
        return node.outputs["Vector"]

    def joined(self, x: Any, y: Any, z: Any) -> Any:
        """Return the vector of three numbers."""
        return self.add("ShaderNodeCombineXYZ", X=x, Y=y, Z=z).outputs[0]

    def world(self, code: Any) -> Any:
        """Convert a tangent-space direction, encoded as (d + 1)/2, to world space."""
        node = self.add("ShaderNodeNormalMap", Color=code)
        node.uv_map = UV
        return node.outputs[0]

    def sum(self, shaders: list[Any]) -> Any:
        """Return the sum of closures."""
        total = shaders[0]
        for one in shaders[1:]:
            node = self.add("ShaderNodeAddShader")
            self.tree.links.new(total, node.inputs[0])
            self.tree.links.new(one, node.inputs[1])
            total = node.outputs[0]
        return total

    def uv(self) -> Any:
        """Return the UVs of the look."""
        uv = self.tree.nodes.get("UV") or self.add("ShaderNodeUVMap")
        uv.name, uv.uv_map = "UV", UV
        return uv.outputs[0]

    def mixed(self, none: Any, whole: Any, factor: Any) -> Any:
        """Return a closure that goes from `none` to `whole`."""
        node = self.add("ShaderNodeMixShader", Fac=factor)
        self.tree.links.new(none, node.inputs[1])
        self.tree.links.new(whole, node.inputs[2])
        return node.outputs[0]

    def seen_through(self, cloth: Any, opacity: Any) -> Any:
        """Return a closure that covers the share `opacity`; the rest is gap."""
        return self.mixed(self.add("ShaderNodeBsdfTransparent").outputs[0], cloth, opacity)

    def image(self, image: Any) -> Any:
        """Add an image node; return its colour."""
        return self.tiled(image, self.uv(), repeats=False)[0]

    def tiled(self, image: Any, where: Any, *, repeats: bool) -> tuple[Any, Any]:
        """Add an image node that reads at `where`; return its colour and its fourth channel."""
        node = self.add("ShaderNodeTexImage", Vector=where)
        node.image, node.extension = image, "REPEAT" if repeats else "EXTEND"
        return node.outputs["Color"], node.outputs["Alpha"]

    def arrange(self) -> None:
        """Lay the nodes out in columns, in the order in which they were added."""
        for number, node in enumerate(self.tree.nodes):
            node.location = (-260 * (number // 8), -220 * (number % 8))


class Group(Nodes):
    """A node group with one output."""

    def __init__(self, name: str) -> None:
        super().__init__(bpy.data.node_groups.new(name, "ShaderNodeTree"))
        self.given = self.add("NodeGroupInput")

    def panel(self, name: str) -> Any:
        """Add a closed panel for inputs."""
        return self.tree.interface.new_panel(name, default_closed=True)

    def input(
        self, name: str, default: Any, *, low: float | None = None, high: float | None = None,
        panel: Any = None, color: bool = False, length: bool = False,
    ) -> Any:  # fmt: skip
        """Add an input of the group; return the socket that has its value inside.

        length : whether a number is one of metres, which Blender shows in a unit that fits it
        """
        is_number = isinstance(default, int | float)
        kind = "Color" if color else "Float" if is_number else "Vector"
        made = self.tree.interface.new_socket(
            name, in_out="INPUT", socket_type=f"NodeSocket{kind}", parent=panel
        )
        if length:
            made.subtype = "DISTANCE"
        made.default_value = default if not color else (*default, 1.0)
        if is_number:
            made.min_value = made.min_value if low is None else low
            made.max_value = made.max_value if high is None else high
        return next(one for one in self.given.outputs if one.identifier == made.identifier)

    def end(self, shader: Any) -> Any:
        """Make `shader` the group's output; return the group's tree."""
        return self._ended("Surface", "Shader", shader)

    def end_number(self, name: str, number: Any) -> Any:
        """Make a number the group's output; return the group's tree."""
        return self._ended(name, "Float", number)

    def _ended(self, name: str, kind: str, value: Any) -> Any:
        self.tree.interface.new_socket(name, in_out="OUTPUT", socket_type=f"NodeSocket{kind}")
        output = self.add("NodeGroupOutput")
        self.tree.links.new(value, output.inputs[name])
        self.arrange()
        return self.tree
