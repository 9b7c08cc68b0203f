"""Write shading networks as a MaterialX 1.39 document."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from fabricusd.files import whole_file
from fabricusd.materials.networks.graph import (
    Definition,
    Graph,
    Link,
    Node,
    Parameter,
    Source,
    Texture,
    Value,
)
from fabricusd.materials.targets.paths import asset_path


def write_mtlx(
    path: Path, materials: Sequence[tuple[str, Graph, dict[str, Value]]], *, clobber: bool = True
) -> None:
    """Write a document with a `surfacematerial` for each (name, graph, parameters).

    A material's parameters are inputs of its node graph; its surface node is outside the graph.
    The definitions of ours that the graphs use come first, each with a node graph.
    """
    root = ElementTree.Element("materialx", version="1.39", colorspace="lin_rec709")
    defined = {one.identifier: one for _, graph, _ in materials for one in graph.definitions}
    for one in defined.values():
        _define(root, one, path.parent)
    for name, graph, parameters in materials:
        _add(root, name, graph, parameters, path.parent)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, "unicode", xml_declaration=False)
    with whole_file(path, clobber=clobber) as temporary:
        temporary.write_text(f'<?xml version="1.0"?>\n{text}\n', "utf-8")


def _define(root: ElementTree.Element, one: Definition, folder: Path) -> None:
    definition = ElementTree.SubElement(
        root, "nodedef", name=one.identifier, node=one.category, nodegroup="pbr"
    )
    for name, value in one.inputs.items():
        _input(definition, name, value, folder, {})
    ElementTree.SubElement(definition, "output", name="out", type=one.kind)
    inside = ElementTree.SubElement(
        root, "nodegraph", name=one.identifier.replace("ND_", "NG_"), nodedef=one.identifier
    )
    kinds = {node.name: node.kind for node in one.nodes}
    for node in one.nodes:
        _node(inside, node, folder, kinds, one.inputs)
    ElementTree.SubElement(inside, "output", name="out", type=one.kind, nodename=one.terminal)


def _node(
    inside: ElementTree.Element, node: Node, folder: Path, kinds: dict[str, str],
    parameters: Mapping[str, Value],
) -> None:  # fmt: skip
    element = ElementTree.SubElement(inside, node.category, name=node.name, type=node.kind)
    # State the node definition if the types of the inputs do not determine it.
    if node.identifier.endswith("FA"):
        element.set("nodedef", node.identifier)
    for key, source in node.inputs.items():
        _input(element, key, source, folder, kinds, parameters)


def _add(
    root: ElementTree.Element, name: str, graph: Graph, parameters: dict[str, Value], folder: Path
) -> None:
    inside = ElementTree.SubElement(root, "nodegraph", name=f"{name}_maps")
    used = _used(graph)
    for key, value in parameters.items():
        if key in used:
            _input(inside, key, value, folder, {})
    kinds = {node.name: node.kind for node in graph.nodes}
    surface = graph.node(graph.terminal)
    for node in graph.nodes:
        if node is not surface:
            _node(inside, node, folder, kinds, parameters)
    outside = ElementTree.SubElement(
        root, surface.category, name=f"{name}_surface", type="surfaceshader"
    )
    for key, source in surface.inputs.items():
        if isinstance(source, Link):
            output = f"{source.node}_out"
            if not any(o.get("name") == output for o in inside.findall("output")):
                ElementTree.SubElement(
                    inside, "output", name=output, type=kinds[source.node], nodename=source.node
                )
            ElementTree.SubElement(
                outside, "input", name=key, type=kinds[source.node],
                nodegraph=f"{name}_maps", output=output,
            )  # fmt: skip
        elif isinstance(source, Parameter):
            _input(outside, key, parameters[source.name], folder, kinds)
        else:
            _input(outside, key, source, folder, kinds)
    material = ElementTree.SubElement(root, "surfacematerial", name=name, type="material")
    ElementTree.SubElement(
        material, "input", name="surfaceshader", type="surfaceshader", nodename=f"{name}_surface"
    )


def _used(graph: Graph) -> set[str]:
    """Return the parameters that nodes other than the surface use."""
    return {
        source.name
        for node in graph.nodes
        if node.name != graph.terminal
        for source in node.inputs.values()
        if isinstance(source, Parameter)
    }


def _input(
    element: ElementTree.Element, name: str, source: Source, folder: Path, kinds: dict[str, str],
    parameters: Mapping[str, Value] | None = None,
) -> None:  # fmt: skip
    made = ElementTree.SubElement(element, "input", name=name)
    if isinstance(source, Texture):
        made.set("type", "filename")
        made.set("value", asset_path(source.path, folder))
        made.set("colorspace", "lin_rec709" if source.color else "none")
        if not source.color:
            del made.attrib["colorspace"]
    elif isinstance(source, Link):
        made.set("type", kinds[source.node])
        made.set("nodename", source.node)
    elif isinstance(source, Parameter):
        assert parameters is not None
        made.set("type", parameters[source.name].kind)
        made.set("interfacename", source.name)
    else:
        made.set("type", source.kind)
        made.set("value", _text(source))


def _text(value: Value) -> str:
    held = value.value
    if isinstance(held, bool):
        return "true" if held else "false"
    if isinstance(held, tuple):
        return ", ".join(f"{x:.9g}" for x in held)
    return f"{held:.9g}" if isinstance(held, float) else str(held)
