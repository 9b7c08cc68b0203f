"""A shading network, before it is written as USD prims or as a MaterialX document.

One description, so that the prims and the document cannot differ. `write_usd` and `mtlx` write it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Value:
    """A constant. kind : a MaterialX type, "float", "color3", "vector3", "boolean", ..."""

    kind: str
    value: float | int | bool | str | tuple[float, ...]


@dataclass(frozen=True)
class Link:
    """Another node's output."""

    node: str
    output: str = "out"


@dataclass(frozen=True)
class Parameter:
    """An input of the material itself, which a user may turn."""

    name: str


@dataclass(frozen=True)
class Texture:
    """A file, `<UDIM>` standing for the tile. color : linear Rec. 709 colour, not data."""

    path: Path
    color: bool = False


Source = Value | Link | Parameter | Texture


@dataclass(frozen=True)
class Node:
    """One node.

    category, kind : as MaterialX spells them, `<multiply type="color3">`
    identifier : of the node definition, the `info:id` of a USD prim
    """

    name: str
    category: str
    kind: str
    identifier: str
    inputs: dict[str, Source] = field(default_factory=dict)


@dataclass(frozen=True)
class Graph:
    """Nodes that end in a surface.

    terminal : name of the surface node; output : its output
    context : of the material's output in USD, "" for the universal one
    """

    nodes: tuple[Node, ...]
    terminal: str
    output: str
    context: str

    def node(self, name: str) -> Node:
        """The node of that name."""
        return next(n for n in self.nodes if n.name == name)


class Builder:
    """Collects nodes; each method adds one and returns a link to it."""

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}

    def add(self, name: str, category: str, kind: str, identifier: str, **inputs: Source) -> Link:
        """A node, added once for each name."""
        output = {"UsdPrimvarReader_float2": "result", "UsdUVTexture": "rgb"}.get(identifier, "out")
        self.nodes.setdefault(name, Node(name, category, kind, identifier, inputs))
        return Link(name, output)

    def math(
        self, name: str, category: str, kind: str, one: Source, two: Source, *, short: bool = False
    ) -> Link:
        """A node of two inputs; a float second input of a longer type is the `FA` definition."""
        short = short or (isinstance(two, Value) and two.kind == "float" and kind != "float")
        suffix = f"{kind}FA" if short else kind
        return self.add(name, category, kind, f"ND_{category}_{suffix}", in1=one, in2=two)
