"""Build the shading network of a mixture of lobes from MaterialX's physically based nodes.

A lobe is a `generalized_schlick_bsdf` about a tilted normal. Its weight and its colour are in the
reflectance of that node and not in a `multiply` behind it, because `multiply` clamps its factor to
1, and weights exceed 1. The document defines the lobe as a node; in USD it is unrolled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fabricusd.materials.lobes.mixture import (
    CROSSING,
    EVEN,
    FACING,
    MATERIALX,
    POWERS,
    SHARP,
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

LEAST_COVER = 1e-3
"""Cover of a texel of which nothing is seen."""


class Texel(Protocol):
    """What a texel shows of single threads; `near.network` makes its nodes.

    cover : share of the texel that threads cover
    """

    cover: Link

    def color(self, name: str, row: int, rgb: Sequence[float]) -> Source:
        """Return a colour of the mixture at the texel, gaps included: of a lobe by its number, of
        the diffuse part (-2), of the sheen (-1)."""

    def placed(self, name: str, number: int) -> tuple[Source, Source]:
        """Return the tilt and the widths of a lobe; of a pair, each has its own number."""

    def through(self) -> Source | None:
        """Return the share of the light from behind that comes through; None without any."""


def lobes(
    maps: Inputs, opaque: bool, mixture: Mixture, matrix: Floats,
    near: Callable[[Builder], Texel] | None = None,
) -> Graph:  # fmt: skip
    """Return a surface of lobes; without `near`, textures provide opacity only.

    mixture : in the form of MaterialX
    matrix : (2, 2) from the texture coordinates to threads, as in `BakedLay`
    near : adds the nodes of the texel under a point
    """
    assert mixture.form == MATERIALX
    b = Builder()
    texel = near(b) if near else None
    eye, normal, upright = _frame(b)
    axes = _axes(b, matrix)
    view: Source = _view(b, mixture, upright, eye, axes) if mixture.view else one(1.0)
    if texel and not opaque:
        # The opacity dims the lobes of a texel, which are those of its gaps as well.
        least = b.math("cover_floor", "max", "float", texel.cover, one(LEAST_COVER))
        view = b.math("view_covered", "divide", "float", view, least)
    parts = [_diffuse(b, mixture, normal, upright, view, texel)]
    if max(mixture.sheen) > 1e-4:
        parts.append(
            b.add(
                "sheen", "sheen_bsdf", "BSDF", "ND_sheen_bsdf",
                color=_shaded(
                    b, "sheen", _seen(texel, "sheen", -1, mixture.sheen), mixture.sheen_power,
                    (upright, UPRIGHT), view,
                ),
                roughness=one(mixture.sheen_roughness),
                normal=normal, mode=Value("string", "zeltner"),
            )
        )  # fmt: skip
    number = 0
    for k, lobe in enumerate(mixture.lobes):
        for tilt, side in zip(lobe.tilts, ("", "_back"), strict=False):
            name = f"lobe{k}{side}"
            color = _seen(texel, name, number, lobe.color)
            widths: Source = Value("vector2", (lobe.alpha_along, lobe.alpha_across))
            placed = texel.placed(name, number) if texel else (one(tilt), widths)
            parts.append(
                _placed(b, name, lobe, (color, *placed), axes[lobe.along], normal, eye, view)
            )
            number += 1
    through = texel.through() if texel else None
    if texel and through is not None:
        if not opaque:
            least = b.math("cover_floor", "max", "float", texel.cover, one(LEAST_COVER))
            through = b.math("through_covered", "divide", "color3", through, least, short=True)
        parts.append(
            b.add(
                "through_bsdf", "translucent_bsdf", "BSDF", "ND_translucent_bsdf",
                color=through, normal=normal,
            )
        )  # fmt: skip
    inputs: dict[str, Source] = {"bsdf": _sum(b, parts), "thin_walled": Value("boolean", True)}
    if not opaque:
        inputs["opacity"] = texel.cover if texel else Maps(b, maps)("opacity")
    b.nodes["surface"] = Node("surface", "surface", "surfaceshader", "ND_surface", inputs)
    return Graph(tuple(b.nodes.values()), "surface", "out", "mtlx", (LOBE,))


def _seen(texel: Texel | None, name: str, row: int, rgb: tuple[float, float, float]) -> Source:
    """Return a colour of the mixture, of the texel if there is one."""
    return texel.color(name, row, rgb) if texel else _color(rgb)


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


def _view(b: Builder, mixture: Mixture, upright: Link, eye: Link, axes: tuple[Link, Link]) -> Link:
    """Return V, `view_factor` of `lobes.mixture`."""
    most = b.math("view_cosine", "max", "float", upright, one(SHARP))
    s = b.add("view_s", "sqrt", "float", "ND_sqrt_float", **{"in": most})
    x, y = (_dot(b, f"view_{k}", eye, axis) for k, axis in zip("xy", axes, strict=True))
    d = b.math(
        "view_d", "subtract", "float",
        b.math("view_xx", "multiply", "float", x, x), b.math("view_yy", "multiply", "float", y, y),
    )  # fmt: skip
    around = (None, d, b.math("view_dd", "multiply", "float", d, d), x, y)
    total: Link | None = None
    for k in range(len(mixture.view) // POWERS):
        *low, top = mixture.view[k * POWERS : (k + 1) * POWERS]
        term: Source = one(top)
        for power, c in reversed(list(enumerate(low))):
            by_s = b.math(f"view_{k}_{power}_times", "multiply", "float", term, s)
            term = b.math(f"view_{k}_{power}", "add", "float", by_s, one(c))
        assert isinstance(term, Link)
        factor = around[k]
        if factor is not None:
            term = b.math(f"view_{k}_around", "multiply", "float", term, factor)
        total = term if total is None else b.math(f"view_{k}_sum", "add", "float", total, term)
    assert total is not None
    return b.add("view", "exp", "float", "ND_exp_float", **{"in": total})


def _shaded(
    b: Builder, name: str, rgb: Source, power: float,
    base: tuple[Link, float], view: Source,
) -> Link:  # fmt: skip
    """Return a colour times V and a power of the cosine to the viewer, its lower bound given."""
    least = b.math(f"{name}_cosine", "max", "float", base[0], one(base[1]))
    raised = b.math(f"{name}_power", "power", "float", least, one(power))
    seen = b.math(f"{name}_view", "multiply", "float", raised, view)
    return b.math(f"{name}_color", "multiply", "color3", rgb, seen, short=True)


def _diffuse(
    b: Builder, mixture: Mixture, normal: Link, upright: Link, view: Source, texel: Texel | None
) -> Link:
    color = _shaded(
        b, "diffuse", _seen(texel, "diffuse", -2, mixture.diffuse), mixture.diffuse_power,
        (upright, EVEN), view,
    )  # fmt: skip
    return b.add(
        "diffuse", "oren_nayar_diffuse_bsdf", "BSDF", "ND_oren_nayar_diffuse_bsdf",
        color=color, normal=normal,
    )  # fmt: skip


def _placed(
    b: Builder, name: str, lobe: Lobe, placed: tuple[Source, Source, Source], axis: Link,
    normal: Link, eye: Link, view: Source,
) -> Link:  # fmt: skip
    """Add a lobe of the colour, tilt and widths `placed`."""
    color, tilt, widths = placed
    return b.add(
        name, LOBE.category, LOBE.kind, LOBE.identifier,
        color=color, tilt=tilt, roughness=widths,
        facing=one(lobe.facing), crossing=one(lobe.crossing), upright=one(lobe.upright),
        rise=one(lobe.rise), rise_power=one(lobe.rise_power),
        axis=axis, normal=normal, eye=eye, view=view,
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
        b.math("weight_two", "multiply", "float", factors[0], factors[1]),
        b.math("weight_view", "multiply", "float", factors[2], Given("view")),
    )  # fmt: skip
    # The node turns a normal that faces away towards the viewer; such a lobe is not seen.
    seen = b.add(
        "seen", "ifgreater", "float", "ND_ifgreater_float",
        value1=no, value2=one(SMALLEST), in1=weight, in2=one(0.0),
    )  # fmt: skip
    color = b.math("reflectance", "multiply", "color3", Given("color"), seen, short=True)
    grazing = b.math("reflectance_90", "multiply", "color3", color, Given("rise"), short=True)
    end = b.add(
        "lobe", "generalized_schlick_bsdf", "BSDF", "ND_generalized_schlick_bsdf",
        color0=color, color90=grazing, exponent=Given("rise_power"),
        roughness=Given("roughness"), normal=n, tangent=t,
    )  # fmt: skip
    inputs = {
        "color": _color((0.1, 0.1, 0.1)), "tilt": one(0.0),
        "roughness": Value("vector2", (0.3, 0.9)), "facing": one(0.0), "crossing": one(0.0),
        "upright": one(0.0), "rise": one(1.0), "rise_power": one(5.0), "view": one(1.0),
        "axis": _ACROSS, "normal": _UP, "eye": _UP,
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
