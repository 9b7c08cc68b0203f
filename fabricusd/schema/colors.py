"""Which color space a prim's colour is in, and what it is in linear Rec. 709, which fabrics use.

USD says so in an attribute's `colorSpace`, or for all below a prim in `ColorSpaceAPI`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Gf, Usd

from fabricusd.schema.access import is_authored, value

LINEAR = "lin_rec709_scene"
"""What fabrics are written in, and what a colour is in that names no color space."""

AS_IT_IS = ("", LINEAR, "raw", "data", "unknown", "identity")
"""Color spaces that leave the numbers alone."""

NAMED = (
    "srgb_rec709_scene",
    "g18_rec709_scene",
    "g22_rec709_scene",
    "lin_rec2020_scene",
    "lin_ap0_scene",
    "lin_ap1_scene",
    "g22_ap1_scene",
    "srgb_ap1_scene",
    "lin_p3d65_scene",
    "lin_displayp3_scene",
    "srgb_p3d65_scene",
    "lin_adobergb_scene",
    "g22_adobergb_scene",
    "g24_rec709_scene",
    "lin_ciexyzd65_scene",
)
"""USD's color spaces that a colour is converted from."""

GAMUTS = {
    "rec709": "ITU-R BT.709",
    "rec2020": "ITU-R BT.2020",
    "ap0": "ACES2065-1",
    "ap1": "ACEScg",
    "p3d65": "Display P3",
    "displayp3": "Display P3",
    "adobergb": "Adobe RGB (1998)",
}
"""USD's names of primaries, and colour-science's."""

GAMMAS = {"lin": 1.0, "g18": 1.8, "g22": 2.2, "g24": 2.4}
ADOBE_GAMMA = 563 / 256
"""What Adobe RGB's gamma of "2.2" is exactly."""


def space_name(attribute: Usd.Attribute) -> str:
    """The color space of an attribute: its own, or the nearest above; "" where none is named."""
    if attribute.HasColorSpace():
        return str(attribute.GetColorSpace())
    prim = attribute.GetPrim()
    while prim:
        applied = prim.GetMetadata("apiSchemas")
        # USD before 25.5 does not know this schema.
        if applied is not None and "ColorSpaceAPI" in applied.GetAppliedItems():
            named = prim.GetAttribute("colorSpace:name")
            found = named.Get() if named else None
            if found:
                return str(found)
        prim = prim.GetParent()
    return ""


def is_known(attribute: Usd.Attribute) -> bool:
    """Whether an attribute's color space is one of USD's, or defined above it."""
    name = space_name(attribute)
    return name in AS_IT_IS or name in NAMED or _is_defined(attribute, name)


def color(prim: Usd.Prim, name: str) -> Any:
    """(3,) a colour in linear Rec. 709; as authored where its color space is not known."""
    held = value(prim, name)
    attribute = prim.GetAttribute(name)
    # Fallbacks are the schema's, in its own color space.
    if not attribute or not is_authored(attribute, at_rest=True):
        return held
    space = space_name(attribute)
    if space in AS_IT_IS:
        return held
    if space in NAMED:
        return _from_named(held, space)
    return _from_defined(held, attribute, space)


def _from_named(held: Any, name: str) -> tuple[float, ...]:
    """A colour from a color space of USD's.

    colour-science converts it: `Gf.ColorSpace` of USD 24.11 and 25.5 does not adapt the white point
    of ACES. USD 25.11 does, by the same Bradford transform, and the results agree.
    """
    import colour

    curve, gamut, _ = name.split("_")
    encoded = np.asarray(held, np.float64)
    if curve == "srgb":
        linear = np.asarray(colour.models.eotf_sRGB(encoded))
    else:
        gamma = ADOBE_GAMMA if (curve, gamut) == ("g22", "adobergb") else GAMMAS[curve]
        linear = np.sign(encoded) * np.abs(encoded) ** gamma
    spaces = colour.RGB_COLOURSPACES
    ours = spaces[GAMUTS["rec709"]]
    if gamut == "ciexyzd65":
        made = ours.matrix_XYZ_to_RGB @ linear
    else:
        made = colour.RGB_to_RGB(
            linear, spaces[GAMUTS[gamut]], ours, chromatic_adaptation_transform="Bradford"
        )
    return tuple(float(x) for x in made)


def _is_defined(attribute: Usd.Attribute, name: str) -> bool:
    """Whether ColorSpaceDefinitionAPI, which USD has from 25.5 on, defines a color space."""
    api = getattr(Usd, "ColorSpaceAPI", None)
    return api is not None and bool(api.IsValidColorSpaceName(attribute.GetPrim(), name, None))


def _from_defined(held: Any, attribute: Usd.Attribute, name: str) -> Any:
    if not _is_defined(attribute, name):
        return held
    space = Usd.ColorSpaceAPI.ComputeColorSpace(attribute, None)
    made = Gf.ColorSpace(LINEAR).Convert(space, Gf.Vec3f(*(float(x) for x in held)))
    return tuple(float(x) for x in made.GetRGB())
