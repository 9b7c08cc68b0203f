"""Represent a shading network independently of its file format.

`write_usd` writes it as USD prims and `mtlx` as a MaterialX document, so the two cannot differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path


@dataclass(frozen=True)
class Value:
    """A constant.

    kind : a MaterialX type, "float", "color3", "vector3", "boolean", ...
    """

    kind: str
    value: float | int | bool | str | tuple[float, ...]


@dataclass(frozen=True)
class Link:
    """A connection to another node's output."""

    node: str
    output: str = "out"


@dataclass(frozen=True)
class Parameter:
    """A connection to an input of the material, which users can adjust."""

    name: str


@dataclass(frozen=True)
class Texture:
    """A texture file; `<UDIM>` in its name stands for the tile's number.

    color : whether the file holds linear Rec. 709 colour rather than data
    """

    path: Path
    color: bool = False


Source = Value | Link | Parameter | Texture


@dataclass(frozen=True)
class Node:
    """A shading node.

    category, kind : the node's category and type in MaterialX, as in `<multiply type="color3">`
    identifier : name of the node definition, the `info:id` of a USD prim
    """

    name: str
    category: str
    kind: str
    identifier: str
    inputs: dict[str, Source] = field(default_factory=dict)


@dataclass(frozen=True)
class Definition:
    """A node definition of ours, with the nodes that implement it.

    inputs : with their defaults; in `nodes` each is a Parameter
    terminal : name of the node whose output is that of the definition
    """

    category: str
    kind: str
    identifier: str
    inputs: Mapping[str, Value]
    nodes: tuple[Node, ...]
    terminal: str


@dataclass(frozen=True)
class Graph:
    """A network of nodes that ends in a surface.

    terminal : name of the surface node; output : name of its output
    context : render context of the material's output in USD, "" for the universal one
    definitions : of nodes that MaterialX has not; see `unrolled`
    """

    nodes: tuple[Node, ...]
    terminal: str
    output: str
    context: str
    definitions: tuple[Definition, ...] = ()

    def node(self, name: str) -> Node:
        """Return the node of that name."""
        return next(n for n in self.nodes if n.name == name)


def unrolled(graph: Graph) -> Graph:
    """Return the graph in standard nodes alone, for readers that know no definition of ours.

    The nodes of a definition take the name of the node that they replace as a prefix.
    """
    known = {one.identifier: one for one in graph.definitions}
    nodes: list[Node] = []
    ends: dict[str, str] = {}
    for node in graph.nodes:
        definition = known.get(node.identifier)
        if definition is None:
            nodes.append(replace(node, inputs=_rewired(node.inputs, ends)))
            continue
        outside: dict[str, Source] = {**definition.inputs, **_rewired(node.inputs, ends)}
        for inner in definition.nodes:
            inputs: dict[str, Source] = {}
            for name, source in inner.inputs.items():
                if isinstance(source, Parameter):
                    inputs[name] = outside[source.name]
                elif isinstance(source, Link):
                    inputs[name] = Link(f"{node.name}_{source.node}", source.output)
                else:
                    inputs[name] = source
            nodes.append(replace(inner, name=f"{node.name}_{inner.name}", inputs=inputs))
        ends[node.name] = f"{node.name}_{definition.terminal}"
    return replace(graph, nodes=tuple(nodes), definitions=())


def _rewired(inputs: Mapping[str, Source], ends: Mapping[str, str]) -> dict[str, Source]:
    return {
        name: Link(ends.get(one.node, one.node), one.output) if isinstance(one, Link) else one
        for name, one in inputs.items()
    }


class Builder:
    """Collects nodes; each method adds one and returns a link to it."""

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}

    def add(self, name: str, category: str, kind: str, identifier: str, **inputs: Source) -> Link:
        """Add a node unless there is one of that name; return a link to it."""
        output = {"UsdPrimvarReader_float2": "result", "UsdUVTexture": "rgb"}.get(identifier, "out")
        self.nodes.setdefault(name, Node(name, category, kind, identifier, inputs))
        return Link(name, output)

    def math(
        self, name: str, category: str, kind: str, one: Source, two: Source, *, short: bool = False
    ) -> Link:
        """Add a node of two inputs.

        The `FA` node definition is used if `short` or if the second input is a float while the
        node's type is not.
        """
        short = short or (isinstance(two, Value) and two.kind == "float" and kind != "float")
        suffix = f"{kind}FA" if short else kind
        return self.add(name, category, kind, f"ND_{category}_{suffix}", in1=one, in2=two)
