"""Reads UsdGeomCamera prims as cameras."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom

from fabricusd.scene.scene import Camera, Scene
from fabricusd.scene.usd.value import value_of

_WIDEST = 1e4
"""Largest ratio of an aperture, or of its offset, to the focal length: an angle of 179.99 degrees.
Far beyond it a 32-bit number cannot hold a ray's direction."""

_FARTHEST = 1e9
"""Largest length [m]: the squares of longer ones leave the range of 32-bit numbers."""

_MOST_STOPS = 64.0
"""Largest exposure in stops, up or down; beyond it the camera is rendered without exposure."""


def read_camera(prim: Usd.Prim, time: Usd.TimeCode, metres: float, scene: Scene) -> Camera | None:
    """The camera of a prim; None, with a note, where the camera sees nothing.

    metres : in one scene unit; a camera's lengths on film are in tenths of a scene unit
    """
    camera = UsdGeom.Camera(prim)
    where = str(prim.GetPath())

    def value(attribute: Usd.Attribute) -> float:
        return float(value_of(attribute, time, scene))

    film = 0.1 * metres
    projection = value_of(camera.GetProjectionAttr(), time, scene)
    orthographic = projection == UsdGeom.Tokens.orthographic
    lengths = {
        "horizontalAperture": value(camera.GetHorizontalApertureAttr()),
        "focalLength": 1.0 if orthographic else value(camera.GetFocalLengthAttr()),
    }
    focal = lengths["focalLength"] * film
    offset = (
        value(camera.GetHorizontalApertureOffsetAttr()) * film,
        value(camera.GetVerticalApertureOffsetAttr()) * film,
    )
    near, far = (float(x) * metres for x in value_of(camera.GetClippingRangeAttr(), time, scene))
    matrix = UsdGeom.XformCache(time).GetLocalToWorldTransform(prim)
    frame = _frame(matrix, metres)
    problem = (
        _length_problem(lengths, film, orthographic)
        or _offset_problem(offset, focal, orthographic)
        or _clipping_problem(near, far, metres)
        or _frame_problem(frame, np.array(matrix))
    )
    if problem:
        scene.note(where, f"{problem}, left out")
        return None
    if value_of(camera.GetClippingPlanesAttr(), time, scene):
        scene.note(where, "has clipping planes, left out; its clipping range is kept")
    if near < 0:
        scene.note(where, f"has a near end of its clippingRange of {near:g} m; 0 is taken")
    f_stop, focus = _lens(camera, time, metres, focal, orthographic, scene)
    return Camera(
        path=where,
        frame=frame,
        focal_length=focal,
        aperture=(
            lengths["horizontalAperture"] * film,
            _vertical(value(camera.GetVerticalApertureAttr()) * film),
        ),
        aperture_offset=offset,
        f_stop=f_stop,
        focus_distance=focus,
        orthographic=orthographic,
        clipping=(max(near, 0.0), far),
        exposure=_stops(camera, time, scene),
    )


def _length_problem(lengths: dict[str, float], film: float, orthographic: bool) -> str:
    """Why a camera with these lengths sees nothing, or an empty string.

    film : metres in one unit of the lengths
    """
    for name, length in lengths.items():
        if not (math.isfinite(length) and 0 < length * film <= _FARTHEST):
            return f"has {name} {length:g}, which must be above 0 and below {_FARTHEST:g} m"
    ratio = lengths["horizontalAperture"] / lengths["focalLength"]
    if not orthographic and not 1 / _WIDEST**2 <= ratio <= _WIDEST:
        return (
            f"has horizontalAperture {lengths['horizontalAperture']:g} for focalLength "
            f"{lengths['focalLength']:g}; it must be {1 / _WIDEST**2:g} to {_WIDEST:g} times that"
        )
    return ""


def _offset_problem(offset: tuple[float, float], focal: float, orthographic: bool) -> str:
    most = _FARTHEST if orthographic else _WIDEST * focal
    for name, length in zip(("horizontal", "vertical"), offset, strict=True):
        if not abs(length) <= most:
            return f"has a {name}ApertureOffset of {length:g} m, which must be at most {most:g}"
    return ""


def _clipping_problem(near: float, far: float, metres: float) -> str:
    if not near < far:
        return f"has clippingRange {near / metres:g} to {far / metres:g}, which must rise"
    if near > _FARTHEST:
        return f"has a clippingRange from {near:g} m, which must be at most {_FARTHEST:g}"
    return ""


def _frame_problem(frame: np.ndarray[Any, Any], matrix: np.ndarray[Any, Any]) -> str:
    if not np.isfinite(matrix).all():
        return "has a transform that is not finite"
    axes = frame[:3, :3]
    if not (np.isfinite(frame).all() and np.allclose(axes.T @ axes, np.eye(3), atol=1e-3)):
        return "has a transform that is flat, or too large or small to have axes"
    if not np.abs(frame[:3, 3]).max() <= _FARTHEST:
        return f"stands beyond {_FARTHEST:g} m"
    return ""


def _frame(matrix: Gf.Matrix4d, metres: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(4, 4) orthonormal axes and position [m].

    As in other viewers, scale and shear are left out, and a mirrored camera does not mirror what it
    sees.
    """
    frustum = Gf.Frustum()
    frustum.SetPositionAndRotationFromMatrix(matrix)
    frame = np.array(frustum.ComputeViewInverse(), np.float64).T
    frame[:3, 3] *= metres
    return frame


def _lens(
    camera: UsdGeom.Camera,
    time: Usd.TimeCode,
    metres: float,
    focal: float,
    orthographic: bool,
    scene: Scene,
) -> tuple[float, float]:
    """(f-stop, focus distance [m]); (0, 0), which is sharp, and a note if they describe no lens."""
    f_stop = float(value_of(camera.GetFStopAttr(), time, scene))
    focus = float(value_of(camera.GetFocusDistanceAttr(), time, scene)) * metres
    if orthographic or f_stop == 0:
        return 0.0, focus if 0 <= focus <= _FARTHEST else 0.0
    problem = ""
    if not (f_stop > 0 and focal / f_stop <= _FARTHEST):
        problem = f"has f-stop {f_stop:g}, which must be above 0 and leave an opening"
    elif focus == 0:
        problem = f"has f-stop {f_stop:g} and no focus distance"
    elif not 0 < focus <= _FARTHEST:
        problem = f"has a focusDistance of {focus:g} m, which must be from 0 to {_FARTHEST:g}"
    if not problem:
        return f_stop, focus
    scene.note(str(camera.GetPath()), f"{problem}; all is rendered sharp")
    return 0.0, 0.0


def _vertical(length: float) -> float:
    """An aperture's height [m]. No picture depends on it: the picture's own format counts."""
    return length if 0 < length <= _FARTHEST else 0.0


def _exposure_scale(camera: UsdGeom.Camera, time: Usd.TimeCode) -> float:
    """Factor on the light that reaches the film."""
    if hasattr(camera, "ComputeLinearExposureScale"):
        return float(camera.ComputeLinearExposureScale(time))
    # USD 24.11 has neither this function nor all of the attributes.
    numbers = {"exposure": 0.0, "time": 1.0, "iso": 100.0, "fStop": 1.0, "responsivity": 1.0}
    for name in numbers:
        full = name if name == "exposure" else f"exposure:{name}"
        attribute = camera.GetPrim().GetAttribute(full)
        value = attribute.Get(time) if attribute else None
        numbers[name] = numbers[name] if value is None else float(value)
    light = numbers["time"] * numbers["iso"] / 100.0 * numbers["responsivity"]
    stop = numbers["fStop"]
    return light * 2.0 ** numbers["exposure"] / stop**2 if stop else math.inf


def _stops(camera: UsdGeom.Camera, time: Usd.TimeCode, scene: Scene) -> float:
    """Exposure in stops, of compensation, ISO, time, f-stop and responsivity together."""
    scale = _exposure_scale(camera, time)
    stops = math.log2(scale) if math.isfinite(scale) and scale > 0 else math.nan
    if abs(stops) <= _MOST_STOPS:
        return stops
    scene.note(
        str(camera.GetPath()),
        f"has an exposure that scales by {scale:g}, which must be from 2^-{_MOST_STOPS:g} to "
        f"2^{_MOST_STOPS:g}; it is rendered without",
    )
    return 0.0
