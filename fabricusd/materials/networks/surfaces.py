"""Build the shading network of each surface model from textures and a look.

To add a model, write a function that returns its `Graph` and list it in GRAPHS.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fabricusd.materials.networks.graph import (
    Builder,
    Graph,
    Link,
    Node,
    Parameter,
    Source,
    Texture,
    Value,
)
from fabricusd.materials.networks.look import Look

Inputs = Mapping[str, Texture | Value]
"""A texture or a constant for each map of MAPS. `normal` is encoded as (n + 1)/2, as readers of
normal maps expect; the other maps hold the values of the bake."""

MAPS = {
    "base_color": "color3",
    "roughness_along": "float",
    "roughness_across": "float",
    "opacity": "float",
    "normal": "vector3",
    "tangent": "vector3",
    "specular_tint": "color3",
    "transmission_color": "color3",
}
"""Maps that a surface reads, and their types."""

NO_TINT = Value("color3", (1.0, 1.0, 1.0))
"""Replaces the map `specular_tint`, which exists only if threads are fitted."""

NO_TRANSMISSION = Value("color3", (0.0, 0.0, 0.0))
"""Replaces the map `transmission_color`, which exists only where light comes through the cloth."""

LIT_THROUGH = ("openpbr", "standard_surface")
"""The surfaces that can carry light through a thin sheet. glTF's has clear transmission only, and
UsdPreviewSurface none."""

PARAMETERS = {
    "base_color_scale": "color3",
    "specular_ior": "float",
    "specular_tint": "color3",
    "smooth_scale": "float",
    "rough_scale": "float",
    "fuzz_weight": "float",
    "fuzz_color": "color3",
    "fuzz_roughness": "float",
    "transmission_scale": "color3",
}
"""Fields of `Look` that are inputs of the material, and their types; None is left out."""


def parameter_values(look: Look, prefix: str = "") -> dict[str, Value]:
    """Return the inputs of the material itself."""
    return {
        prefix + name: Value(kind, getattr(look, name))
        for name, kind in PARAMETERS.items()
        if getattr(look, name) is not None
    }


def one(value: float) -> Value:
    """Return a number as a source."""
    return Value("float", value)


class Maps:
    """Adds the image nodes of a MaterialX network on demand."""

    def __init__(self, builder: Builder, maps: Inputs) -> None:
        self.builder, self.maps = builder, maps

    def __call__(self, name: str) -> Source:
        """Return an image node's output, or the constant that replaces the map."""
        source, kind = self.maps[name], MAPS[name]
        if isinstance(source, Value):
            return source
        st = self.builder.add("st", "texcoord", "vector2", "ND_texcoord_vector2")
        # Nodes and inputs of a graph share one name space.
        node = f"{name}_map" if name in PARAMETERS else name
        return self.builder.add(
            node, "image", kind, f"ND_image_{kind}",
            file=source, texcoord=st,
        )  # fmt: skip


def _alphas(b: Builder, read: Maps) -> tuple[Link, Link]:
    """Return the microfacet alphas along the smoother and the rougher axis, at most 1."""
    found = []
    for name, texture in (("smooth", "roughness_along"), ("rough", "roughness_across")):
        scaled = b.math(
            f"{name}_root", "multiply", "float", read(texture), Parameter(f"{name}_scale")
        )
        square = b.math(f"{name}_square", "multiply", "float", scaled, scaled)
        found.append(b.math(f"{name}_alpha", "min", "float", square, one(1.0)))
    return found[0], b.math("wide_alpha", "max", "float", found[1], found[0])


def _anisotropy(b: Builder, smooth: Link, rough: Link) -> Link:
    """Return 1 - smooth/rough."""
    safe = b.math("rough_floor", "max", "float", rough, one(1e-6))
    ratio = b.math("alpha_ratio", "divide", "float", smooth, safe)
    return b.math("anisotropy", "subtract", "float", one(1.0), ratio)


def _frame(b: Builder, read: Maps) -> dict[str, Source]:
    """Return the normal and the tangent in world space.

    The tangent is the rougher axis, so it is the direction in the map `tangent` rotated by a
    quarter turn.
    """
    space = Value("string", "world")
    normal = b.add(
        "world_normal", "normalmap", "vector3", "ND_normalmap_float", **{"in": read("normal")}
    )
    t = b.add("mesh_tangent", "tangent", "vector3", "ND_tangent_vector3", space=space)
    s = b.add("mesh_bitangent", "bitangent", "vector3", "ND_bitangent_vector3", space=space)
    parts = []
    for axis in (0, 1):
        inputs: dict[str, Source] = {"in": read("tangent"), "index": Value("integer", axis)}
        name = f"tangent_{'xy'[axis]}"
        parts.append(b.add(name, "extract", "float", "ND_extract_vector3", **inputs))
    minus = b.math("tangent_minus_y", "multiply", "float", parts[1], one(-1.0))
    first = b.math("tangent_u", "multiply", "vector3", t, minus, short=True)
    second = b.math("tangent_v", "multiply", "vector3", s, parts[0], short=True)
    turned = b.math("tangent_sum", "add", "vector3", first, second)
    tangent = b.add(
        "world_tangent", "normalize", "vector3", "ND_normalize_vector3", **{"in": turned}
    )
    return {"normal": normal, "tangent": tangent}


def _base(b: Builder, read: Maps) -> Link:
    scaled = b.math(
        "base_scaled", "multiply", "color3", read("base_color"), Parameter("base_color_scale")
    )
    return _clamped(b, "base", scaled)


def _clamped(b: Builder, name: str, value: Source) -> Link:
    inputs: dict[str, Source] = {"in": value, "low": one(0.0), "high": one(1.0)}
    return b.add(name, "clamp", "color3", "ND_clamp_color3FA", **inputs)


def transmits(maps: Inputs) -> bool:
    """Whether scattered light comes through the surface of these maps."""
    return maps.get("transmission_color", NO_TRANSMISSION) != NO_TRANSMISSION


def _through(b: Builder, read: Maps, base: Link) -> tuple[Link, Link, Link]:
    """Return the weight and the colour of light through a thin sheet, and the base's colour.

    Both surfaces mix the base with a diffuse sheet: `(1 - w) base + w color`. With `w` the largest
    channel of the transmittance, the largest channel of the colour is 1. MaterialX up to 1.39.5
    squares the colour of OpenPBR's sheet, which then changes its saturation alone.
    """
    scaled = b.math(
        "through_scaled", "multiply", "color3", read("transmission_color"),
        Parameter("transmission_scale"),
    )  # fmt: skip
    through = _clamped(b, "through", scaled)
    channels = []
    for k, name in enumerate("rgb"):
        inputs: dict[str, Source] = {"in": through, "index": Value("integer", k)}
        channels.append(b.add(f"through_{name}", "extract", "float", "ND_extract_color3", **inputs))
    most = b.math("through_rg", "max", "float", channels[0], channels[1])
    weight = b.math("through_weight", "max", "float", most, channels[2])
    some = b.math("through_floor", "max", "float", weight, one(1e-6))
    color = b.math("through_color", "divide", "color3", through, some, short=True)
    rest = b.math("through_rest", "subtract", "float", one(1.0), weight)
    least = b.math("rest_floor", "max", "float", rest, one(1e-6))
    undimmed = b.math("base_undimmed", "divide", "color3", base, least, short=True)
    return weight, color, _clamped(b, "base_beside_through", undimmed)


def _tint(b: Builder, read: Maps) -> Source:
    if read.maps.get("specular_tint", NO_TINT) == NO_TINT:
        return Parameter("specular_tint")
    return b.math(
        "tint_scaled", "multiply", "color3", read("specular_tint"), Parameter("specular_tint")
    )


def _fourth_root(b: Builder, value: Link) -> Link:
    return b.math("roughness", "power", "float", value, one(0.25))


def _finished(b: Builder, node: Node) -> Graph:
    b.nodes[node.name] = node
    return Graph(tuple(b.nodes.values()), node.name, "out", "mtlx")


def openpbr(maps: Inputs, opaque: bool) -> Graph:
    """OpenPBR 1.1: a thin-walled base, anisotropic reflection with a tangent map, fuzz, opacity."""
    b = Builder()
    read = Maps(b, maps)
    smooth, rough = _alphas(b, read)
    squares = b.math(
        "alpha_squares", "add", "float",
        b.math("smooth_alpha_square", "multiply", "float", smooth, smooth),
        b.math("rough_alpha_square", "multiply", "float", rough, rough),
    )  # fmt: skip
    mean = b.math("alpha_mean_square", "multiply", "float", squares, one(0.5))
    frame = _frame(b, read)
    inputs: dict[str, Source] = {
        "base_color": _base(b, read),
        "specular_color": _tint(b, read),
        "specular_ior": Parameter("specular_ior"),
        "specular_roughness": _fourth_root(b, mean),
        "specular_roughness_anisotropy": _anisotropy(b, smooth, rough),
        "fuzz_weight": Parameter("fuzz_weight"),
        "fuzz_color": Parameter("fuzz_color"),
        "fuzz_roughness": Parameter("fuzz_roughness"),
        "geometry_thin_walled": Value("boolean", True),
        "geometry_normal": frame["normal"],
        "geometry_tangent": frame["tangent"],
    }
    if transmits(maps):
        weight, color, base = _through(b, read, _base(b, read))
        inputs |= {
            "base_color": base,
            "subsurface_weight": weight,
            "subsurface_color": color,
            "subsurface_scatter_anisotropy": one(1.0),
        }
    if not opaque:
        inputs["geometry_opacity"] = read("opacity")
    return _finished(
        b,
        Node(
            "surface", "open_pbr_surface", "surfaceshader", "ND_open_pbr_surface_surfaceshader",
            inputs,
        ),
    )  # fmt: skip


def standard_surface(maps: Inputs, opaque: bool) -> Graph:
    """Autodesk Standard Surface with the same layers."""
    b = Builder()
    read = Maps(b, maps)
    smooth, rough = _alphas(b, read)
    product = b.math("alpha_product", "multiply", "float", smooth, rough)
    frame = _frame(b, read)
    inputs: dict[str, Source] = {
        "base": one(1.0),
        "base_color": _base(b, read),
        "specular": one(1.0),
        "specular_color": _tint(b, read),
        "specular_IOR": Parameter("specular_ior"),
        "specular_roughness": _fourth_root(b, product),
        "specular_anisotropy": _anisotropy(b, smooth, rough),
        "sheen": Parameter("fuzz_weight"),
        "sheen_color": Parameter("fuzz_color"),
        "sheen_roughness": Parameter("fuzz_roughness"),
        "thin_walled": Value("boolean", True),
        **frame,
    }
    if transmits(maps):
        weight, color, base = _through(b, read, _base(b, read))
        inputs |= {"base_color": base, "subsurface": weight, "subsurface_color": color}
    if not opaque:
        inputs["opacity"] = b.add(
            "opacity_color", "convert", "color3", "ND_convert_float_color3",
            **{"in": read("opacity")},
        )  # fmt: skip
    return _finished(
        b,
        Node(
            "surface", "standard_surface", "surfaceshader", "ND_standard_surface_surfaceshader",
            inputs,
        ),
    )  # fmt: skip


def gltf_pbr(maps: Inputs, opaque: bool) -> Graph:
    """glTF PBR with KHR_materials_anisotropy and KHR_materials_sheen.

    The alpha along the tangent is `mix(roughness^2, 1, strength^2)`.
    """
    b = Builder()
    read = Maps(b, maps)
    smooth, rough = _alphas(b, read)
    room = b.math(
        "alpha_room", "max", "float",
        b.math("alpha_free", "subtract", "float", one(1.0), smooth), one(1e-6),
    )  # fmt: skip
    gain = b.math("alpha_gain", "subtract", "float", rough, smooth)
    square = b.math("strength_square", "divide", "float", gain, room)
    frame = _frame(b, read)
    sheen = b.math(
        "sheen_color", "multiply", "color3", Parameter("fuzz_color"), Parameter("fuzz_weight"),
        short=True,
    )  # fmt: skip
    inputs: dict[str, Source] = {
        "base_color": _base(b, read),
        "metallic": one(0.0),
        "roughness": b.math("roughness", "power", "float", smooth, one(0.5)),
        "anisotropy_strength": b.math("strength", "power", "float", square, one(0.5)),
        "specular_color": _tint(b, read),
        "ior": Parameter("specular_ior"),
        "sheen_color": sheen,
        "sheen_roughness": Parameter("fuzz_roughness"),
        **frame,
    }
    if not opaque:
        inputs["alpha"] = read("opacity")
        inputs["alpha_mode"] = Value("integer", 2)
    return _finished(
        b, Node("surface", "gltf_pbr", "surfaceshader", "ND_gltf_pbr_surfaceshader", inputs)
    )


GRAPHS: dict[str, Callable[[Inputs, bool], Graph]] = {
    "openpbr": openpbr,
    "standard_surface": standard_surface,
    "gltf_pbr": gltf_pbr,
}
"""MaterialX surfaces in which a look can be written."""


def preview(maps: Inputs, look: Look, opaque: bool) -> Graph:
    """UsdPreviewSurface; the texture readers' scales are the only place for the look's factors."""
    b = Builder()
    st = b.add(
        "Preview_st", "", "", "UsdPrimvarReader_float2", varname=Value("string", "st"),
        fallback=Value("vector2", (0.0, 0.0)),
    )  # fmt: skip

    def read(name: str, output: str, scale: tuple[float, ...], bias: float = 0.0) -> Source:
        source = maps[name]
        if isinstance(source, Value):
            return _scaled(source, scale, bias)
        made = b.add(
            f"Preview_{name}", "", "", "UsdUVTexture", file=source, st=st,
            wrapS=Value("token", "clamp"), wrapT=Value("token", "clamp"),
            sourceColorSpace=Value("token", "raw"), scale=Value("float4", scale),
            bias=Value("float4", (bias, bias, bias, 0.0)),
        )  # fmt: skip
        return Link(made.node, output)

    inputs: dict[str, Source] = {
        "useSpecularWorkflow": Value("integer", 0),
        "diffuseColor": read("base_color", "rgb", (*look.base_color_scale, 1.0)),
        "metallic": one(0.0),
        "roughness": read("roughness_along", "r", (look.smooth_scale,) * 4),
        "ior": one(look.specular_ior),
        "normal": read("normal", "rgb", (2.0, 2.0, 2.0, 1.0), -1.0),
    }
    if not opaque:
        inputs["opacity"] = read("opacity", "r", (1.0, 1.0, 1.0, 1.0))
        # In a gap there is nothing that could reflect; by default the reflection stays whole.
        inputs["opacityMode"] = Value("token", "presence")
    b.nodes["Preview"] = Node("Preview", "", "", "UsdPreviewSurface", inputs)
    return Graph(tuple(b.nodes.values()), "Preview", "surface", "")


def _scaled(value: Value, scale: tuple[float, ...], bias: float) -> Value:
    """Apply a texture reader's scale and bias to a constant."""
    held = value.value
    if isinstance(held, tuple):
        return Value(value.kind, tuple(x * k + bias for x, k in zip(held, scale, strict=False)))
    assert isinstance(held, float)
    return Value(value.kind, held * scale[0])
