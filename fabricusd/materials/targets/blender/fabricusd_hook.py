"""Blender add-on that restores, on USD import, the parts of baked fabrics that Blender drops.

Blender's importer reads only UsdPreviewSurface, which has no anisotropy, tangent or sheen. The
OpenPBR network beside it has them, and this hook rebuilds the Principled BSDF from that network.
Install it under Edit > Preferences > Add-ons > Install from Disk, or run the file as a script. It
requires Blender 4.4 or later.
"""

from __future__ import annotations

from typing import Any

import bpy

bl_info = {
    "name": "fabricusd looks",
    "author": "fabricusd authors",
    "version": (1, 0, 0),
    "blender": (4, 4, 0),
    "category": "Import-Export",
    "description": "Restores anisotropy, tangents, sheen and light through on USD import",
}

SURFACE = "ND_open_pbr_surface_surfaceshader"

NARROWEST = 0.1
"""Smallest ratio of alphas in the Principled BSDF: aspect^2 = 1 - 0.9 anisotropic."""


class Network:
    """The network of a fabric material in USD: the material's constants, and textures by map."""

    def __init__(self, material: Any) -> None:
        from pxr import UsdShade

        self.material = UsdShade.Material(material)
        self.shaders = {
            p.GetName(): UsdShade.Shader(p)
            for p in material.GetChildren()
            if p.IsA(UsdShade.Shader)
        }

    @property
    def is_fabric(self) -> bool:
        """Whether `fabricusd material` wrote the material."""
        surface = self.shaders.get("surface")
        return bool(
            surface
            and surface.GetIdAttr().Get() == SURFACE
            and self.material.GetInput("rough_scale")
        )

    def constant(self, name: str) -> Any:
        """Return a parameter of the look as fitted to the Principled BSDF, or else to OpenPBR."""
        own = self.material.GetInput(f"principled:{name}")
        return (own or self.material.GetInput(name)).Get()

    def file(self, name: str) -> str | None:
        """Return a map's texture, with `<UDIM>` for tiles; None if a constant replaces it."""
        shader = self.shaders.get(name)
        if shader is None:
            return None
        asset = shader.GetInput("file").Get()
        if asset is None:
            return None
        if "<UDIM>" in asset.path:
            layer = shader.GetInput("file").GetAttr().GetPropertyStack()[0].layer
            return str(layer.ComputeAbsolutePath(asset.path))
        return str(asset.resolvedPath or asset.path)

    def fixed(self, shader: str, name: str) -> Any:
        """Return the constant on a shader's input; None if the input is connected or absent."""
        found = self.shaders.get(shader)
        given = found.GetInput(name) if found else None
        return given.Get() if given and not given.HasConnectedSource() else None


class Nodes:
    """Builds a material's nodes."""

    def __init__(self, tree: Any) -> None:
        self.tree = tree
        self.uv = tree.nodes.new("ShaderNodeUVMap")
        self.uv.uv_map = "st"

    def set(self, socket: Any, value: Any) -> None:
        """Connect an input to a socket, or set it to a constant."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation: str, *values: Any) -> Any:
        """Add a Math node; return its output."""
        node = self.tree.nodes.new("ShaderNodeMath")
        node.operation = operation
        for socket, value in zip(node.inputs, values, strict=False):
            self.set(socket, value)
        return node.outputs[0]

    def image(self, path: str, *, data: bool) -> Any:
        """Add an image node, loading each image once; return its colour."""
        node = self.tree.nodes.new("ShaderNodeTexImage")
        known = (i for i in bpy.data.images if bpy.path.abspath(i.filepath) == path)
        node.image = next(known, None) or bpy.data.images.load(path.replace("<UDIM>", "1001"))
        if "<UDIM>" in path:
            node.image.source = "TILED"
        node.image.colorspace_settings.name = "Non-Color" if data else "Linear Rec.709"
        node.extension = "EXTEND"
        self.tree.links.new(self.uv.outputs[0], node.inputs["Vector"])
        return node.outputs["Color"]

    def number(self, path: str | None, instead: float) -> Any:
        """Return the first channel of an image, or `instead` if there is no image."""
        if path is None:
            return instead
        node = self.tree.nodes.new("ShaderNodeSeparateColor")
        self.tree.links.new(self.image(path, data=True), node.inputs[0])
        return node.outputs[0]

    def vector(self, operation: str, *values: Any) -> Any:
        """Add a Vector Math node; return its output."""
        node = self.tree.nodes.new("ShaderNodeVectorMath")
        node.operation = operation
        for socket, value in zip(node.inputs, values, strict=False):
            self.set(socket, value)
        return node.outputs[0]

    def world(self, code: Any) -> Any:
        """Convert an encoded tangent-space direction to world space."""
        node = self.tree.nodes.new("ShaderNodeNormalMap")
        node.uv_map = "st"
        self.set(node.inputs["Color"], code)
        return node.outputs[0]


def rebuild(material: Any, network: Network) -> None:
    """Replace the nodes of `material` by a Principled BSDF that matches the OpenPBR network."""
    tree = material.node_tree
    tree.nodes.clear()
    nodes = Nodes(tree)
    surface = tree.nodes.new("ShaderNodeBsdfPrincipled")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(surface.outputs[0], output.inputs["Surface"])

    def give(name: str, value: Any) -> None:
        nodes.set(surface.inputs[name], value)

    scale = network.constant("base_color_scale")
    file = network.file("base_color")
    if file is not None:
        color = nodes.vector("MULTIPLY", nodes.image(file, data=False), tuple(scale))
        give("Base Color", nodes.vector("MINIMUM", color, (1.0, 1.0, 1.0)))
    else:
        base = network.fixed("base_scaled", "in1") or (0.5, 0.5, 0.5)
        give("Base Color", (*(min(b * s, 1.0) for b, s in zip(base, scale, strict=True)), 1.0))
    _reflection(nodes, network, give)
    give("Sheen Weight", network.constant("fuzz_weight"))
    give("Sheen Roughness", network.constant("fuzz_roughness"))
    give("Sheen Tint", (*network.constant("fuzz_color"), 1.0))
    if network.shaders["surface"].GetInput("geometry_opacity"):
        fixed = network.fixed("surface", "geometry_opacity")
        give("Alpha", nodes.number(network.file("opacity"), 1.0 if fixed is None else fixed))
    normal = network.file("normal")
    if normal is not None:
        give("Normal", nodes.world(nodes.image(normal, data=True)))
    if network.material.GetInput("transmission_scale"):
        _light_through(nodes, network, surface, output)
    _arrange(tree)


def _light_through(nodes: Nodes, network: Network, surface: Any, output: Any) -> None:
    """Add a Translucent BSDF: the Principled BSDF has no light through a thin sheet."""
    tree = nodes.tree
    scale = tuple(network.constant("transmission_scale"))
    file = network.file("transmission_color")
    if file is not None:
        color = nodes.vector("MULTIPLY", nodes.image(file, data=False), scale)
        color = nodes.vector("MINIMUM", color, (1.0, 1.0, 1.0))
    else:
        fixed = network.fixed("through_scaled", "in1") or (0.0, 0.0, 0.0)
        color = tuple(min(c * s, 1.0) for c, s in zip(fixed, scale, strict=True))
    # The sheet is not there in a gap, and the Principled BSDF's own alpha does not dim it.
    alpha = surface.inputs["Alpha"]
    cover = nodes.tree.nodes.new("ShaderNodeCombineXYZ")
    for socket in cover.inputs:
        nodes.set(socket, alpha.links[0].from_socket if alpha.is_linked else alpha.default_value)
    translucent = tree.nodes.new("ShaderNodeBsdfTranslucent")
    nodes.set(translucent.inputs["Color"], nodes.vector("MULTIPLY", color, cover.outputs[0]))
    both = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(surface.outputs[0], both.inputs[0])
    tree.links.new(translucent.outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], output.inputs["Surface"])


def _reflection(nodes: Nodes, network: Network, give: Any) -> None:
    """Set roughness, anisotropy, index, tint and tangent.

    The alphas are r^2/aspect along the tangent and r^2 aspect across it.
    """
    alphas = []
    for name, file in (("smooth", "roughness_along"), ("rough", "roughness_across")):
        fixed = network.fixed(f"{name}_root", "in1")
        root = nodes.number(network.file(file), 0.5 if fixed is None else fixed)
        scaled = nodes.math("MULTIPLY", root, network.constant(f"{name}_scale"))
        alphas.append(nodes.math("MINIMUM", nodes.math("MULTIPLY", scaled, scaled), 1.0))
    smooth, rough = alphas[0], nodes.math("MAXIMUM", alphas[1], alphas[0])
    ratio = nodes.math("MAXIMUM", nodes.math("DIVIDE", smooth, rough), NARROWEST)
    less = nodes.math("SUBTRACT", 1.0, ratio)
    give("Roughness", nodes.math("POWER", nodes.math("MULTIPLY", smooth, rough), 0.25))
    give("Anisotropic", nodes.math("DIVIDE", less, 1.0 - NARROWEST))
    give("IOR", network.constant("specular_ior"))
    tint, tints = tuple(network.constant("specular_tint")), network.file("specular_tint_map")
    if tints is not None:
        give("Specular Tint", nodes.vector("MULTIPLY", nodes.image(tints, data=False), tint))
    else:
        own = network.fixed("tint_scaled", "in1") or (1.0, 1.0, 1.0)
        give("Specular Tint", (*(a * b for a, b in zip(tint, own, strict=True)), 1.0))
    # The rougher axis is the map's direction rotated by a quarter turn, (-y, x), encoded for a
    # normal map node.
    fixed = network.fixed("tangent_x", "in")
    directions = network.file("tangent")
    if directions is not None:
        part = nodes.tree.nodes.new("ShaderNodeSeparateXYZ")
        nodes.set(part.inputs[0], nodes.image(directions, data=True))
        x, y = part.outputs[0], part.outputs[1]
    else:
        x, y = (fixed[0], fixed[1]) if fixed else (1.0, 0.0)
    join = nodes.tree.nodes.new("ShaderNodeCombineXYZ")
    nodes.set(join.inputs[0], nodes.math("MULTIPLY_ADD", y, -0.5, 0.5))
    nodes.set(join.inputs[1], nodes.math("MULTIPLY_ADD", x, 0.5, 0.5))
    nodes.set(join.inputs[2], 0.5)
    give("Tangent", nodes.world(join.outputs[0]))


def _arrange(tree: Any) -> None:
    for number, node in enumerate(tree.nodes):
        node.location = (-260 * (number // 8), -220 * (number % 8))


def rebuild_all(stage: Any, prim_map: Any = None) -> int:
    """Rebuild every fabric material of `stage` that Blender imported; return their number."""
    done = 0
    for prim in stage.Traverse():
        if prim.GetTypeName() != "Material":
            continue
        network = Network(prim)
        if not network.is_fabric:
            continue
        known = (prim_map or {}).get(str(prim.GetPath()), ())
        found = [m for m in known if isinstance(m, bpy.types.Material)]
        found = found or [m for m in (bpy.data.materials.get(prim.GetName()),) if m]
        for material in found:
            rebuild(material, network)
            done += 1
    return done


class FabricLooks(bpy.types.USDHook):  # type: ignore[misc]
    """Rebuilds fabric materials after an import."""

    bl_idname = "fabricusd_looks"
    bl_label = "fabricusd looks"
    bl_description = "Restores anisotropy, tangents, sheen and light through baked fabrics"

    @staticmethod
    def on_import(import_context: Any) -> bool:
        """Rebuild materials; Blender calls this after importing a USD file."""
        try:
            # Blender ships USD's Python modules, the bpy wheel does not. Without them get_stage
            # would abort; with those of another USD build it would return an unknown type.
            import pxr.UsdShade  # noqa: F401

            stage = import_context.get_stage()
            names: Any = getattr(import_context, "get_prim_map", dict)()
        except (ImportError, TypeError):
            print("fabricusd looks: Blender's USD modules are missing; call rebuild_all(stage)")
            return False
        return rebuild_all(stage, names) >= 0


def register() -> None:
    """Register the hook."""
    bpy.utils.register_class(FabricLooks)


def unregister() -> None:
    """Unregister the hook."""
    bpy.utils.unregister_class(FabricLooks)


if __name__ == "__main__":
    register()
