"""UsdLux prims as lights. Radiance follows the schema: intensity times 2^exposure times colour,
times the colour of a black body where asked for, over the light's area where it is normalised."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdLux

from fabricusd.errors import FabricError
from fabricusd.images import read_image
from fabricusd.reference.scene import CYLINDER, DISK, DISTANT, DOME, RECT, SPHERE, Light, Scene

_KINDS = {
    "DistantLight": DISTANT,
    "DomeLight": DOME,
    "DomeLight_1": DOME,
    "RectLight": RECT,
    "DiskLight": DISK,
    "SphereLight": SPHERE,
    "CylinderLight": CYLINDER,
}


def is_light(prim: Usd.Prim) -> bool:
    """Whether a prim, mesh or not, claims to shine."""
    return bool(prim.HasAPI(UsdLux.LightAPI)) or prim.GetTypeName().endswith("Light")


def read_light(
    prim: Usd.Prim,
    time: Usd.TimeCode,
    matrix: NDArray[np.float64],
    metres: float,
    scene: Scene,
) -> Light | None:
    """The light of a prim, or None with a note where it cannot be rendered.

    matrix : (4, 4) local to world, in scene units of `metres`
    """
    where = str(prim.GetPath())
    kind = _KINDS.get(str(prim.GetTypeName()))
    if kind is None:
        scene.note(where, f"is a light of the unknown type '{prim.GetTypeName()}', left out")
        return None

    def value(name: str, default: Any) -> Any:
        attribute = prim.GetAttribute(f"inputs:{name}")
        got = attribute.Get(time) if attribute else None
        return default if got is None else got

    color = np.array(value("color", (1.0, 1.0, 1.0)), np.float64)
    if value("enableColorTemperature", False):
        color = color * np.array(
            UsdLux.BlackbodyTemperatureAsRgb(float(value("colorTemperature", 6500.0)))
        )
    radiance = color * float(value("intensity", 1.0)) * 2.0 ** float(value("exposure", 0.0))
    if not np.isfinite(radiance).all():
        scene.note(where, "has an intensity, exposure or colour that is not finite, left out")
        return None
    frame = matrix.copy()
    frame[:3, 3] *= metres
    angle = math.radians(float(value("angle", 0.53))) if kind == DISTANT else 0.0
    width, height = float(value("width", 1.0)), float(value("height", 1.0))
    radius = float(value("radius", 0.5))
    if kind == SPHERE and value("treatAsPoint", False):
        radius = 1e-3
    if kind == CYLINDER:
        height = float(value("length", 1.0))
        if value("treatAsLine", False):
            radius = 1e-3
    if value("normalize", False):
        radiance = radiance / _size(kind, matrix, width, height, radius, angle)
    elif kind == DISTANT and angle <= 0:
        scene.note(where, "has no angle; its intensity is taken as irradiance")
    if prim.HasAPI(UsdLux.ShapingAPI) and _is_shaped(value):
        scene.note(where, "is shaped by a cone or profile, which is left out")
    return Light(
        path=where,
        kind=kind,
        radiance=(float(radiance[0]), float(radiance[1]), float(radiance[2])),
        frame=_pole(prim, frame, value, scene) if kind == DOME else frame,
        width=width * metres,
        height=height * metres,
        radius=radius * metres,
        angle=angle,
        image=_picture(prim, where, value, scene) if kind == DOME else None,
        camera_visible=kind == DOME,
    )


def _is_shaped(value: Any) -> bool:
    return float(value("shaping:cone:angle", 90.0)) < 90 or bool(value("shaping:ies:file", None))


def _size(
    kind: int, matrix: NDArray[np.float64], width: float, height: float, radius: float, angle: float
) -> float:
    """What `normalize` divides by: area in square scene units, for a distant light its projected
    solid angle."""
    x, y, z = (float(np.linalg.norm(matrix[:3, k])) for k in range(3))
    mean = (x + y + z) / 3
    size = {
        DISTANT: math.pi * math.sin(0.5 * angle) ** 2 if angle > 0 else 1.0,
        RECT: width * x * height * y,
        DISK: math.pi * radius**2 * x * y,
        SPHERE: 4 * math.pi * (radius * mean) ** 2,
        CYLINDER: 2 * math.pi * radius * 0.5 * (y + z) * height * x,
    }.get(kind, 1.0)
    return max(size, 1e-12)


def _pole(
    prim: Usd.Prim, frame: NDArray[np.float64], value: Any, scene: Scene
) -> NDArray[np.float64]:
    """A dome's frame with its pole along +y: DomeLight_1 may have it along the stage's axis."""
    axis = prim.GetAttribute("poleAxis")
    pole = axis.Get() if axis else None
    if pole == "scene":
        pole = UsdGeom.GetStageUpAxis(prim.GetStage())
    if pole != "Z":
        return frame
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    return frame @ turn


def _picture(prim: Usd.Prim, where: str, value: Any, scene: Scene) -> NDArray[np.float32] | None:
    """A dome's picture (h, w, 3), or None and a constant dome."""
    asset = value("texture:file", None)
    if asset is None or not asset.path:
        return None
    layout = value("texture:format", "automatic")
    if layout not in ("automatic", "latlong"):
        scene.note(where, f"has a picture laid out as '{layout}'; it is rendered as constant")
        return None
    try:
        picture = read_image(asset.resolvedPath or asset.path, most=4096)
    except FabricError as error:
        scene.note(where, f"is rendered as constant: {error}")
        return None
    if not np.isfinite(picture).all():
        scene.note(where, f"has {int((~np.isfinite(picture)).sum())} values that are not finite")
        picture = np.where(np.isfinite(picture), picture, 0.0)
    return np.ascontiguousarray(np.broadcast_to(picture, (*picture.shape[:2], 3)), np.float32)
