"""Build the shading network of a mixture of lobes from MaterialX's physically based nodes.

A lobe is a `generalized_schlick_bsdf` about a tilted normal. Its weight and its colour are in the
reflectance of that node and not in a `multiply` behind it, because `multiply` clamps its factor to
1, and weights exceed 1. The document defines the lobe as a node; in USD it is unrolled.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fabricusd.materials.lobes.mixture import (
    CROSSING,
    EVEN,
    FACING,
    MATERIALX,
    SMALLEST,
    UPRIGHT,
    Lobe,
    Mixture,
)
from fabricusd.materials.networks.graph import Builder, Definition, Graph, Link, Node, Source, Value
from fabricusd.materials.networks.graph import Parameter as Given
from fabricusd.materials.networks.surfaces import Inputs, Maps, one

Floats = NDArray[np.float64]

_UP = Value("vector3", (0.0, 0.0, 1.0))
_ACROSS = Value("vector3", (1.0, 0.0, 0.0))


def lobes(maps: Inputs, opaque: bool, mixture: Mixture, matrix: Floats) -> Graph:
    """Return a surface of lobes; textures provide opacity only.

    mixture : in the form of MaterialX
    matrix : (2, 2) from the texture coordinates to threads, as in `BakedLay`
    """
    assert mixture.form == MATERIALX
    b = Builder()
    eye, normal, upright = _frame(b)
    axes = _axes(b, matrix)
    parts = [_diffuse(b, mixture, normal, upright)]
    if max(mixture.sheen) > 1e-4:
        parts.append(
            b.add(
                "sheen", "sheen_bsdf", "BSDF", "ND_sheen_bsdf",
                color=_color(mixture.sheen), roughness=one(mixture.sheen_roughness),
                normal=normal, mode=Value("string", "zeltner"),
            )
        )  # fmt: skip
    for k, lobe in enumerate(mixture.lobes):
        for tilt, side in zip(lobe.tilts, ("", "_back"), strict=False):
            parts.append(_placed(b, f"lobe{k}{side}", lobe, tilt, axes[lobe.along], normal, eye))
    inputs: dict[str, Source] = {"bsdf": _sum(b, parts), "thin_walled": Value("boolean", True)}
    if not opaque:
        inputs["opacity"] = Maps(b, maps)("opacity")
    b.nodes["surface"] = Node("surface", "surface", "surfaceshader", "ND_surface", inputs)
    return Graph(tuple(b.nodes.values()), "surface", "out", "mtlx", (LOBE,))


def _frame(b: Builder) -> tuple[Link, Link, Link]:
    """Return the direction to the eye, the normal on its side, and the cosine of the two."""
    space = Value("string", "world")
    ray = b.add("ray", "viewdirection", "vector3", "ND_viewdirection_vector3", space=space)
    # MaterialX's view direction points from the eye to the surface.
    eye = b.math("eye", "multiply", "vector3", ray, one(-1.0))
    front = b.add("front", "normal", "vector3", "ND_normal_vector3", space=space)
    side = _dot(b, "side", eye, front)
    sign = b.add("sign", "sign", "float", "ND_sign_float", **{"in": side})
    normal = b.math("normal", "multiply", "vector3", front, sign, short=True)
    upright = b.add("upright", "absval", "float", "ND_absval_float", **{"in": side})
    return eye, normal, upright


def _axes(b: Builder, matrix: Floats) -> tuple[Link, Link]:
    """Return the directions of the weft and the warp in world space."""
    space = Value("string", "world")
    t = b.add("mesh_tangent", "tangent", "vector3", "ND_tangent_vector3", space=space)
    s = b.add("mesh_bitangent", "bitangent", "vector3", "ND_bitangent_vector3", space=space)
    along = np.linalg.inv(matrix)
    found = []
    for k, noun in enumerate(("weft", "warp")):
        u, v = along[:, k] / np.linalg.norm(along[:, k])
        sum_ = b.math(
            f"{noun}_sum", "add", "vector3",
            b.math(f"{noun}_u", "multiply", "vector3", t, one(float(u))),
            b.math(f"{noun}_v", "multiply", "vector3", s, one(float(v))),
        )  # fmt: skip
        unit: dict[str, Source] = {"in": sum_}
        found.append(b.add(f"{noun}_axis", "normalize", "vector3", "ND_normalize_vector3", **unit))
    return found[0], found[1]


def _diffuse(b: Builder, mixture: Mixture, normal: Link, upright: Link) -> Link:
    least = b.math("diffuse_cosine", "max", "float", upright, one(EVEN))
    power = b.math("diffuse_power", "power", "float", least, one(mixture.diffuse_power))
    color = b.math(
        "diffuse_color", "multiply", "color3", _color(mixture.diffuse), power, short=True
    )
    return b.add(
        "diffuse", "oren_nayar_diffuse_bsdf", "BSDF", "ND_oren_nayar_diffuse_bsdf",
        color=color, normal=normal,
    )  # fmt: skip


def _placed(
    b: Builder, name: str, lobe: Lobe, tilt: float, axis: Link, normal: Link, eye: Link
) -> Link:
    return b.add(
        name, LOBE.category, LOBE.kind, LOBE.identifier,
        color=_color(lobe.color), tilt=one(tilt),
        roughness=Value("vector2", (lobe.alpha_along, lobe.alpha_across)),
        facing=one(lobe.facing), crossing=one(lobe.crossing), upright=one(lobe.upright),
        axis=axis, normal=normal, eye=eye,
    )  # fmt: skip


def _sum(b: Builder, parts: Sequence[Link]) -> Link:
    total = parts[0]
    for k, part in enumerate(parts[1:]):
        total = b.add(f"sum{k}", "add", "BSDF", "ND_add_bsdf", in1=total, in2=part)
    return total


def _color(rgb: tuple[float, float, float]) -> Value:
    return Value("color3", rgb)


def _definition() -> Definition:
    """The node of one lobe, `Lobe` in `lobes.mixture`."""
    b = Builder()
    tilt, axis, normal, eye = (Given(name) for name in ("tilt", "axis", "normal", "eye"))
    s = b.add("sine", "sin", "float", "ND_sin_float", **{"in": tilt})
    c = b.add("cosine", "cos", "float", "ND_cos_float", **{"in": tilt})

    def scaled(name: str, vector: Source, by: Source) -> Link:
        return b.math(name, "multiply", "vector3", vector, by, short=True)

    n = _unit(
        b, "n", b.math("n_sum", "add", "vector3", scaled("n_a", axis, s), scaled("n_n", normal, c))
    )
    t = _unit(
        b,
        "t",
        b.math("t_sum", "subtract", "vector3", scaled("t_a", axis, c), scaled("t_n", normal, s)),
    )
    no, to, up = (_dot(b, name, eye, v) for name, v in (("no", n), ("to", t), ("up", normal)))
    flat = b.math("to_square", "multiply", "float", to, to)
    cross = b.math("to_cross", "subtract", "float", one(1.0), flat)
    factors = [
        b.math(
            f"{name}_power", "power", "float",
            b.math(f"{name}_base", "max", "float", base, one(least)), Given(name),
        )
        for name, base, least in (
            ("facing", no, FACING), ("crossing", cross, CROSSING), ("upright", up, UPRIGHT),
        )
    ]  # fmt: skip
    weight = b.math(
        "weight", "multiply", "float",
        b.math("weight_two", "multiply", "float", factors[0], factors[1]), factors[2],
    )  # fmt: skip
    # The node turns a normal that faces away towards the viewer; such a lobe is not seen.
    seen = b.add(
        "seen", "ifgreater", "float", "ND_ifgreater_float",
        value1=no, value2=one(SMALLEST), in1=weight, in2=one(0.0),
    )  # fmt: skip
    color = b.math("reflectance", "multiply", "color3", Given("color"), seen, short=True)
    end = b.add(
        "lobe", "generalized_schlick_bsdf", "BSDF", "ND_generalized_schlick_bsdf",
        color0=color, color90=color, roughness=Given("roughness"), normal=n, tangent=t,
    )  # fmt: skip
    inputs = {
        "color": _color((0.1, 0.1, 0.1)), "tilt": one(0.0),
        "roughness": Value("vector2", (0.3, 0.9)), "facing": one(0.0), "crossing": one(0.0),
        "upright": one(0.0), "axis": _ACROSS, "normal": _UP, "eye": _UP,
    }  # fmt: skip
    return Definition(
        "fabricusd_lobe", "BSDF", "ND_fabricusd_lobe", inputs, tuple(b.nodes.values()), end.node
    )


def _unit(b: Builder, name: str, vector: Link) -> Link:
    return b.add(name, "normalize", "vector3", "ND_normalize_vector3", **{"in": vector})


def _dot(b: Builder, name: str, one_: Source, two: Source) -> Link:
    return b.add(name, "dotproduct", "float", "ND_dotproduct_vector3", in1=one_, in2=two)


LOBE = _definition()
"""The definition of a lobe's node."""
