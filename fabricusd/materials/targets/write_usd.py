"""Write shading networks as UsdShade prims."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd, UsdShade, Vt

from fabricusd.materials.networks.graph import Graph, Link, Parameter, Source, Texture, Value
from fabricusd.materials.targets.paths import asset_path

MTLX_VERSION = "1.39"
"""Of MaterialX's node definitions that the networks name."""

_LINEAR, _RAW = "lin_rec709_scene", "raw"
"""USD's names of colour spaces; MaterialX's for the first is without the ending."""

_TYPES = {
    "float": Sdf.ValueTypeNames.Float,
    "color3": Sdf.ValueTypeNames.Color3f,
    "vector2": Sdf.ValueTypeNames.Float2,
    "vector3": Sdf.ValueTypeNames.Float3,
    "float4": Sdf.ValueTypeNames.Float4,
    "vector4": Sdf.ValueTypeNames.Float4,
    "floats": Sdf.ValueTypeNames.FloatArray,
    "boolean": Sdf.ValueTypeNames.Bool,
    "integer": Sdf.ValueTypeNames.Int,
    "string": Sdf.ValueTypeNames.String,
    "token": Sdf.ValueTypeNames.Token,
    "surfaceshader": Sdf.ValueTypeNames.Token,
    "BSDF": Sdf.ValueTypeNames.Token,
}
_PREVIEW_TYPES = {
    "result": Sdf.ValueTypeNames.Float2,
    "rgb": Sdf.ValueTypeNames.Float3,
    "r": Sdf.ValueTypeNames.Float,
    "surface": Sdf.ValueTypeNames.Token,
}
_PREVIEW_INPUTS = {
    "diffuseColor": Sdf.ValueTypeNames.Color3f,
    "normal": Sdf.ValueTypeNames.Normal3f,
}


def write_material(
    stage: Usd.Stage,
    path: Sdf.Path,
    graphs: list[tuple[str, Graph]],
    parameters: Mapping[str, Value | Texture],
    layer_folder: Path,
) -> UsdShade.Material:
    """Write a Material with an output for each graph.

    graphs : (prefix of the shaders' names, graph)
    layer_folder : folder of the layer, which texture paths are relative to
    """
    material = UsdShade.Material.Define(stage, path)
    if any(graph.context == "mtlx" for _, graph in graphs):
        # By name: USD without MaterialX does not know the schema.
        material.GetPrim().AddAppliedSchema("MaterialXConfigAPI")
        material.GetPrim().CreateAttribute(
            "config:mtlx:version", Sdf.ValueTypeNames.String, custom=False
        ).Set(MTLX_VERSION)
    for name, value in parameters.items():
        kind = _TYPES[value.kind] if isinstance(value, Value) else Sdf.ValueTypeNames.Asset
        _set(material.CreateInput(name, kind), value, layer_folder)
    for prefix, graph in graphs:
        _write_graph(stage, material, prefix, graph, layer_folder)
    return material


def _write_graph(
    stage: Usd.Stage, material: UsdShade.Material, prefix: str, graph: Graph, folder: Path
) -> None:
    shaders = {}
    for node in graph.nodes:
        shader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild(prefix + node.name))
        shader.CreateIdAttr(node.identifier)
        shaders[node.name] = shader
    for node in graph.nodes:
        for name, source in node.inputs.items():
            kind = _input_type(graph, node.kind, name, source, material)
            given = shaders[node.name].CreateInput(name, kind)
            if isinstance(source, Link):
                target = shaders[source.node]
                out = target.CreateOutput(source.output, _output_type(graph, source))
                given.ConnectToSource(out)
            elif isinstance(source, Parameter):
                given.ConnectToSource(material.GetInput(source.name))
            else:
                _set(given, source, folder, graph.context)
    surface = shaders[graph.terminal].CreateOutput(graph.output, Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput(graph.context).ConnectToSource(surface)


def _input_type(
    graph: Graph, kind: str, name: str, source: Source, material: UsdShade.Material
) -> Any:
    if isinstance(source, Texture):
        return Sdf.ValueTypeNames.Asset
    if not graph.context and name in _PREVIEW_INPUTS:
        return _PREVIEW_INPUTS[name]
    if isinstance(source, Value):
        return _TYPES[source.kind]
    if isinstance(source, Parameter):
        return material.GetInput(source.name).GetTypeName()
    return _output_type(graph, source)


def _output_type(graph: Graph, link: Link) -> Any:
    node = graph.node(link.node)
    return _TYPES[node.kind] if node.kind else _PREVIEW_TYPES[link.output]


def _set(
    given: UsdShade.Input, source: Value | Texture, folder: Path | None = None, context: str = ""
) -> None:
    if isinstance(source, Texture):
        assert folder is not None
        given.Set(Sdf.AssetPath(asset_path(source.path, folder)))
        linear = _LINEAR.removesuffix("_scene") if context == "mtlx" else _LINEAR
        given.GetAttr().SetColorSpace(linear if source.color else _RAW)
    elif source.kind == "floats":
        # USD would take a tuple of two to four numbers for a vector.
        assert isinstance(source.value, tuple)
        given.Set(Vt.FloatArray(source.value))
    else:
        given.Set(source.value)
