"""The fitted Principled BSDF of a look: anisotropy, tangent, tint, sheen and light through."""

from __future__ import annotations

from typing import Any

from .looks import Look
from .nodes import Group

NARROWEST = 0.1
"""Smallest ratio of alphas in the Principled BSDF: aspect^2 = 1 - 0.9 anisotropic."""

FADED = 0.25
"""Cosine of the viewer and a tilted normal below which sheen fades."""

WHITE = (1.0, 1.0, 1.0)

INSTEAD = {
    "base_color": (0.5, 0.5, 0.5), "roughness_along": 0.5, "roughness_across": 0.5,
    "opacity": 1.0, "normal": (0.5, 0.5, 1.0), "tangent": (1.0, 0.0, 0.0),
    "specular_tint_map": WHITE, "transmission_color": (0.0, 0.0, 0.0),
}  # fmt: skip
"""Constants for maps of which a look says nothing."""

NUMBERS = ("roughness_along", "roughness_across", "opacity")
VECTORS = ("tangent",)

TITLES = {
    "base_color": "Base Color", "roughness_along": "Roughness Along",
    "roughness_across": "Roughness Across", "opacity": "Opacity", "normal": "Normal",
    "tangent": "Tangent", "specular_tint_map": "Tint", "transmission_color": "Transmission Color",
}  # fmt: skip
"""Inputs of the group by the names of maps."""


def constant(look: Look, name: str) -> Any:
    """Return what stands for a map without its texture."""
    found = look.constants.get(name, INSTEAD[name])
    return found if name != "tangent" else (found[0], found[1], 0.0)


def principled(look: Look, name: str) -> Any:
    """Build the group of a look; return its tree. Textures come in from outside."""
    group = Group(name)

    def given(map_: str) -> Any:
        is_color = map_ not in (*NUMBERS, *VECTORS)
        return group.input(TITLES[map_], constant(look, map_), color=is_color)

    def fitted(key: str, title: str, **more: Any) -> Any:
        return group.input(title, look.values[key], **more)

    surface = group.add("ShaderNodeBsdfPrincipled")

    def give(title: str, value: Any) -> None:
        group.set(surface.inputs[title], value)

    scale = fitted("base_color_scale", "Base Color Scale")
    color = group.vector("MULTIPLY", given("base_color"), scale)
    give("Base Color", group.vector("MINIMUM", color, WHITE))
    _reflection(group, given, fitted, give)
    weight = fitted("fuzz_weight", "Fuzz Weight", low=0.0, high=1.0)
    normal = group.world(given("normal")) if "normal" in look.maps else None
    if normal is not None:
        give("Normal", normal)
        # Cycles shows full sheen to a viewer below the plane of a tilted normal, which leaning pile
        # has; in a fit there is none. It fades out, since it is strongest where it would end.
        eye = group.add("ShaderNodeNewGeometry").outputs["Incoming"]
        above = group.math("DIVIDE", group.vector("DOT_PRODUCT", normal, eye), FADED)
        above = group.math("MINIMUM", group.math("MAXIMUM", above, 0.0), 1.0)
        weight = group.math("MULTIPLY", weight, above)
    give("Sheen Weight", weight)
    give("Sheen Tint", fitted("fuzz_color", "Fuzz Color", color=True))
    give("Sheen Roughness", fitted("fuzz_roughness", "Fuzz Roughness", low=0.0, high=1.0))
    opacity = given("opacity") if look.transparent else None
    if opacity is not None:
        give("Alpha", opacity)
    shaders = [surface.outputs[0]]
    if look.lit_through:
        # The Principled BSDF has no light through a thin sheet.
        scale = fitted("transmission_scale", "Transmission Scale")
        through = group.vector("MULTIPLY", given("transmission_color"), scale)
        through = group.vector("MINIMUM", through, WHITE)
        if opacity is not None:
            # The sheet is not there in a gap, and the Principled BSDF's own alpha does not dim it.
            through = group.scaled(through, opacity)
        shaders.append(group.add("ShaderNodeBsdfTranslucent", Color=through).outputs[0])
    return group.end(group.sum(shaders))


def _reflection(group: Group, given: Any, fitted: Any, give: Any) -> None:
    """Set roughness, anisotropy, index, tint and tangent.

    The alphas are r^2/aspect along the tangent and r^2 aspect across it.
    """
    alphas = []
    for map_, key, title in (
        ("roughness_along", "smooth_scale", "Smooth Scale"),
        ("roughness_across", "rough_scale", "Rough Scale"),
    ):
        root = given(map_)
        scaled = group.math("MULTIPLY", root, fitted(key, title, low=0.0))
        alphas.append(group.math("MINIMUM", group.math("MULTIPLY", scaled, scaled), 1.0))
    smooth, rough = alphas[0], group.math("MAXIMUM", alphas[1], alphas[0])
    ratio = group.math("MAXIMUM", group.math("DIVIDE", smooth, rough), NARROWEST)
    less = group.math("SUBTRACT", 1.0, ratio)
    give("Roughness", group.math("POWER", group.math("MULTIPLY", smooth, rough), 0.25))
    give("Anisotropic", group.math("DIVIDE", less, 1.0 - NARROWEST))
    give("IOR", fitted("specular_ior", "Specular IOR", low=1.0))
    tint = fitted("specular_tint", "Specular Tint Scale")
    tints = given("specular_tint_map")
    give("Specular Tint", group.vector("MULTIPLY", tints, tint))
    # The rougher axis is the map's direction rotated by a quarter turn, (-y, x), encoded for a
    # normal map node.
    part = group.add("ShaderNodeSeparateXYZ", Vector=given("tangent"))
    x, y = part.outputs[0], part.outputs[1]
    half = group.math("MULTIPLY_ADD", y, -0.5, 0.5), group.math("MULTIPLY_ADD", x, 0.5, 0.5)
    give("Tangent", group.world(group.joined(*half, 0.5)))
