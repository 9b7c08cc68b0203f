"""Where cylinders of cloth, camera and light stand: a JSON file, checked before anything is done.

World space is right-handed with y up. Cylinders stand upright. Lengths have one unit, whichever.
"""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fabricusd.errors import FabricError, one_line, reads
from fabricusd.files import readable_file

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]

FIT, PREDICT = "fit", "predict"


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """A wrap. x, z : of its axis; radius : of the cloth; bottom, top : rows that are used
    angle : of the weft to the direction around the cylinder, counter-clockwise seen from outside
        [rad]: 0 for warp upright, 90 degrees for warp around
    use : "fit", or "predict" for a wrap that is only compared
    """

    name: str
    x: float
    z: float
    radius: float
    bottom: float
    top: float
    angle: float
    use: str = FIT


@dataclass(frozen=True, kw_only=True)
class Stand:
    """A setup. eye, target : of the camera; view_angle : across the picture [rad]
    lights : direction towards the light of each photograph
    irradiance : of the light, face on, in the photographs' values; 0 if it is not known
    """

    eye: Vector
    target: Vector
    view_angle: float
    lights: tuple[Vector, ...]
    cylinders: tuple[Cylinder, ...]
    irradiance: float = 0.0

    @property
    def axes(self) -> Floats:
        """(3, 3), columns right, up and back of the camera."""
        back = np.subtract(self.eye, self.target)
        back = back / np.linalg.norm(back)
        right = np.cross([0.0, 1.0, 0.0], back)
        right = right / np.linalg.norm(right)
        return np.stack((right, np.cross(back, right), back), axis=1)

    def project(self, points: Floats, shape: tuple[int, int]) -> Floats:
        """(n, 2) pixel places (x right, y down) of points (n, 3)."""
        height, width = shape
        local = (points - np.asarray(self.eye)) @ self.axes
        focal = 0.5 * width / math.tan(0.5 * self.view_angle)
        x = 0.5 * width + focal * local[:, 0] / -local[:, 2]
        return np.stack((x, 0.5 * height - focal * local[:, 1] / -local[:, 2]), axis=1)


def frame_at(cylinder: Cylinder, phi: Floats) -> tuple[Floats, Floats, Floats]:
    """(U, V, N), each (n, 3), of the cloth at azimuths phi, 0 towards +z and growing to +x."""
    zero = np.zeros_like(phi)
    normal = np.stack((np.sin(phi), zero, np.cos(phi)), axis=1)
    around = np.stack((np.cos(phi), zero, -np.sin(phi)), axis=1)
    up = np.array([0.0, 1.0, 0.0])
    c, s = math.cos(cylinder.angle), math.sin(cylinder.angle)
    return c * around + s * up, -s * around + c * up, normal


@reads("a setup of cylinders")
def read_stand(path: str | os.PathLike[str], photographs: int) -> Stand:
    """Read a setup for so many photographs; FabricError for what cannot be one."""
    where = str(readable_file(Path(path)))
    try:
        given = json.loads(Path(where).read_text("utf-8-sig"))
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise FabricError(where, f"is not JSON: {one_line(str(error), 120)}") from None
    if not isinstance(given, dict):
        raise FabricError(where, "is not an object; it must hold camera, light and cylinders")
    camera = _part(given, "camera", dict, where)
    light = _part(given, "light", dict, where)
    if "direction" in light:
        towards = light["direction"]
        many = isinstance(towards, list) and towards and isinstance(towards[0], list)
        lights = [_vector(v, "light direction", where) for v in (towards if many else [towards])]
    else:
        raise FabricError(where, "has no light direction; it must have X, Y, Z towards the light")
    if len(lights) not in (1, photographs):
        raise FabricError(
            where, f"has {len(lights)} light directions; it must have 1, or {photographs}"
        )
    cylinders = [
        _cylinder(entry, k, where) for k, entry in enumerate(_part(given, "cylinders", list, where))
    ]
    if not any(c.use == FIT for c in cylinders):
        raise FabricError(where, 'has no cylinder to fit; one must have "use": "fit", or no "use"')
    stand = Stand(
        eye=_vector(camera.get("position"), "camera position", where),
        target=_vector(camera.get("target"), "camera target", where),
        view_angle=math.radians(
            _number(camera.get("view_angle"), "camera view_angle", where, 1, 150)
        ),
        lights=tuple(_unit(v, where) for v in (lights * photographs)[:photographs]),
        cylinders=tuple(cylinders),
        irradiance=_number(light.get("irradiance", 0.0), "light irradiance", where, 0, 1e12),
    )  # fmt: skip
    if np.linalg.norm(np.cross([0, 1, 0], np.subtract(stand.eye, stand.target))) < 1e-9:
        raise FabricError(where, "has a camera that looks straight up or down, or nowhere")
    return stand


def _part(given: dict[str, Any], key: str, kind: type, where: str) -> Any:
    found = given.get(key)
    if not isinstance(found, kind) or not found:
        noun = "an object" if kind is dict else "a list"
        raise FabricError(where, f"has no '{key}'; it must be {noun}")
    return found


def _cylinder(entry: Any, k: int, where: str) -> Cylinder:
    if not isinstance(entry, dict):
        raise FabricError(where, f"cylinder {k} is not an object")

    def get(key: str, low: float, high: float, default: float | None = None) -> float:
        return _number(entry.get(key, default), f"cylinder {k} {key}", where, low, high)

    use = entry.get("use", FIT)
    if use not in (FIT, PREDICT):
        raise FabricError(where, f"cylinder {k} use is {use!r}; it must be '{FIT}' or '{PREDICT}'")
    made = Cylinder(
        name=str(entry.get("name", f"cylinder {k}")), x=get("x", -1e9, 1e9),
        z=get("z", -1e9, 1e9, 0.0),
        radius=get("radius", 1e-9, 1e9), bottom=get("bottom", -1e9, 1e9), top=get("top", -1e9, 1e9),
        angle=math.radians(get("angle", -360, 360)), use=use,
    )  # fmt: skip
    if not made.top > made.bottom:
        raise FabricError(
            where, f"cylinder {k} top is {made.top:g}; it must be above the bottom, {made.bottom:g}"
        )
    return made


def _number(value: Any, what: str, where: str, low: float, high: float) -> float:
    good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if not (good and low <= value <= high):
        raise FabricError(
            where, f"{what} is {value!r}; it must be a number from {low:g} to {high:g}"
        )
    return float(value)


def _vector(value: Any, what: str, where: str) -> Vector:
    if not isinstance(value, list) or len(value) != 3:
        raise FabricError(where, f"{what} is {value!r}; it must be three numbers")
    x, y, z = (_number(v, what, where, -1e9, 1e9) for v in value)
    return x, y, z


def _unit(value: Vector, where: str) -> Vector:
    length = math.sqrt(sum(v * v for v in value))
    if not length > 0:
        raise FabricError(where, "light direction has length 0")
    x, y, z = (v / length for v in value)
    return x, y, z
