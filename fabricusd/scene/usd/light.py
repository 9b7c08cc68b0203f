"""Reads UsdLux prims as lights.

Radiance follows the schema: intensity times 2^exposure times colour; times the colour of a black
body where the light asks for one; divided by the light's area where the light is normalised.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdLux

from fabricusd.errors import FabricError
from fabricusd.images.files import read_image
from fabricusd.scene.light_kinds import DISTANT, DOME, KINDS, Size
from fabricusd.scene.scene import Light, Scene
from fabricusd.scene.usd.asset import asset_file
from fabricusd.scene.usd.value import value_of

_NUMBERS = {name: number for number, kind in enumerate(KINDS) for name in kind.usd}

_SMALLEST = 1e-3
"""Size, in scene units, of a normalised light without extent: it has power and needs a surface."""

_BRIGHTEST = 1e16
"""Largest radiance: a picture's variance holds its square as a 32-bit number."""

_FARTHEST = 1e15
"""Metres beyond which a 32-bit number cannot hold a light's area."""

_NOTHING = 1e-30
"""Area [square scene units] below which a light counts as having no surface."""

_UNEVEN = 1e-3
"""Relative difference of scales above which a sphere is no longer round."""


def is_light(prim: Usd.Prim) -> bool:
    """Whether a prim, mesh or not, is a light."""
    return bool(prim.HasAPI(UsdLux.LightAPI)) or prim.GetTypeName().endswith("Light")


class _Inputs:
    """A light's inputs by their names, with or without the prefix that USD 21.02 introduced."""

    def __init__(self, prim: Usd.Prim, time: Usd.TimeCode, scene: Scene) -> None:
        self.prim, self.time, self.scene = prim, time, scene

    def get(self, name: str, otherwise: Any) -> Any:
        """The value of `inputs:name`, or of `name` where only that is authored."""
        attribute = self.prim.GetAttribute(f"inputs:{name}")
        if not (attribute and attribute.HasAuthoredValue()):
            older = self.prim.GetAttribute(name)
            attribute = older if older and older.HasAuthoredValue() else attribute
        given = value_of(attribute, self.time, self.scene)
        return otherwise if given is None else given

    def numbers(self, name: str, otherwise: tuple[float, ...]) -> NDArray[np.float64]:
        """As many numbers as `otherwise` has; `otherwise`, with a note, for another value."""
        given = self.get(name, otherwise if len(otherwise) > 1 else otherwise[0])
        try:
            values = np.array(given, np.float64).reshape(-1)
        except (TypeError, ValueError):
            values = np.zeros(0)
        if len(values) == len(otherwise):
            return values
        self.note(f"has {name} '{given}', which is of another type; {otherwise} is taken")
        return np.array(otherwise)

    def number(self, name: str, otherwise: float) -> float:
        return float(self.numbers(name, (otherwise,))[0])

    def file(self, name: str) -> Sdf.AssetPath | None:
        """The file that the input names, or None."""
        asset = self.get(name, None)
        return asset if isinstance(asset, Sdf.AssetPath) and asset.path else None

    def note(self, problem: str) -> None:
        self.scene.note(str(self.prim.GetPath()), problem)


def read_light(
    prim: Usd.Prim,
    time: Usd.TimeCode,
    matrix: NDArray[np.float64],
    metres: float,
    scene: Scene,
) -> Light | None:
    """The light of a prim; None, with a note, where it cannot be rendered.

    matrix : (4, 4) local to world, in scene units of `metres`
    """
    inputs = _Inputs(prim, time, scene)
    kind = _NUMBERS.get(str(prim.GetTypeName()))
    if kind is None:
        inputs.note(f"is a light of the unknown type '{prim.GetTypeName()}', left out")
        return None
    angle = math.radians(inputs.number("angle", 0.53)) if kind == DISTANT else 0.0
    normalize = bool(inputs.get("normalize", False))
    radiance = _radiance(inputs)
    lengths = _lengths(inputs, kind, normalize)
    if radiance is None or lengths is None:
        return None
    if not (np.isfinite(matrix).all() and 0 <= angle <= 2 * math.pi):
        inputs.note("has an angle or a transform that makes no sense, left out")
        return None
    size = _size(kind, matrix, lengths, angle)
    if size < _NOTHING:
        inputs.note("has a scale of 0, left out")
        return None
    if normalize:
        radiance = radiance / size
    if radiance.max() > _BRIGHTEST:
        inputs.note(f"has a radiance of {radiance.max():.3g}, beyond {_BRIGHTEST:g}; left out")
        return None
    if kind == DISTANT and angle <= 0 and not normalize:
        inputs.note("has no angle; its intensity is taken as irradiance")
    frame = matrix.copy()
    frame[:3, 3] *= metres
    if lengths and _reach(frame, lengths, metres) > _FARTHEST:
        inputs.note(f"reaches beyond {_FARTHEST:g} m, left out")
        return None
    _note_left_out(inputs, kind, matrix)
    return Light(
        path=str(prim.GetPath()),
        kind=kind,
        radiance=(float(radiance[0]), float(radiance[1]), float(radiance[2])),
        frame=_pole(inputs, frame) if kind == DOME else frame,
        width=lengths.get("width", 1.0) * metres,
        height=lengths.get("length", lengths.get("height", 1.0)) * metres,
        radius=lengths.get("radius", 0.5) * metres,
        angle=angle,
        image=_picture(inputs) if kind == DOME else None,
        camera_visible=kind == DOME,
    )


def _radiance(inputs: _Inputs) -> NDArray[np.float64] | None:
    """(3,) emission before normalisation; None, with a note, where it is not finite."""
    color = inputs.numbers("color", (1.0, 1.0, 1.0))
    if inputs.get("enableColorTemperature", False):
        color = color * _of_black_body(inputs)
    with np.errstate(over="ignore", invalid="ignore"):
        stops = np.exp2(inputs.number("exposure", 0.0))
        radiance = color * inputs.number("intensity", 1.0) * stops
    if not np.isfinite(radiance.astype(np.float32)).all():
        inputs.note("has an intensity, exposure or colour that is not finite, left out")
        return None
    if (radiance < 0).any():
        inputs.note("has a negative intensity or colour, which is taken as 0")
    return np.asarray(np.maximum(radiance, 0.0))


def _of_black_body(inputs: _Inputs) -> NDArray[np.float64]:
    """(3,) colour of the light's temperature; UsdLux defines it from 1000 to 10000 K."""
    given = inputs.number("colorTemperature", 6500.0)
    if math.isnan(given):
        # USD's own function would abort the process.
        return np.full(3, math.nan)
    kelvin = min(max(given, 1000.0), 10000.0)
    if kelvin != given:
        inputs.note(f"has colorTemperature {given:g}; {kelvin:g} is taken")
    return np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin))


def _lengths(inputs: _Inputs, kind: int, normalize: bool) -> dict[str, float] | None:
    """The light's lengths by name; None, with a note, where one is not positive."""
    found = {}
    for name, otherwise in KINDS[kind].lengths.items():
        length = inputs.number(name, otherwise)
        if not (math.isfinite(length) and length >= 0) or (length == 0 and not normalize):
            inputs.note(f"has {name} {length:g}; it must be above 0, left out")
            return None
        found[name] = max(length, _SMALLEST) if normalize else length
    return found


def _note_left_out(inputs: _Inputs, kind: int, matrix: NDArray[np.float64]) -> None:
    """Note, in one line each, what a light asks for and is not rendered."""
    for name in ("diffuse", "specular"):
        share = inputs.number(name, 1.0)
        if share != 1:
            inputs.note(f"has a {name} multiplier of {share:g}, left out: it counts as 1")
    if kind != DOME and inputs.file("texture:file") is not None:
        inputs.note("has a texture, left out: it shines evenly")
    if inputs.prim.HasAPI(UsdLux.ShapingAPI) and _is_shaped(inputs):
        inputs.note("is shaped by a cone, focus or profile, which is left out")
    if inputs.prim.HasAPI(UsdLux.ShadowAPI) and not inputs.get("shadow:enable", True):
        inputs.note("asks for no shadows; it casts them")
    if inputs.prim.GetRelationship("light:filters").GetTargets():
        inputs.note("has light filters, left out")
    for name in ("lightLink", "shadowLink"):
        if _is_linked(inputs.prim, name):
            inputs.note(f"has a {name} collection, left out: it lights and shadows everything")
    scales = np.linalg.norm(matrix[:3, :3], axis=0)
    first = KINDS[kind].round
    if first is not None and np.ptp(scales[first:]) > _UNEVEN * scales[first:].max():
        inputs.note("is scaled unevenly; it is rendered round, with its mean radius")


def _is_shaped(inputs: _Inputs) -> bool:
    return (
        inputs.number("shaping:cone:angle", 90.0) < 90
        or inputs.number("shaping:focus", 0.0) != 0
        or inputs.file("shaping:ies:file") is not None
    )


def _is_linked(prim: Usd.Prim, name: str) -> bool:
    """Whether a light's collection is anything but the whole stage."""
    if not prim.HasAPI(Usd.CollectionAPI, name):
        return False
    collection = Usd.CollectionAPI(prim, name)
    return (
        collection.GetIncludeRootAttr().Get() is False
        or bool(collection.GetExcludesRel().GetTargets())
        or collection.GetMembershipExpressionAttr().HasAuthoredValue()
    )


def _reach(frame: NDArray[np.float64], lengths: dict[str, float], metres: float) -> float:
    """An upper bound of the distance from the origin to any point of a light [m]."""
    extent = float(np.abs(frame[:3, :3]).max()) * max(lengths.values()) * metres
    return float(np.abs(frame[:3, 3]).max()) + extent


def _size(kind: int, matrix: NDArray[np.float64], lengths: dict[str, float], angle: float) -> float:
    """The size that `normalize` divides the radiance by."""
    x, y, z = (float(np.linalg.norm(matrix[:3, k])) for k in range(3))
    flat = float(np.linalg.norm(np.cross(matrix[:3, 0], matrix[:3, 1])))
    return KINDS[kind].size(Size(x, y, z, flat, lengths, angle))


def _pole(inputs: _Inputs, frame: NDArray[np.float64]) -> NDArray[np.float64]:
    """A dome's frame, turned so that its pole is +y; a DomeLight_1 may name another pole."""
    axis = inputs.prim.GetAttribute("poleAxis")
    pole = axis.Get() if axis else None
    if pole == "scene":
        pole = inputs.scene.up_axis
    if pole != "Z":
        return frame
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    return frame @ turn


def _picture(inputs: _Inputs) -> NDArray[np.float32] | None:
    """A dome's picture (h, w, 3); None for a dome of constant radiance."""
    asset = inputs.file("texture:file")
    if asset is None:
        return None
    layout = inputs.get("texture:format", "automatic")
    if layout not in ("automatic", "latlong"):
        inputs.note(f"has a picture laid out as '{layout}'; it is rendered as constant")
        return None
    try:
        with asset_file(asset) as file:
            picture = read_image(file, most=4096)
    except FabricError as error:
        inputs.note(f"is rendered as constant: {error}")
        return None
    finite = np.isfinite(picture)
    if not finite.all():
        # A sun brighter than the largest half float is infinite in the file; it stays brightest.
        brightest = float(picture[finite].max(initial=0.0))
        inputs.note(
            f"has {int((~finite).sum())} values that are not finite; infinity is taken as "
            f"{brightest:g}, the rest as 0"
        )
        picture = np.nan_to_num(picture, nan=0.0, posinf=brightest, neginf=0.0)
    if (picture < 0).any():
        inputs.note(f"has {int((picture < 0).sum())} negative values; they are taken as 0")
        picture = np.maximum(picture, 0.0)
    return np.ascontiguousarray(np.broadcast_to(picture, (*picture.shape[:2], 3)), np.float32)
