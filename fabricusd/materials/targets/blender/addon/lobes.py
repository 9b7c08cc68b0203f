"""A sum of tilted anisotropic lobes, a diffuse part and sheen, as nodes: `Mixture` in `looks`.

    f cos = V(wo) (sum color W D(h) G / (4 n.wo) + diffuse max(N.wo, 1e-4)^q N.wi / pi
                   + sheen max(N.wo, .05)^u S)
    W(wo) = max(n.wo, 1e-4)^p max(1 - (t.wo)^2, .06)^r max(N.wo, .05)^s

The formulas, and the bounds below, are those of fabricusd.materials.lobes.mixture.
"""

from __future__ import annotations

from typing import Any

import bpy

from .distance import afar
from .looks import Lobe, Look, Mixture
from .near import Texel
from .nodes import Group
from .threads import Threads, turning

FACING, CROSSING, UPRIGHT, EVEN, SHARP = 1e-4, 0.06, 0.05, 1e-4, 0.01
"""Lower bounds of the bases of the powers p, r, s and u, q, and of N.wo in V."""

SMALLEST = 1e-6
"""Cosine below which a direction is below a plane."""

NARROWEST = 0.01
"""Least width of a lobe that is edited."""

AXES = ("weft", "warp")

POWERS = 7
"""Number of coefficients of each polynomial of V."""

FAINT = 1e-4
"""Largest channel of sheen that does not show."""

ONE_LOBE, FORM = "fabricusd lobe", "fabricusd_form"
"""Name of the group of one lobe, and of the property that says which of its forms it is: 1 for the
distribution of GGX, 2 for that of Beckmann."""


def lobes(
    mixture: Mixture, name: str, *, transparent: bool,
    near: tuple[Threads, dict[str, Any]] | None = None,
) -> Any:  # fmt: skip
    """Build the group of a mixture; return its tree.

    Its inputs `Weft` and `Warp` are the threads' directions in texture space, and `Opacity`, if
    `transparent`, the share of the cloth that is not gap.

    near : the single threads and their images, which say the opacity as well
    """
    group = Group(name)
    texel = Texel(group, *near) if near else None
    opacity = None
    if transparent and texel is None:
        opacity = group.input("Opacity", 1.0, low=0.0, high=1.0)
    places = {
        "weft": group.input("Weft", (1.0, 0.0, 0.0)), "warp": group.input("Warp", (0.0, 1.0, 0.0))
    }  # fmt: skip
    normal, eye = _frame(group)
    axes = {noun: _axis(group, place, normal) for noun, place in places.items()}
    up = group.vector("DOT_PRODUCT", eye, normal)
    view = _view(group, mixture.view, up, eye, axes)

    shades = {
        title: (
            group.input(title, color, color=True),
            _power(group, up, least, group.input(f"{title} Power", power)),
        )
        for title, color, power, least in (
            ("Diffuse", mixture.diffuse, mixture.diffuse_power, EVEN),
            ("Sheen", mixture.sheen, mixture.sheen_power, UPRIGHT),
        )
    }
    rough = group.input("Sheen Roughness", mixture.sheen_roughness, low=0.0, high=1.0)
    given = [
        _given(group, number, lobe, axes[lobe.along], view)
        for number, lobe in enumerate(mixture.lobes)
    ]
    ones = [_one_lobe(lobe.gaussian) for lobe in mixture.lobes]

    def summed(texel: Texel | None) -> Any:
        parts = []
        for row, title in ((-2, "Diffuse"), (-1, "Sheen")):
            color, factor = shades[title]
            if texel:
                color = group.vector("MULTIPLY", color, texel.color(texel.threads.factors[row]))
            color = group.scaled(color, group.math("MULTIPLY", factor, view))
            if title == "Diffuse":
                node = group.add("ShaderNodeBsdfDiffuse", Color=color, Roughness=0.0)
            elif max(mixture.sheen) > FAINT:
                node = group.add("ShaderNodeBsdfSheen", Color=color, Roughness=rough)
                node.distribution = "MICROFIBER"
            else:
                continue
            parts.append(node.outputs[0])
        before = 0
        for lobe, one, inputs in zip(mixture.lobes, ones, given, strict=True):
            parts += _placed(group, one, lobe, inputs, (texel, before) if texel else None)
            before += 2 if lobe.paired else 1
        return group.sum(parts)

    if texel:
        cloth = _near(group, summed, texel, transparent)
    else:
        cloth = summed(None)
        cloth = cloth if opacity is None else group.seen_through(cloth, opacity)
    return group.end(cloth)


def _near(group: Group, summed: Any, texel: Texel, transparent: bool) -> Any:
    """Return the lobes of a texel, mixed by `Afar` with those of the whole cloth."""
    threads = texel.threads
    near, far = [summed(texel)], summed(None)
    if transparent:
        # The lobes are those of the texel, its gaps included, and are not dimmed once more.
        gap = group.math("SUBTRACT", 1.0, texel.cover)
        color = group.joined(gap, gap, gap)
        near.append(group.add("ShaderNodeBsdfTransparent", Color=color).outputs[0])
        far = group.seen_through(far, sum(threads.share))
    whole_cloth = [far]
    if threads.through:
        color = texel.color(threads.through)
        near.append(group.add("ShaderNodeBsdfTranslucent", Color=color).outputs[0])
        whole = threads.whole(threads.through)
        whole_cloth.append(group.add("ShaderNodeBsdfTranslucent", Color=whole).outputs[0])
    # Cycles does not evaluate what a factor of 0 or 1 leaves out.
    return group.mixed(group.sum(near), group.sum(whole_cloth), afar(group))


def _frame(group: Group) -> tuple[Any, Any]:
    """Return the normal on the viewer's side, and the direction to the viewer."""
    geometry = group.add("ShaderNodeNewGeometry")
    return geometry.outputs["Normal"], geometry.outputs["Incoming"]


def _axis(group: Group, place: Any, normal: Any) -> Any:
    """Return a direction of texture space in world space, at right angles to the normal."""
    code = group.vector("MULTIPLY_ADD", place, (0.5, 0.5, 0.5), (0.5, 0.5, 0.5))
    along = group.world(code)
    # On back faces the node returns the opposite direction, as it does with normals.
    back = group.add("ShaderNodeNewGeometry").outputs["Backfacing"]
    along = group.scaled(along, group.math("MULTIPLY_ADD", back, -2.0, 1.0))
    above = group.scaled(normal, group.vector("DOT_PRODUCT", along, normal))
    return group.vector("NORMALIZE", group.vector("SUBTRACT", along, above))


def _power(group: Group, base: Any, least: float, power: Any) -> Any:
    return group.math("POWER", group.math("MAXIMUM", base, least), power)


def _view(
    group: Group, coefficients: tuple[float, ...], up: Any, eye: Any, axes: dict[str, Any]
) -> Any:
    """Return V: the exponential of polynomials in s = N.wo^1/2, one for each of 1, d, d^2, x, y."""
    if not coefficients:
        return 1.0
    s = group.math("SQRT", group.math("MAXIMUM", up, SHARP))
    x, y = (group.vector("DOT_PRODUCT", eye, axes[noun]) for noun in ("weft", "warp"))
    d = group.math("SUBTRACT", group.math("MULTIPLY", x, x), group.math("MULTIPLY", y, y))
    around = (None, d, group.math("MULTIPLY", d, d), x, y)
    total: Any = 0.0
    for k in range(len(coefficients) // POWERS):
        *low, term = coefficients[k * POWERS : (k + 1) * POWERS]
        for c in reversed(low):
            term = group.math("MULTIPLY_ADD", term, s, c)
        factor = around[k]
        total = term if factor is None else group.math("MULTIPLY_ADD", term, factor, total)
    return group.math("EXPONENT", total)


def _given(group: Group, number: int, lobe: Lobe, axis: Any, view: Any) -> dict[str, Any]:
    """Return inputs of the group for the numbers of a lobe, or of a pair."""
    title = f"Lobe {number + 1}"
    panel = group.panel(f"{title}: along the {lobe.along}{', a pair' if lobe.paired else ''}")

    def given(name: str, value: Any, **more: Any) -> Any:
        return group.input(f"{title} {name}", value, panel=panel, **more)

    return {
        "Color": given("Color", lobe.color, color=True),
        "Tilt": given("Tilt", lobe.tilt, low=-1.5, high=1.5),
        "Width Along": given("Width Along", lobe.alpha_along, low=NARROWEST, high=1.0),
        "Width Across": given("Width Across", lobe.alpha_across, low=NARROWEST, high=1.0),
        "Facing": given("Facing", lobe.facing), "Crossing": given("Crossing", lobe.crossing),
        "Upright": given("Upright", lobe.upright), "Axis": axis, "View": view,
    }  # fmt: skip


def _placed(
    group: Group, one: Any, lobe: Lobe, inputs: dict[str, Any], turned: tuple[Texel, int] | None
) -> list[Any]:
    """Add a lobe, or both of a pair.

    turned : the texel under the point, and how many lobes come before
    """
    found = []
    for back, sign in enumerate((1.0, -1.0) if lobe.paired else (1.0,)):
        node = group.add("ShaderNodeGroup")
        node.node_tree = one
        mine = dict(inputs)
        if sign < 0:
            mine["Tilt"] = group.math("MULTIPLY", inputs["Tilt"], sign)
        if turned:
            texel, at = turned[0], turned[1] + back
            known = turning(texel.threads, at, lobe.color, AXES.index(lobe.along))
            factor = texel.color(texel.threads.factors[at])
            mine["Color"] = group.vector("MULTIPLY", inputs["Color"], factor)
            mine["Tilt"], mine["Width Along"] = texel.placed(
                known, mine["Tilt"], inputs["Width Along"], texel.threads.own[at]
            )
        for name, value in mine.items():
            group.set(node.inputs[name], value)
        found.append(node.outputs[0])
    return found


def _one_lobe(gaussian: bool) -> Any:
    """Return the tree of one lobe of a distribution, which all fabrics share."""
    form = 2 if gaussian else 1
    known = (one for one in bpy.data.node_groups if one.get(FORM) == form)
    found = next(known, None)
    if found is not None:
        return found
    group = Group(ONE_LOBE)
    group.tree[FORM] = form
    color = group.input("Color", (0.1, 0.1, 0.1), color=True)
    tilt = group.input("Tilt", 0.0)
    along, across = (group.input(f"Width {name}", 0.5) for name in ("Along", "Across"))
    facing, crossing, upright = (
        group.input(name, 0.0) for name in ("Facing", "Crossing", "Upright")
    )
    axis, view = group.input("Axis", (1.0, 0.0, 0.0)), group.input("View", 1.0)
    normal, eye = _frame(group)
    s, c = group.math("SINE", tilt), group.math("COSINE", tilt)
    n = group.vector("ADD", group.scaled(axis, s), group.scaled(normal, c))
    t = group.vector("SUBTRACT", group.scaled(axis, c), group.scaled(normal, s))
    n, t = group.vector("NORMALIZE", n), group.vector("NORMALIZE", t)
    no, to, up = (group.vector("DOT_PRODUCT", eye, v) for v in (n, t, normal))
    cross = group.math("SUBTRACT", 1.0, group.math("MULTIPLY", to, to))
    weight = group.math("MULTIPLY", view, group.math("GREATER_THAN", no, SMALLEST))
    for base, least, power in (
        (no, FACING, facing), (cross, CROSSING, crossing), (up, UPRIGHT, upright)
    ):  # fmt: skip
        weight = group.math("MULTIPLY", weight, _power(group, base, least, power))
    roughness, anisotropy = _widths(group, along, across)
    node = group.add(
        "ShaderNodeBsdfAnisotropic", Color=group.scaled(color, weight), Roughness=roughness,
        Anisotropy=anisotropy, Normal=n, Tangent=t,
    )  # fmt: skip
    node.distribution = "BECKMANN" if gaussian else "GGX"
    return group.end(node.outputs[0])


def _widths(group: Group, along: Any, across: Any) -> tuple[Any, Any]:
    """Return roughness and anisotropy of Blender's node.

    Its alphas are r^2 (1 - a) along the tangent and r^2/(1 - a) across it; for a below 0,
    r^2/(1 + a) and r^2 (1 + a).
    """
    roughness = group.math("POWER", group.math("MULTIPLY", along, across), 0.25)
    most = group.math("MAXIMUM", along, across)
    ratio = group.math("DIVIDE", group.math("MINIMUM", along, across), most)
    apart = group.math("SUBTRACT", 1.0, group.math("SQRT", ratio))
    sign = group.math("SIGN", group.math("SUBTRACT", across, along))
    return roughness, group.math("MULTIPLY", apart, sign)


def lays(look: Look) -> dict[str, Any]:
    """Return the group's inputs that say how the cloth lies, and its opacity if it is constant."""
    found: dict[str, Any] = {"Weft": (*look.weft, 0.0), "Warp": (*look.warp, 0.0)}
    if look.transparent and "opacity" in look.constants:
        found["Opacity"] = look.constants["opacity"]
    return found
